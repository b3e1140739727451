"""Messages between the robot's process and the page's: pickled tuples over the pipes that only these two hold."""

from __future__ import annotations

import pickle
import struct
from typing import IO, Any

_LENGTH = struct.Struct("<I")


def write_message(pipe: IO[bytes], message: tuple[Any, ...]) -> None:
    """Write a message to the other process.

    Raises
    ------
    OSError, ValueError
        If that process, or the pipe, has ended.
    """
    data = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
    pipe.write(_LENGTH.pack(len(data)) + data)
    pipe.flush()


def read_message(pipe: IO[bytes]) -> tuple[Any, ...] | None:
    """Read a message of the other process; None when it has ended."""
    head = pipe.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(head)
    data = pipe.read(length)
    return pickle.loads(data) if len(data) == length else None
