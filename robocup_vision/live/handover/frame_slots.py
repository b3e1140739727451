"""Moments in memory that the robot's process and the page's share, so that handing one over costs one copy.

A byte for each slot says whether it is filled. The robot fills a slot that is empty; the page's process looks for
filled slots some hundred times a second and empties them. Neither waits for the other, and the robot does not even wake
the other: on a busy machine a process that has just been woken is given the processor of the one that woke it.
"""

from __future__ import annotations

import mmap
import os
import struct
import tempfile
import threading
from pathlib import Path
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import UInt8Array

_HEADER_BYTES, MAX_SLOTS = 64, 32
# where the page's process says how much processor time it has used
_CPU = struct.Struct("<d")
_CPU_AT = 40
_EMPTY, _FILLED = 0, 1
# number, epoch, robot, moments left out before it, height and width of the frame, bytes of the rest
_SLOT = struct.Struct("<QIIIIII")


class Handed(NamedTuple):
    """One moment as it lay in a slot."""

    number: int  #: counts all moments
    epoch: int  #: counts how often all that is known has been forgotten
    robot: int  #: index of the robot
    dropped: int  #: moments of this robot that were left out so far
    frame: UInt8Array  #: (H, W, 3) uint8: its own copy
    rest: bytes  #: all but the frame


class FrameSlots:
    """Slots of a size in bytes, in a file that lies in memory where the system has such a place.

    Memory is taken only where something has been written.
    """

    def __init__(self, path: Path, count: int, slot_bytes: int) -> None:
        assert 0 < count <= MAX_SLOTS
        self.path, self.count, self.slot_bytes = path, count, slot_bytes
        self._lock = threading.Lock()
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), _HEADER_BYTES + count * slot_bytes)

    @classmethod
    def create(cls, count: int, room_bytes: int) -> FrameSlots:
        """Make a file with empty slots for so many bytes of frame and rest, which only this user can read."""
        slot_bytes = room_bytes + _SLOT.size
        folder = next((place for place in ("/dev/shm",) if os.access(place, os.W_OK)), None)
        handle, name = tempfile.mkstemp(prefix="robocup_vision_", dir=folder)
        with os.fdopen(handle, "r+b") as file:
            file.truncate(_HEADER_BYTES + count * slot_bytes)
        return cls(Path(name), count, slot_bytes)

    @property
    def room_bytes(self) -> int:
        """How many bytes of frame and rest fit into a slot."""
        return self.slot_bytes - _SLOT.size

    def empty_slot(self) -> int | None:
        """Return a slot that can be filled; None if all are filled."""
        return next((slot for slot in range(self.count) if self._memory[slot] == _EMPTY), None)

    def fill(self, slot: int, handed: Handed) -> None:
        """Copy a moment into an empty slot; it must fit."""
        begin, (height, width) = self._begin(slot), handed.frame.shape[:2]
        size, rest = handed.frame.size, handed.rest
        _SLOT.pack_into(
            self._memory, begin, handed.number, handed.epoch, handed.robot, handed.dropped, height, width, len(rest)
        )
        begin += _SLOT.size
        np.copyto(np.frombuffer(self._memory, np.uint8, size, begin).reshape(handed.frame.shape), handed.frame)
        self._memory[begin + size : begin + size + len(rest)] = rest
        self._order()
        self._memory[slot] = _FILLED

    def take(self) -> list[Handed]:
        """Return what waits in the slots, in the order of its numbers; the slots are empty then."""
        taken = [self._take(slot) for slot in range(self.count) if self._memory[slot] == _FILLED]
        return sorted(taken, key=lambda handed: handed.number)

    def _take(self, slot: int) -> Handed:
        self._order()
        begin = self._begin(slot)
        number, epoch, robot, dropped, height, width, rest_bytes = _SLOT.unpack_from(self._memory, begin)
        begin, size = begin + _SLOT.size, 3 * height * width
        frame = np.frombuffer(self._memory, np.uint8, size, begin).reshape(height, width, 3).copy()
        rest = self._memory[begin + size : begin + size + rest_bytes]
        self._order()
        self._memory[slot] = _EMPTY
        return Handed(number, epoch, robot, dropped, frame, rest)

    @property
    def cpu_s(self) -> float:
        """Processor time of the page's process, seconds."""
        return float(_CPU.unpack_from(self._memory, _CPU_AT)[0])

    @cpu_s.setter
    def cpu_s(self, seconds: float) -> None:
        _CPU.pack_into(self._memory, _CPU_AT, seconds)

    def remove(self) -> None:
        """Delete the file's name; the memory stays as long as somebody uses it."""
        self.path.unlink(missing_ok=True)

    def _begin(self, slot: int) -> int:
        return _HEADER_BYTES + slot * self.slot_bytes

    def _order(self) -> None:
        """Keep what was written before from being seen after what is written next, on processors that reorder."""
        # a release that an acquisition follows
        for _ in range(2):
            with self._lock:
                pass
