"""Passes moments from the robots' loops to the pages, and keeps the last 30 s of them.

A loop hands over a moment and continues at once. A thread makes the picture. If it is late, newer moments replace those
that wait, so that a loop never waits and a page is never behind.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from field_models.errors import ArgumentError
from robocup_vision.live.handover.moment import Moment, RobotSetup
from robocup_vision.live.handover.page_settings import FeedSettings
from robocup_vision.live.page.picture import Picture, PictureMaker

# number of text lines that a page shows, newest last
_MAX_LINES = 40


@dataclass(slots=True)
class _Robot:
    setup: RobotSetup
    maker: PictureMaker
    waiting: Moment | None = None
    is_making: bool = False
    turn: int = 0
    dropped: int = 0
    dropped_before: int = 0
    pictures: deque[Picture] = field(default_factory=deque)
    picture_bytes: int = 0
    raw: deque[tuple[int, Moment]] = field(default_factory=deque)
    raw_bytes: int = 0


class Feed:
    """Connects loops with pages; safe to use from several threads."""

    def __init__(self, settings: FeedSettings = FeedSettings()) -> None:
        self.settings = settings
        self._lock = threading.Condition()
        self._robots: dict[str, _Robot] = {}
        self._status: dict[str, Any] = {}
        self._lines: deque[str] = deque(maxlen=_MAX_LINES)
        self._version = 0
        #: called in some thread whenever there is something new; must be quick
        self.on_news: Callable[[], None] = lambda: None
        self._want_markings: set[int] = set()
        self._closed = False
        self._turn = 0
        self._epoch = 0
        self._thread = threading.Thread(target=self._make_pictures, name="live pictures", daemon=True)
        self._thread.start()

    def set_robots(self, setups: tuple[RobotSetup, ...]) -> None:
        """Show these robots, and forget all moments kept before."""
        quality = self.settings.jpeg_quality
        with self._lock:
            self._robots = {setup.name: _Robot(setup, PictureMaker(setup, quality)) for setup in setups}
            self._version += 1
            self._epoch += 1
        self.on_news()

    @property
    def setups(self) -> tuple[RobotSetup, ...]:
        """The robots, in the order of `set_robots`."""
        with self._lock:
            return tuple(robot.setup for robot in self._robots.values())

    def put(self, moment: Moment, dropped: int = 0) -> None:
        """Hand over a moment; it replaces one of the same robot that still waits.

        `dropped` is the number of this robot's moments dropped before. Raises ArgumentError if the robot is not known.
        """
        with self._lock:
            robot = self._robots.get(moment.robot)
            if robot is None:
                raise ArgumentError(f"no robot {moment.robot!r} is known to the page")
            robot.dropped += robot.waiting is not None
            robot.dropped_before = dropped
            robot.waiting = moment
            self._lock.notify_all()

    def want_markings(self, page: object, on: bool) -> None:
        """Set whether a page wants markings; they are found for new moments as long as at least one page does."""
        with self._lock:
            if on:
                self._want_markings.add(id(page))
            else:
                self._want_markings.discard(id(page))

    def wait_until_made(self, timeout_s: float) -> bool:
        """Wait until the pictures of all moments are made; return False at the timeout."""
        with self._lock:
            robots = self._robots.values()
            return self._lock.wait_for(lambda: not any(r.waiting or r.is_making for r in robots), timeout_s)

    def newest(self, robot: str) -> Picture | None:
        """Return a robot's newest picture."""
        with self._lock:
            known = self._robots.get(robot)
            return known.pictures[-1] if known is not None and known.pictures else None

    def history(self, robot: str) -> tuple[Picture, ...]:
        """Return all kept pictures of a robot, oldest first."""
        with self._lock:
            known = self._robots.get(robot)
            return () if known is None else tuple(known.pictures)

    def raw(self, robot: str, number: int) -> Moment | None:
        """Return the moment of a picture, if it is still kept."""
        with self._lock:
            known = self._robots.get(robot)
            kept = () if known is None else known.raw
            return next((moment for own, moment in kept if own == number), None)

    def forget(self) -> None:
        """Forget all kept moments, because the source has jumped to another time."""
        with self._lock:
            self._epoch += 1
            for robot in self._robots.values():
                robot.waiting = None
                robot.pictures.clear()
                robot.raw.clear()
                robot.picture_bytes = robot.raw_bytes = 0

    def say(self, line: str) -> None:
        """Show a line of text on the pages."""
        with self._lock:
            self._lines.append(f"{time.strftime('%H:%M:%S')}  {line}")
            self._version += 1
        self.on_news()

    def set_status(self, **changes: Any) -> None:
        """Change the run's status on the pages: plain values by name."""
        with self._lock:
            if all(self._status.get(name, ...) == value for name, value in changes.items()):
                return
            self._status.update(changes)
            self._version += 1
        self.on_news()

    @property
    def status(self) -> tuple[int, Mapping[str, Any]]:
        """A number that grows with each change, and the run's status on the pages."""
        with self._lock:
            return self._version, {**self._status, "lines": list(self._lines)}

    def close(self) -> None:
        """End the thread; moments handed over later are not shown."""
        with self._lock:
            self._closed = True
            self._lock.notify_all()
        self._thread.join(5.0)

    def _make_pictures(self) -> None:
        while True:
            with self._lock:
                self._lock.wait_for(lambda: self._closed or any(r.waiting for r in self._robots.values()))
                if self._closed:
                    return
                # the robot that has waited longest since its last picture
                robot = min((r for r in self._robots.values() if r.waiting), key=lambda r: r.turn)
                self._turn += 1
                robot.turn, robot.is_making = self._turn, True
                moment, epoch = robot.waiting, self._epoch
                dropped = robot.dropped + robot.dropped_before
                robot.waiting, with_markings = None, bool(self._want_markings)
            assert moment is not None
            picture = None
            try:
                picture = robot.maker.make(moment, dropped, with_markings)
            except Exception as error:  # a frame that cannot be shown must not end the page
                self.say(f"a moment cannot be shown: {type(error).__name__}: {error}")
            with self._lock:
                robot.is_making = False
                if picture is not None and epoch == self._epoch:
                    self._keep(robot, picture, moment)
                self._lock.notify_all()
            self.on_news()

    def _keep(self, robot: _Robot, picture: Picture, moment: Moment) -> None:
        robot.pictures.append(picture)
        robot.picture_bytes += len(picture.data)
        robot.raw.append((picture.number, moment))
        robot.raw_bytes += moment.frame.nbytes
        oldest_s = moment.t_s - self.settings.history_s
        while len(robot.pictures) > 1 and (
            robot.picture_bytes > self.settings.max_history_bytes or robot.pictures[0].t_s < oldest_s
        ):
            robot.picture_bytes -= len(robot.pictures.popleft().data)
        while len(robot.raw) > 1 and (robot.raw_bytes > self.settings.max_raw_bytes or robot.raw[0][1].t_s < oldest_s):
            robot.raw_bytes -= robot.raw.popleft()[1].frame.nbytes
