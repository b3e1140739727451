"""The live page for a robot's own program, which calls `Viewer.show` in its loop."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np

from field_models.errors import ArgumentError, FrameError
from robocup_vision.arrays import Frame, UInt8Array
from robocup_vision.closing import Closing
from robocup_vision.evaluation.moment_links import LIVE_PORT
from robocup_vision.live.handover.controls import Controls
from robocup_vision.live.handover.moment import Moment, Point, RobotPlan, RobotSetup
from robocup_vision.live.handover.page_settings import LOOPBACK, FeedSettings
from robocup_vision.live.live_page import LivePage
from robocup_vision.live.sources.source import FrameRate
from robocup_vision.view import RigView, View
from robocup_vision.vision import Vision


class Viewer(Controls, Closing):
    """Serves a page that shows what a robot sees, without blocking its loop.

    `show` copies the frame and returns; another process makes the pictures and serves the page. Frames that come faster
    than pictures can be made are skipped. Creating the object takes some seconds, because that process must start.

    Parameters
    ----------
    port : int
        Port of the page; 0: any free one, see `address`.
    host : str
        Address to listen on: only programs of this machine reach the default. With another address, anyone in that
        network can watch.
    radius_m : float, optional
        Radius of the robot's outline from above; default: that of its league's robots.
    out : str or Path
        Folder for frames that are saved from the page.

    Raises
    ------
    ArgumentError
        If the extra `live` is not installed, or an argument is out of its range.
    RobocupVisionError
        If the port is taken.

    Examples
    --------
    >>> from robocup_vision.live import Viewer
    >>> viewer = Viewer(vision)  # doctest: +SKIP
    >>> viewer.show(frame, vision.look(frame))  # doctest: +SKIP
    """

    offers = frozenset({"save"})

    def __init__(
        self,
        vision: Vision,
        *,
        name: str = "robot",
        port: int = LIVE_PORT,
        host: str = LOOPBACK,
        radius_m: float | None = None,
        out: str | Path = "out/live",
        settings: FeedSettings = FeedSettings(),
    ) -> None:
        self._vision, self._name = vision, name
        self._rate = FrameRate()
        self._begin_s = time.monotonic()
        self._shown_settings = {"method": vision.method}
        radius_m = vision.field.robot_radius_m if radius_m is None else radius_m
        self._page = LivePage(self, Path(out), port=port, host=host, settings=settings)
        self._page.set_robots((RobotSetup(name, vision.field, vision.camera, radius_m),))
        self._page.set_status(source=name)

    @property
    def address(self) -> str:
        """Address of the page."""
        return self._page.address

    @property
    def cpu_s(self) -> float:
        """Processor time of the page's process so far, seconds."""
        return self._page.cpu_s

    def show(
        self,
        frame: Frame | Sequence[Frame | None],
        view: View,
        *,
        command: Sequence[float] | None = None,
        way: Sequence[Point] = (),
        reasons: Sequence[str] = (),
    ) -> None:
        """Show a frame and what was seen in it; copies the frame and returns.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR. For a rig a sequence of its frames, of which the first that is not None is shown.
        command : (float, float, float), optional
            Commanded velocity in the robot frame: forward and left in m/s, turn in rad/s.
        way : sequence of (float, float)
            Points that the robot drives to, field frame, metres.
        reasons : sequence of str
            Reasons for the command, as text.

        Raises
        ------
        FrameError
            If the frame has another type or shape.
        ArgumentError
            If the command does not have three numbers.
        """
        if isinstance(view, RigView):
            if not isinstance(frame, (tuple, list)) or len(frame) != len(view.views):
                raise FrameError(f"the view of a rig is shown with its {len(view.views)} frames")
            number = next((number for number, one in enumerate(frame) if one is not None), None)
            if number is None:
                return
            frame, view = frame[number], view.of_camera(number)
        frame = cast("Frame", frame)
        if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3:
            raise FrameError(f"a frame must be (H, W, 3) uint8, got {frame.shape} {frame.dtype}")
        velocity: tuple[float, float, float] | None = None
        if command is not None:
            if len(command) != 3:
                raise ArgumentError(f"the command must be forward, left and turn, got {command!r}")
            velocity = (float(command[0]), float(command[1]), float(command[2]))
        t_s = time.monotonic() - self._begin_s if view.t_s is None else view.t_s
        self._rate.add(t_s)
        plan = RobotPlan(velocity, tuple((float(x), float(y)) for x, y in way), tuple(map(str, reasons)))
        self._page.put(
            Moment(
                self._name,
                cast("UInt8Array", frame),
                t_s,
                view,
                colors=self._vision.colors,
                plan=plan,
                rate_hz=self._rate.rate_hz,
                settings=self._shown_settings,
            )
        )

    @property
    def process_id(self) -> int:
        """Id of the page's process."""
        return self._page.process_id

    def wait(self, timeout_s: float = 5.0) -> bool:
        """Wait until all shown moments are visible; return whether they are. Not for use in a robot's loop."""
        return self._page.wait_until_made(timeout_s)

    def say(self, line: str) -> None:
        """Show a line among the page's messages."""
        self._page.say(line)

    def close(self) -> None:
        """Stop serving the page."""
        self._page.close()
