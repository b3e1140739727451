"""The page's own process: keeps moments, makes pictures, serves pages.

It is started by `LivePage` with two pipes. In a process of its own it does not hold the interpreter's lock of the
robot's loop, and it has a lower priority. It ends when the pipe from the robot is closed, even after a crash.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import IO, Any

from field_models.errors import RobocupVisionError
from robocup_vision.live.handover.controls import Controls, read_message, write_message
from robocup_vision.live.handover.frame_slots import FrameSlots
from robocup_vision.live.handover.moment import MomentReader, RobotSetup
from robocup_vision.live.handover.page_settings import FeedSettings
from robocup_vision.live.page.feed import Feed
from robocup_vision.live.page.saving import save_from
from robocup_vision.live.page.server import PageServer

# nice value: the robot's loop has priority
_NICENESS = 5
_MADE_S = 1.0
# polling periods, normal and slow (right after a moment), and the time without moments after which polling is slow
_POLL_S, _SLOW_POLL_S, _SILENT_S = 0.008, 0.03, 1.0
# the next moment is expected after this fraction of the time between the last two
_EXPECTED_RATIO = 0.6


class _FarControls(Controls):
    """Passes the pages' requests to the robot's process, except for saving, which needs the moments kept here."""

    def __init__(self, feed: Feed, out: Path, to_robot: IO[bytes]) -> None:
        self._feed, self._out, self._to_robot = feed, out, to_robot

    def ask(self, name: str, *values: object) -> None:
        if name == "save":
            super().ask(name, *values)
        else:
            write_message(self._to_robot, ("control", name, values))

    def save(self, robot: str, number: int) -> None:
        save_from(self._feed, robot, number, self._out)


class _PageProcess:
    """Carries out the messages of the robot's process."""

    def __init__(self, from_robot: IO[bytes], to_robot: IO[bytes]) -> None:
        self._from_robot, self._to_robot = from_robot, to_robot
        self._feed = Feed()
        self._controls: _FarControls | None = None
        self._server: PageServer | None = None
        # guards the following attributes, because moments are taken in a thread of their own
        self._lock = threading.Lock()
        self._slots: FrameSlots | None = None
        self._readers: tuple[MomentReader, ...] = ()
        self._epoch = 0
        self._ended = threading.Event()
        self._taker = threading.Thread(target=self._take_moments, name="moments", daemon=True)

    def run(self) -> None:
        """Carry out messages until the robot's process ends."""
        self._taker.start()
        try:
            while (message := read_message(self._from_robot)) is not None:
                name, *values = message
                getattr(self, f"_on_{name}")(*values)
        finally:
            self._ended.set()
            if self._server is not None:
                self._server.close()
            self._feed.close()

    def _on_begin(self, settings: FeedSettings, out: str, port: int, host: str) -> None:
        self._feed.close()
        self._feed = Feed(settings)
        self._controls = _FarControls(self._feed, Path(out), self._to_robot)
        try:
            self._server = PageServer(self._feed, self._controls, port, host)
            self._server.start()
        except RobocupVisionError as error:
            write_message(self._to_robot, ("failed", type(error).__name__, str(error)))
            return
        write_message(self._to_robot, ("serves", self._server.address, self._server.is_public))

    def _on_robots(self, setups: tuple[RobotSetup, ...], offers: frozenset[str], epoch: int) -> None:
        with self._lock:
            if self._controls is not None:
                self._controls.offers = offers
            self._feed.set_robots(setups)
            self._readers = tuple(MomentReader() for _ in setups)
            self._epoch = epoch

    def _on_slots(self, path: str, count: int, slot_bytes: int) -> None:
        with self._lock:
            self._take()
            self._slots = FrameSlots(Path(path), count, slot_bytes)
            # only its name is removed; the memory is freed when both processes have ended
            self._slots.remove()

    def _on_forget(self) -> None:
        self._wait_until_taken()
        self._feed.forget()

    def _on_say(self, line: str) -> None:
        self._feed.say(line)

    def _on_status(self, changes: dict[str, Any]) -> None:
        self._feed.set_status(**changes)

    def _on_sync(self, number: int) -> None:
        self._wait_until_taken()
        self._feed.wait_until_made(_MADE_S)
        write_message(self._to_robot, ("synced", number))

    def _wait_until_taken(self) -> None:
        with self._lock:
            self._take()

    def _take_moments(self) -> None:
        silent_since_s, wait_s = time.monotonic(), _POLL_S
        while not self._ended.is_set():
            time.sleep(wait_s)
            with self._lock:
                has_taken = self._take()
            silent_s = time.monotonic() - silent_since_s
            if has_taken:
                silent_since_s += silent_s
                wait_s = min(max(_EXPECTED_RATIO * silent_s, _POLL_S), _SLOW_POLL_S)
            else:
                wait_s = _POLL_S if silent_s < _SILENT_S else _SLOW_POLL_S

    def _take(self) -> bool:
        """Take the waiting moments, and return whether there were any; the caller holds the lock."""
        slots = self._slots
        if slots is None:
            return False
        taken = slots.take()
        for handed in taken:
            # moments of an earlier set of robots are skipped
            if handed.epoch == self._epoch:
                moment = self._readers[handed.robot].read(handed.rest, handed.frame)
                self._feed.put(moment, handed.dropped)
        slots.cpu_s = time.process_time()
        return bool(taken)


def main() -> None:
    """Run the page's process for the robot's process that started it."""
    # Ctrl-C is left to the robot's program; this process ends with it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import cv2

    cv2.setNumThreads(0)
    if hasattr(os, "nice"):
        os.nice(_NICENESS)
    to_robot = os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    # the output of libraries must not mix with the messages
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    _PageProcess(sys.stdin.buffer, to_robot).run()


if __name__ == "__main__":
    main()
