"""The one exception family of the project, at the bottom of the house so that every package can raise it.

Whatever a user can mend (a file, a key, a frame of the wrong size) is a `RobocupVisionError` whose message is one line
that names the file, the key and the offending value.
"""

from __future__ import annotations

from pathlib import Path


class RobocupVisionError(Exception):
    """Base class of all errors this project raises on purpose; `str(error)` is one line for the user."""


class FileError(RobocupVisionError):
    """A file is missing, damaged or says something impossible.

    Parameters
    ----------
    path : str or Path
        The file.
    problem : str
        What is wrong, in words.
    key : str, optional
        Dotted path of the offending key, e.g. ``floor_range.kind``.
    value : object, optional
        The offending value, shown with `repr`.
    """

    def __init__(self, path: str | Path, problem: str, *, key: str | None = None, value: object = ...) -> None:
        self.path = Path(path)
        self.key = key
        self.value = value
        where = f"{path}: " + (f"key '{key}': " if key else "")
        got = "" if value is ... else f", got {value!r}"
        super().__init__(" ".join((where + problem + got).split()))


class FrameError(RobocupVisionError):
    """A camera frame has the wrong type, shape or size; it is refused, never resized in silence."""


class ArgumentError(RobocupVisionError, ValueError):
    """An argument of a public function or command is out of its range."""
