"""The robot's side of the page: hands moments to the page's own process, and executes the pages' requests.

A moment takes the robot's loop one copy of the frame and a tenth of a millisecond for the rest. If the page's process
is late, moments are dropped and counted: the loop never waits.
"""

from __future__ import annotations

import itertools
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.live.handover.controls import Controls, read_message, write_message
from robocup_vision.live.handover.frame_slots import MAX_SLOTS, FrameSlots, Handed
from robocup_vision.live.handover.moment import Moment, MomentWriter, RobotSetup
from robocup_vision.live.handover.page_settings import FeedSettings, require_packages

# slots beside one for each robot, so that short delays of the page's process drop no moments
_SPARE_SLOTS = 2
# memory in a slot beside the frame; the operating system allocates only the pages that are written
_ROOM_BYTES = 8 << 20
_START_S, _STOP_S = 60.0, 5.0


class LivePage:
    """Starts and ends the page's process; the methods of `controls` are called in a thread of this object.

    Raises
    ------
    ArgumentError
        If the extra `live` is not installed, or an argument is out of its range.
    RobocupVisionError
        If the port is taken, or the process does not start.
    """

    def __init__(
        self,
        controls: Controls,
        out: Path,
        *,
        port: int,
        host: str,
        settings: FeedSettings = FeedSettings(),
    ) -> None:
        require_packages()
        self._controls = controls
        self._slots: FrameSlots | None = None
        self._writers: dict[str, MomentWriter] = {}
        self._places: dict[str, int] = {}
        self._dropped: dict[str, int] = {}
        self._epoch = 0
        self._lock = threading.Lock()
        self._synced, self._numbers = threading.Condition(), itertools.count(1)
        self._last_synced = 0
        self._status: dict[str, Any] = {}
        self._closed = False
        self._process = subprocess.Popen(
            [sys.executable, "-m", "robocup_vision.live.page.page_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._to_page: IO[bytes] = self._process.stdin
        try:
            self.address, self.is_public = self._begin(self._process.stdout, settings, out, port, host)
        except BaseException:
            self.close()
            raise
        self._thread = threading.Thread(target=self._obey, args=(self._process.stdout,), name="live page", daemon=True)
        self._thread.start()

    def _begin(self, from_page: IO[bytes], settings: FeedSettings, out: Path, port: int, host: str) -> tuple[str, bool]:
        self._tell("begin", settings, str(out), port, host)
        # a process that does not answer in time is killed
        watch = threading.Timer(_START_S, self._process.kill)
        watch.start()
        try:
            answer = read_message(from_page)
        finally:
            watch.cancel()
        if answer is None:
            raise RobocupVisionError("the page's process ended at its start")
        if answer[0] == "failed":
            raise (ArgumentError if answer[1] == ArgumentError.__name__ else RobocupVisionError)(answer[2])
        return str(answer[1]), bool(answer[2])

    @property
    def cpu_s(self) -> float:
        """Processor time of the page's process so far, seconds."""
        return 0.0 if self._slots is None else self._slots.cpu_s

    @property
    def process_id(self) -> int:
        """Process id of the page's process."""
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """Whether the page's process runs."""
        return not self._closed and self._process.poll() is None

    def set_robots(self, setups: tuple[RobotSetup, ...]) -> None:
        """Show these robots and no others; also send what the controls offer."""
        with self._lock:
            self._epoch += 1
            self._writers = {setup.name: MomentWriter() for setup in setups}
            self._places = {setup.name: index for index, setup in enumerate(setups)}
            self._dropped = dict.fromkeys(self._writers, 0)
            self._tell("robots", setups, self._controls.offers, self._epoch)

    def put(self, moment: Moment) -> None:
        """Hand over a moment; its frame is copied. Raises ArgumentError if its robot is not known."""
        robot, frame = moment.robot, moment.frame
        with self._lock:
            writer = self._writers.get(robot)
            if writer is None:
                raise ArgumentError(f"no robot {robot!r} is known to the page")
            if self._closed:
                return
            slots = self._slots_for(frame.nbytes)
            slot = slots.empty_slot()
            if slot is not None:
                rest, changed = writer.write(moment)
                if frame.nbytes + len(rest) <= slots.room_bytes:
                    number, dropped = next(self._numbers), self._dropped[robot]
                    slots.fill(slot, Handed(number, self._epoch, self._places[robot], dropped, frame, rest))
                    writer.sent(changed)
                    return
            self._dropped[robot] += 1

    def wait_until_made(self, timeout_s: float) -> bool:
        """Wait until the page's process has drawn all moments handed over; return False at the timeout."""
        number = next(self._numbers)
        with self._lock:
            self._tell("sync", number)
        with self._synced:
            return self._synced.wait_for(lambda: self._last_synced >= number or self._closed, timeout_s)

    def forget(self) -> None:
        """Forget all moments, because the source has jumped to another time."""
        with self._lock:
            self._tell("forget")

    def say(self, line: str) -> None:
        """Show a line of text on the pages."""
        with self._lock:
            self._tell("say", line)

    def set_status(self, **changes: Any) -> None:
        """Change the run's status on the pages: plain values by name."""
        with self._lock:
            new = {name: value for name, value in changes.items() if self._status.get(name, ...) != value}
            if new:
                self._status.update(new)
                self._tell("status", new)

    def close(self) -> None:
        """End the page's process."""
        self._closed = True
        with suppress(OSError):
            self._to_page.close()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._slots is not None:
            self._slots.remove()
        with self._synced:
            self._synced.notify_all()

    def _slots_for(self, frame_bytes: int) -> FrameSlots:
        count = min(len(self._writers) + _SPARE_SLOTS, MAX_SLOTS)
        slots = self._slots
        if slots is None or frame_bytes + _ROOM_BYTES > slots.room_bytes or slots.count != count:
            if slots is not None:
                slots.remove()
            self._slots = slots = FrameSlots.create(count, frame_bytes + _ROOM_BYTES)
            self._tell("slots", str(slots.path), slots.count, slots.slot_bytes)
        return slots

    def _tell(self, *message: Any) -> None:
        if self._closed:
            return
        try:
            write_message(self._to_page, message)
        except (OSError, ValueError):
            # the robot continues without a page
            self._closed = True
            print("robocup-vision live: the page's process has ended; the robot goes on", file=sys.stderr)

    def _obey(self, from_page: IO[bytes]) -> None:
        while (message := read_message(from_page)) is not None:
            if message[0] == "synced":
                with self._synced:
                    self._last_synced = message[1]
                    self._synced.notify_all()
                continue
            _, name, values = message
            try:
                self._controls.ask(name, *values)
            except RobocupVisionError as error:
                self.say(f"refused: {error}")
