"""A process of its own for some of a match's players, so that a match is played on two cores.

Players share nothing: which process they act in changes nothing of what they do. The process is forked, with the
players as they are.
"""

from __future__ import annotations

import io
import multiprocessing
import os
import pickle
import signal
import threading
import warnings
from collections.abc import Sequence
from multiprocessing.connection import Connection
from typing import Any

import cv2

from field_models.errors import RobocupVisionError
from robocup_vision.perception.free_space import FreeSpaceGrid
from robocup_vision.perception.polar_view import PolarView
from sim2d.match.seat import Seat
from sim2d.report.moment import RobotMoment
from sim2d.robot_link import Senses

# the tables of a mirror camera, the same in every view: sent once
_FIXED = (PolarView, FreeSpaceGrid)
# seconds in which the process ends once it is told to
_END_S = 2.0


def can_fork() -> bool:
    """Whether a forked process would run beside this one: no other thread runs here, and there is a second core."""
    if "fork" not in multiprocessing.get_all_start_methods() or threading.active_count() > 1:
        return False
    return len(os.sched_getaffinity(0)) > 1 if hasattr(os, "sched_getaffinity") else False


class SeatProcess:
    """Lets players act in a process of their own, beside this one.

    Parameters
    ----------
    seats : sequence of Seat
        Those that move; they may not act here any more.
    """

    def __init__(self, seats: Sequence[Seat]) -> None:
        self._seats = seats
        self._sensed: Sequence[Senses] = ()
        self._fixed: dict[int, object] = {}

    def __enter__(self) -> SeatProcess:
        # OpenCV's own threads would not be there in the forked process, and two cores are busy anyway
        self._threads = cv2.getNumThreads()
        cv2.setNumThreads(1)
        self._pipe, there = multiprocessing.Pipe()
        context = multiprocessing.get_context("fork")
        self._process = context.Process(target=_serve, args=(self._seats, there, self._pipe), daemon=True)
        with warnings.catch_warnings():
            # libraries of linear algebra hold threads of their own, which are made for forks
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process.start()
        there.close()
        return self

    def __exit__(self, *_: object) -> None:
        self._pipe.close()
        self._process.join(_END_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process.close()
        cv2.setNumThreads(self._threads)

    def begin(self, sensed: Sequence[Senses]) -> None:
        """Hand the players their senses.

        Raises
        ------
        RobocupVisionError
            If the process has ended.
        """
        self._sensed = sensed
        try:
            self._pipe.send_bytes(pickle.dumps(list(sensed), 5))
        except OSError:
            raise self._lost() from None

    def end(self) -> tuple[RobotMoment, ...]:
        """Wait for what the players answer, and return it.

        Raises
        ------
        RobocupVisionError
            If the process has ended.
        """
        try:
            answer = self._pipe.recv_bytes()
        except (EOFError, OSError):
            raise self._lost() from None
        answers = _Unpickler(io.BytesIO(answer), self._fixed).load()
        return tuple(
            RobotMoment(senses, status, command, stopped)
            for senses, (status, command, stopped) in zip(self._sensed, answers, strict=True)
        )

    @staticmethod
    def _lost() -> RobocupVisionError:
        return RobocupVisionError("the process of half of the players has ended (a crash, or too little memory?)")


def _serve(seats: Sequence[Seat], pipe: Connection, other_end: Connection) -> None:
    """Let players act until the pipe is closed."""
    # an interrupt (Ctrl-C) is for the process that plays the match
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    other_end.close()
    fixed: dict[int, object] = {}
    while True:
        try:
            sensed = pickle.loads(pipe.recv_bytes())
        except (EOFError, OSError):
            return
        moments = [seat.act(senses) for seat, senses in zip(seats, sensed, strict=True)]
        answer = io.BytesIO()
        _Pickler(answer, fixed).dump([(moment.status, moment.command, moment.stopped) for moment in moments])
        try:
            pipe.send_bytes(answer.getbuffer())
        except OSError:
            return


class _Pickler(pickle.Pickler):
    """Pickles the fixed tables of a view the first time only."""

    def __init__(self, file: io.BytesIO, fixed: dict[int, object]) -> None:
        super().__init__(file, 5)
        self._fixed = fixed

    def persistent_id(self, value: Any) -> tuple[int, bytes | None] | None:
        """Return the number of a fixed table, and the table where it is a new one."""
        if not isinstance(value, _FIXED):
            return None
        number = id(value)
        if number in self._fixed:
            return number, None
        # kept, so that no other object gets its number
        self._fixed[number] = value
        return number, pickle.dumps(value, 5)


class _Unpickler(pickle.Unpickler):
    """Unpickles what `_Pickler` wrote."""

    def __init__(self, file: io.BytesIO, fixed: dict[int, object]) -> None:
        super().__init__(file)
        self._fixed = fixed

    def persistent_load(self, pid: tuple[int, bytes | None]) -> object:
        """Return a fixed table by its number."""
        number, table = pid
        if table is not None:
            self._fixed[number] = pickle.loads(table)
        return self._fixed[number]
