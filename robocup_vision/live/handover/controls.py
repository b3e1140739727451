"""What a page may do with the run it shows, and the pickled messages between the robot's process and the page's."""

from __future__ import annotations

import pickle
import struct
from typing import IO, Any

from field_models.errors import ArgumentError

# what a run may offer, and the refusal that a page gets otherwise
_REFUSALS = {
    "pause": "this source cannot be paused: it goes on by itself",
    "seek": "this source cannot go to a time",
    "open": "no recordings can be opened: start live with the folder that holds them",
    "record": "this source cannot be recorded",
    "save": "frames of this source cannot be saved: it has no camera file",
    "place": "nothing can be put elsewhere here: only in a simulation",
    "calibrate": "this source needs no calibration: it has a camera file",
}
# of a message, before its bytes
_LENGTH = struct.Struct("<I")


class Controls:
    """Refuses everything; a run overrides what it offers.

    All calls come from the page's thread, not from the run's, and must return soon.

    Attributes
    ----------
    offers : frozenset of str
        What the run can do, of "pause", "seek", "open", "record", "save", "calibrate", "place". A run without "pause"
        goes on by itself, as a camera does: a page then stands still alone.
    """

    offers: frozenset[str] = frozenset()

    def need(self, offer: str) -> None:
        """Refuse what is not offered.

        Raises
        ------
        ArgumentError
            If it is not.
        """
        if offer not in self.offers:
            raise ArgumentError(_REFUSALS[offer])

    def pause(self, on: bool) -> None:
        """Stand still, or go on."""
        self.need("pause")

    def step(self) -> None:
        """Take one more frame while standing still."""
        self.need("pause")

    def seek(self, t_s: float) -> None:
        """Go to a time, and stand still there."""
        self.need("seek")

    def open(self, recording: str, t_s: float) -> None:
        """Open another recording of the same folder at a time."""
        self.need("open")

    def record(self, on: bool) -> None:
        """Begin or end recording."""
        self.need("record")

    def save(self, robot: str, number: int) -> None:
        """Write a picture's frame as a dataset."""
        self.need("save")

    def place(self, thing: str, x_m: float, y_m: float, theta_rad: float | None) -> None:
        """Put a robot of a simulation, or its ball, somewhere on the field; without a heading a robot keeps its own."""
        self.need("place")

    def collect(self, on: bool) -> None:
        """Begin or end collecting frames for a calibration."""
        self.need("calibrate")

    def calibrate(self, kind: str) -> None:
        """Calibrate a camera of a kind by the collected frames."""
        self.need("calibrate")


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
