"""Reads one source, looks at its frames, and hands the views to the pages, at the pace of a clock.

A problem of the source is reported once, on the pages and in one line of text; the loop continues where it can.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from field_models.errors import FrameError, RobocupVisionError
from robocup_vision.live.handover.moment import Display, Moment, RobotSetup
from robocup_vision.live.sources.source import FrameRate, PlacingSource, Source, SourceFrame
from robocup_vision.vision import Vision

# a source without a frame for this time has stalled
_STALL_S = 1.5
_READ_S = 0.2  # longest wait for a frame, after which orders are looked at again
# length of a recording after which a robot's memory and colours have converged
_WARM_UP_S = 2.0
# if the loop is later than this, its clock is reset, so that a slow machine shows all frames, more slowly
_BEHIND_S = 0.5

Watcher = Callable[[SourceFrame, Moment], None]


@dataclass(slots=True)
class _Orders:
    """The orders of the page's thread; guarded by the loop's condition."""

    paused: bool = False
    steps: int = 0
    seek_s: float | None = None
    places: list[tuple[str, float, float, float | None]] = field(default_factory=list)
    stop: bool = False


class SourceLoop:
    """Runs one source in a thread of its own, and closes it at the end.

    Parameters
    ----------
    display : Display
        Shows the frames; it must know the source's robots already.
    watch : callable
        Called in the loop's thread with each frame and what is shown of it, for recording and calibration.
    say : callable
        Called with each line of text about the source.
    tell_run : callable
        Called when `problem` or `ended` has changed.

    Raises
    ------
    RobocupVisionError
        If the `Vision` of one of the source's robots cannot be made.
    """

    def __init__(
        self, source: Source, display: Display, watch: Watcher, say: Callable[[str], None], tell_run: Callable[[], None]
    ) -> None:
        self.source = source
        self._display, self._watch, self._say, self._tell_run = display, watch, say, tell_run
        self._visions = {setup.name: source.make_vision(setup) for setup in source.setups}
        self._rate = FrameRate()
        self._orders, self._news = _Orders(), threading.Condition()
        self._last_problem: dict[str, str] = {}
        self._read_ahead: tuple[SourceFrame, ...] | None = None
        self.frames = 0
        self.ended = False
        self._thread = threading.Thread(target=self._run, name=f"live {source.name}", daemon=True)

    @property
    def problem(self) -> str:
        """The present problem; empty if there is none."""
        return next((text for text in tuple(self._last_problem.values()) if text), "")

    def start(self, *, seek_s: float | None = None) -> None:
        """Start the thread; with a time, seek to it and pause there."""
        if seek_s is not None:
            self._orders.seek_s, self._orders.paused = seek_s, True
        self._thread.start()

    def vision(self, robot: str) -> Vision | None:
        """Return the `Vision` that looks at a robot's frames; None: the source brings its own views."""
        return self._visions[robot]

    def use_setup(self, setup: RobotSetup, vision: Vision) -> None:
        """Replace a robot's `Vision`, after its camera has been calibrated."""
        self._visions[setup.name] = vision

    def pause(self, on: bool) -> None:
        """Pause, or continue."""
        with self._news:
            self._orders.paused, self._orders.steps = on, 0
            self._news.notify_all()

    def step(self) -> None:
        """Show one more frame while paused."""
        with self._news:
            self._orders.steps += 1
            self._news.notify_all()

    def seek(self, t_s: float) -> None:
        """Seek to a time, and pause there."""
        with self._news:
            self._orders.seek_s, self._orders.paused, self._orders.steps = t_s, True, 0
            self._news.notify_all()

    def place(self, thing: str, x_m: float, y_m: float, theta_rad: float | None) -> None:
        """Move an object before the next frame, which is taken even while paused."""
        with self._news:
            self._orders.places.append((thing, x_m, y_m, theta_rad))
            self._orders.steps += self._orders.paused
            self._news.notify_all()

    def close(self) -> None:
        """End the loop, and close the source."""
        with self._news:
            self._orders.stop = True
            self._news.notify_all()
        if self._thread.is_alive():
            self._thread.join(5.0)
        self.source.close()

    def _run(self) -> None:
        try:
            self._loop()
        except Exception as error:  # a bug of one source must not end the page silently
            self.ended = True
            self._set_problem("", f"ended: {type(error).__name__}: {error}")

    def _loop(self) -> None:
        clock = _Clock(self._news, self._orders)
        silent_since_s = time.monotonic()
        while True:
            seek_s = self._wait_for_orders()
            if self._orders.stop:
                return
            if seek_s is not None:
                self._go_to(seek_s)
                clock.forget()
                continue
            self._place_things()
            frames = self._read()
            if frames is None:
                self._end()
                continue
            if not frames:
                silent_s = time.monotonic() - silent_since_s
                if silent_s > _STALL_S:
                    self._set_problem("", self.source.problem or f"stalls: no frame for {_STALL_S:g} s")
                continue
            if self._last_problem.get(""):
                self._say(f"{self.source.name}: frames come again, after {time.monotonic() - silent_since_s:.1f} s")
                self._set_problem("", "")
            silent_since_s = time.monotonic()
            if self.source.waits and not self._orders.paused:
                clock.wait_until(frames[0].t_s)
            self._show(frames)

    def _wait_for_orders(self) -> float | None:
        """Wait while paused or at the end; return the time to seek to, None if there is none."""
        with self._news:
            orders = self._orders
            self._news.wait_for(
                lambda: (
                    orders.stop
                    or orders.seek_s is not None
                    or (not self.ended and (not self._is_paused() or orders.steps > 0))
                )
            )
            seek_s, orders.seek_s = orders.seek_s, None
            if seek_s is None and self._is_paused():
                orders.steps -= 1
            return seek_s

    def _place_things(self) -> None:
        with self._news:
            places, self._orders.places = self._orders.places, []
        for place in places:
            assert isinstance(self.source, PlacingSource), "nothing is placed where it is not offered"
            try:
                self.source.place(*place)
            except RobocupVisionError as error:
                self._say(f"{self.source.name}: {error}")

    def _is_paused(self) -> bool:
        # a live source does not wait for the loop: then only the page is paused
        return self._orders.paused and self.source.waits

    def _read(self) -> tuple[SourceFrame, ...] | None:
        if self._read_ahead is not None:
            frames, self._read_ahead = self._read_ahead, None
            return frames
        try:
            return self.source.read(_READ_S)
        except FrameError as error:
            # the next frame may be usable
            self._set_problem("frame", str(error))
            return ()

    def _end(self) -> None:
        self.ended = True
        self._say(f"{self.source.name}: ended after {self.frames} frames")
        self._tell_run()

    def _go_to(self, t_s: float) -> None:
        """Seek to a time: process the frames of the two seconds before it, so that memory and colours converge."""
        self._display.forget()
        self._rate.forget()
        self._read_ahead = None
        self.ended = False
        self._tell_run()
        for vision in self._visions.values():
            if vision is not None:
                vision.forget()
        self.source.seek(max(0.0, t_s - _WARM_UP_S))
        shown = False
        while not self._orders.stop and self._orders.seek_s is None:
            frames = self._read()
            if frames is None:
                self._end()
                return
            if not frames:
                continue
            if shown and frames[0].t_s > t_s + 1e-6:
                # this frame belongs to the next step
                self._read_ahead = frames
                return
            self._show(frames)
            # the user can step back to each of these frames, so that all must be drawn
            self._display.wait_until_made(1.0)
            shown = True

    def _show(self, frames: tuple[SourceFrame, ...]) -> None:
        change = self._rate.add(frames[0].t_s)
        if change is not None and not self.source.waits:
            rates = "from {:.1f} to {:.1f} frames a second".format(*change)
            self._say(f"{self.source.name}: the rate changed {rates}")
        self.frames += 1
        for frame in frames:
            moment = self._look(frame)
            if moment is not None:
                self._display.put(moment)
                self._watch(frame, moment)

    def _look(self, frame: SourceFrame) -> Moment | None:
        vision = self._visions.get(frame.robot)
        moment = Moment(
            frame.robot,
            frame.frame,
            frame.t_s,
            frame.view,
            colors=frame.colors,
            plan=frame.plan,
            truth=frame.truth,
            rate_hz=self._rate.rate_hz,
            world=frame.world,
        )
        if vision is None:
            return moment if frame.view is not None else replace(moment, problem="not looked at")
        if frame.alone:
            vision.forget()
        try:
            view = vision.look(frame.frame, frame.t_s, frame.odometry, frame.prior, mounting=frame.mounting)
        except RobocupVisionError as error:
            self._set_problem(frame.robot, str(error))
            return replace(moment, problem=str(error))
        except Exception as error:  # a bug in one frame must not cost the others
            vision.forget()
            problem = f"internal error: {type(error).__name__}: {error}"
            self._set_problem(frame.robot, problem)
            return replace(moment, problem=problem)
        self._set_problem(frame.robot, "")
        return replace(moment, view=view, colors=vision.colors, settings={"method": vision.method})

    def _set_problem(self, where: str, problem: str) -> None:
        """Set the problem of a robot or, where "", of the source; report it if it is new. An empty one clears it."""
        before = self._last_problem.get(where, "")
        if problem == before:
            return
        self._last_problem[where] = problem
        self._tell_run()
        if problem:
            self._say(f"{self.source.name}: {problem}")


class _Clock:
    """Waits until a frame is due."""

    def __init__(self, news: threading.Condition, orders: _Orders) -> None:
        self._news, self._orders = news, orders
        self._offset_s: float | None = None

    def forget(self) -> None:
        """Reset the clock: the next frame is due at once."""
        self._offset_s = None

    def wait_until(self, t_s: float) -> None:
        """Wait until a time of the source, or until an order comes."""
        now_s = time.monotonic()
        if self._offset_s is None or now_s - t_s - self._offset_s > _BEHIND_S or t_s + self._offset_s - now_s > 60.0:
            self._offset_s = now_s - t_s
            return
        due_s = t_s + self._offset_s
        orders = self._orders
        with self._news:
            interrupted = self._news.wait_for(
                lambda: orders.stop or orders.paused or orders.seek_s is not None, max(0.0, due_s - now_s)
            )
        if interrupted:
            self._offset_s = None
