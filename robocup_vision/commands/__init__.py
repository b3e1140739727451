"""The commands of `robocup-vision`, one file each, which handle options, calls and printed output.

A command is a function that adds its parser to the subparsers of an argparse parser and sets the parser's default `run`
to a function of the parsed arguments, which returns the exit status or raises `RobocupVisionError`. Other packages can
register such functions as entry points of the group `robocup_vision.commands`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

GROUP = "robocup_vision.commands"
_OWN = (
    "evaluate",
    "compare",
    "calibrate",
    "camera",
    "check",
    "live",
    "landmark_map",
    "log",
    "record",
    "replay",
    "ros",
    "fields",
    "import_boxes",
    "warm_up",
)


def registered() -> Iterator[Callable[[Any], object]]:
    """Yield the function that adds each command's parser: our own commands, then those of other packages by name."""
    for name in _OWN:
        yield import_module(f"robocup_vision.commands.{name}").add_parser
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        yield point.load()
