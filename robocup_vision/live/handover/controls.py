"""What a page may do with the run it shows, and the pickled messages between the robot's process and the page's."""

from __future__ import annotations

import pickle
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

# what a page may ask for by name, and what must be offered for it
_NEEDED = {
    "pause": "pause",  # stand still, or go on
    "step": "pause",  # take one more frame while standing still
    "seek": "seek",  # go to a time, and stand still there
    "open": "open",  # open another recording of the same folder at a time
    "record": "record",  # begin or end recording
    "save": "save",  # write a picture's frame as a dataset
    "place": "place",  # put a robot of a simulation, or its ball, somewhere; without a heading a robot keeps its own
    "collect": "calibrate",  # begin or end collecting frames for a calibration
    "calibrate": "calibrate",  # calibrate a camera of a kind by the collected frames
}


class Controls:
    """Refuses everything; a run has a method for each thing that it offers.

    All calls come from the page's thread, not from the run's, and must return soon.

    Attributes
    ----------
    offers : frozenset of str
        What the run can do, of "pause", "seek", "open", "record", "save", "calibrate", "place". A run without "pause"
        goes on by itself, as a camera does: a page then stands still alone.
    """

    offers: frozenset[str] = frozenset()

    def ask(self, name: str, *values: object) -> None:
        """Do what a page asks for by name; raises RobocupVisionError if that is not offered, or cannot be done."""
        offer = _NEEDED[name]
        if offer not in self.offers:
            raise ArgumentError(_REFUSALS[offer])
        getattr(self, name)(*values)


def write_message(pipe: IO[bytes], message: tuple[Any, ...]) -> None:
    """Write a message to the other process; raises OSError or ValueError if that, or the pipe, has ended."""
    pipe.write(pickle.dumps(message, pickle.HIGHEST_PROTOCOL))
    pipe.flush()


def read_message(pipe: IO[bytes]) -> tuple[Any, ...] | None:
    """Read a message of the other process; None when it has ended."""
    try:
        message: tuple[Any, ...] = pickle.load(pipe)
    except (EOFError, pickle.UnpicklingError):
        return None
    return message
