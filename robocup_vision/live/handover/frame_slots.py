"""Moments in memory shared by the robot's process and the page's, so that handing one over costs a single copy.

A byte for each slot says whether it is filled. The robot's process fills empty slots; the page's process polls for
filled slots some hundred times per second and empties them. Neither waits for the other, and none is woken:
on a busy machine a process that is woken may get the processor of the one that woke it.
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
# processor time used by the page's process, and its place in the header
_CPU = struct.Struct("<d")
_CPU_AT = 40
_EMPTY, _FILLED = 0, 1
# number, epoch, robot, dropped, height and width of the frame, bytes of the rest
_SLOT = struct.Struct("<QIIIIII")


class Handed(NamedTuple):
    """The content of a slot: one moment."""

    number: int  #: number among all moments
    epoch: int  #: number of times that the set of robots was replaced
    robot: int  #: index of the robot
    dropped: int  #: number of this robot's moments that were dropped so far
    frame: UInt8Array  #: (H, W, 3) uint8: own copy of the frame
    rest: bytes  #: the moment without its frame


class FrameSlots:
    """Slots of a fixed size, in a file which is kept in memory if the system offers that.

    Only parts that have been written to use memory.
    """

    def __init__(self, path: Path, count: int, slot_bytes: int) -> None:
        assert 0 < count <= MAX_SLOTS
        self.path, self.count, self.slot_bytes = path, count, slot_bytes
        self._lock = threading.Lock()
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), _HEADER_BYTES + count * slot_bytes)

    @classmethod
    def create(cls, count: int, room_bytes: int) -> FrameSlots:
        """Make a file, readable only by this user, with empty slots that each hold `room_bytes` of frame and rest."""
        slot_bytes = room_bytes + _SLOT.size
        folder = next((place for place in ("/dev/shm",) if os.access(place, os.W_OK)), None)
        handle, name = tempfile.mkstemp(prefix="robocup_vision_", dir=folder)
        with os.fdopen(handle, "r+b") as file:
            file.truncate(_HEADER_BYTES + count * slot_bytes)
        return cls(Path(name), count, slot_bytes)

    @property
    def room_bytes(self) -> int:
        """Number of bytes of frame and rest that fit into a slot."""
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
        self._memory_barrier()
        self._memory[slot] = _FILLED

    def take(self) -> list[Handed]:
        """Return the moments in the slots in order of their numbers, and empty the slots."""
        taken = [self._take(slot) for slot in range(self.count) if self._memory[slot] == _FILLED]
        return sorted(taken, key=lambda handed: handed.number)

    def _take(self, slot: int) -> Handed:
        self._memory_barrier()
        begin = self._begin(slot)
        number, epoch, robot, dropped, height, width, rest_bytes = _SLOT.unpack_from(self._memory, begin)
        begin, size = begin + _SLOT.size, 3 * height * width
        frame = np.frombuffer(self._memory, np.uint8, size, begin).reshape(height, width, 3).copy()
        rest = self._memory[begin + size : begin + size + rest_bytes]
        self._memory_barrier()
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
        """Delete the file's name; the memory stays as long as a process uses it."""
        self.path.unlink(missing_ok=True)

    def _begin(self, slot: int) -> int:
        return _HEADER_BYTES + slot * self.slot_bytes

    def _memory_barrier(self) -> None:
        """Keep the order of memory accesses before and after this call, on processors that reorder them."""
        # a lock's release followed by another acquisition is a memory barrier
        for _ in range(2):
            with self._lock:
                pass
