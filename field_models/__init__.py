"""RoboCup fields as data: built-in ones of several leagues, and the same strict file format for your own."""

from field_models.catalog import field_names, load_field
from field_models.errors import ArgumentError, FileError, FrameError, RobocupVisionError
from field_models.field import COLOR_NAMES, Beacon, Field, Goal, Mark, Net

__all__ = [
    "COLOR_NAMES",
    "ArgumentError",
    "Beacon",
    "Field",
    "FileError",
    "FrameError",
    "Goal",
    "Mark",
    "Net",
    "RobocupVisionError",
    "field_names",
    "load_field",
]
