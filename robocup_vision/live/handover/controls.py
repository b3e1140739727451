"""What a page may do with the run it shows, and the pickled messages between the robot's process and the page's."""

from __future__ import annotations

import pickle
from typing import IO, Any

from field_models.errors import ArgumentError

# everything that a run may offer, with the refusal for runs that do not
_REFUSALS = {
    "pause": "this source cannot be paused: it goes on by itself",
    "seek": "this source cannot go to a time",
    "open": "no recordings can be opened: start live with the folder that holds them",
    "record": "this source cannot be recorded",
    "save": "frames of this source cannot be saved: it has no camera file",
    "place": "nothing can be put elsewhere here: only in a simulation",
    "calibrate": "this source needs no calibration: it has a camera file",
}

# requests of a page by name, and the offer that each needs
_NEEDED = {
    "pause": "pause",  # pause, or go on
    "step": "pause",  # process one more frame while paused
    "seek": "seek",  # go to a time, and pause there
    "open": "open",  # open another recording of the same folder at a time
    "record": "record",  # begin or end recording
    "save": "save",  # write a picture's frame as a dataset
    "place": "place",  # move a robot or the ball of a simulation; without a heading a robot keeps its own
    "collect": "calibrate",  # begin or end collecting frames for a calibration
    "calibrate": "calibrate",  # calibrate a camera of a kind from the collected frames
}


class Controls:
    """Base class that refuses everything; a subclass has a method for each request that it offers.

    All calls come from the page's thread, not from the run's, and must return soon.

    Attributes
    ----------
    offers : frozenset of str
        What the run can do, of "pause", "seek", "open", "record", "save", "calibrate", "place". A run without "pause"
        cannot be stopped, like a camera: only the page's picture is paused then.
    """

    offers: frozenset[str] = frozenset()

    def ask(self, name: str, *values: object) -> None:
        """Carry out a page's request; raises RobocupVisionError if it is not offered, or cannot be done."""
        offer = _NEEDED[name]
        if offer not in self.offers:
            raise ArgumentError(_REFUSALS[offer])
        getattr(self, name)(*values)


def write_message(pipe: IO[bytes], message: tuple[Any, ...]) -> None:
    """Write a message to the other process; raises OSError or ValueError if it has ended or the pipe is closed."""
    pipe.write(pickle.dumps(message, pickle.HIGHEST_PROTOCOL))
    pipe.flush()


def read_message(pipe: IO[bytes]) -> tuple[Any, ...] | None:
    """Read a message of the other process; None if it has ended."""
    try:
        message: tuple[Any, ...] = pickle.load(pipe)
    except (EOFError, pickle.UnpicklingError):
        return None
    return message
