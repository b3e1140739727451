"""The exceptions of the project, in its lowest package so that every package can raise them.

Every problem that a user can solve (a file, a key, a frame of the wrong size) is a `RobocupVisionError`, whose message
is one line that names the file, the key and the offending value.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any


class RobocupVisionError(Exception):
    """Base class of all errors that this project raises deliberately; `str(error)` is one line for the user."""

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(line.strip() for line in message.splitlines()))


class FileError(RobocupVisionError):
    """A file is missing, damaged or has invalid content.

    Parameters
    ----------
    path : str or Path
        The file.
    problem : str
        Text of the problem.
    key : str, optional
        Dotted path of the offending key, e.g. ``floor_range.kind``.
    value : object, optional
        The offending value, shown with `repr`.
    hint : str, optional
        End of the message: what the user may have meant, as from `did_you_mean`.
    """

    def __init__(
        self, path: str | Path, problem: str, *, key: str | None = None, value: object = ..., hint: str = ""
    ) -> None:
        self.path = Path(path)
        self.problem = problem
        self.key = key
        self.value = value
        self.hint = hint
        where = f"{path}: " + (f"key '{key}': " if key else "")
        shown = repr(value)
        got = "" if value is ... else f", got {shown if len(shown) <= 120 else shown[:117] + '...'}"
        super().__init__(where + problem + got + hint)

    def __reduce__(self) -> tuple[Any, ...]:
        # by default an exception is pickled with its message as the only argument, from which this one cannot be made
        # again; worker processes return their errors by pickle
        return partial(type(self), key=self.key, value=self.value, hint=self.hint), (str(self.path), self.problem)


class FrameError(RobocupVisionError):
    """A camera frame has the wrong type, shape or size; it is refused, never resized silently."""


class PacketError(RobocupVisionError):
    """Bytes from a network or a log are not the message that they should be."""


class ArgumentError(RobocupVisionError, ValueError):
    """An argument of a public function or command is out of its range."""
