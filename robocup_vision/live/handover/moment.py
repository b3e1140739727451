"""One moment of one robot as the page shows it: the frame, the view, the command; and as bytes between two processes.

What seldom changes (the samples' places, the camera, colours, the map) is sent once, and again when it is another
object: the places alone are half a megabyte.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import MOUNTING_NAMES, Mounting, PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.perception.color_table import Colors
from robocup_vision.perception.markings.finder import MarkingSource
from robocup_vision.view import View

Point = tuple[float, float]
# parts of a view, and then of a moment, that are sent when they are another object than the time before
_SELDOM = ("polar", "grid", "camera", "colors", "settings", "map_state", "marking_finder")
_VIEW_FIELDS = tuple(field.name for field in fields(View))
_NO_FRAME = np.empty((0, 0, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class RobotSetup:
    """What stays the same of a robot."""

    name: str  #: what the page calls it; no two robots of a page share one
    field: Field  #: the pitch it is on
    camera: OmniCamera | PinholeCamera | None  #: its camera; None: not calibrated yet
    radius_m: float  #: its size from above


@dataclass(frozen=True, slots=True)
class RobotPlan:
    """What a robot is about to do."""

    #: commanded velocity in the robot frame: forward and left in m/s, turn in rad/s
    command: tuple[float, float, float] | None = None
    way: tuple[Point, ...] = ()  #: points it drives to, in order, field frame, metres
    reasons: tuple[str, ...] = ()  #: why, in words


class TrueRobot(NamedTuple):
    """Where a simulated robot is: its name, its side (+1 attacks the goal at +x, -1 the other one), its pose."""

    name: str
    side: int
    pose: Pose2


class TrueWorld(NamedTuple):
    """Where everything is in a simulation, field frame; what has a name, and the "ball", can be put elsewhere."""

    robots: tuple[TrueRobot, ...]
    ball_m: Point | None


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """One moment of one robot."""

    robot: str
    frame: UInt8Array  #: (H, W, 3) uint8: BGR. Nobody writes to it any more.
    t_s: float  #: when it was taken
    view: View | None = None  #: what was seen in it; None: nobody has looked at it
    problem: str = ""  #: why nobody has looked at it; empty otherwise
    colors: Colors | None = None  #: in use when it was looked at
    plan: RobotPlan = RobotPlan()  #: what the robot is about to do
    truth: Pose2 | None = None  #: where it really was, if that is known, as in a simulation
    rate_hz: float | None = None  #: how often the source gives frames, by their times
    settings: Mapping[str, str] | None = None  #: words to show beside: the method, and what else does not change often
    world: TrueWorld | None = None  #: where everything was in a simulation


class Display(Protocol):
    """Takes what loops have seen; safe to use from several threads."""

    def set_robots(self, setups: tuple[RobotSetup, ...]) -> None:
        """Show these robots, and forget all others."""
        ...

    def put(self, moment: Moment) -> None:
        """Hand a moment over, and go on."""
        ...

    def wait_until_made(self, timeout_s: float) -> bool:
        """Wait until all that was handed over can be seen; return whether that is so."""
        ...

    def forget(self) -> None:
        """Forget all moments: the source has gone to another time."""
        ...

    def say(self, line: str) -> None:
        """Show a line."""
        ...

    def set_status(self, **changes: Any) -> None:
        """Change what is shown of the run: plain values by name."""
        ...

    def close(self) -> None:
        """End."""
        ...


class MomentWriter:
    """Turns the moments of one robot into bytes."""

    def __init__(self) -> None:
        # kept, so that a new object never has the identity of an old one
        self._sent: dict[str, object] = dict.fromkeys(_SELDOM)

    def write(self, moment: Moment) -> tuple[bytes, dict[str, object]]:
        """Return a moment without its frame, and what counts as sent once these bytes are on their way."""
        view = moment.view
        now: dict[str, object] = {"colors": moment.colors, "settings": moment.settings}
        shown = None
        if view is not None:
            shown = {name: getattr(view, name) for name in _VIEW_FIELDS}
            now |= {name: shown.pop(name) for name in ("polar", "grid", "camera")}
            shown["timings_s"] = dict(view.timings_s)
            # its frame comes apart from it, and its camera is the view's, held as the frame says
            source = shown.pop("marking_source")
            now["marking_finder"] = None if source is None else source.finder
            shown["held"] = None if source is None else (_mounting(source.camera), source.held_covariance)
            belief = view.belief
            if belief is not None and belief.free_map is not None:
                now["map_state"] = belief.free_map.state
                shown["belief"] = replace(belief, free_map=replace(belief.free_map, state=_NO_FRAME))
        changed = {name: value for name, value in now.items() if value is not self._sent[name]}
        rest = (moment.robot, moment.t_s, moment.problem, moment.plan, moment.truth, moment.rate_hz, moment.world)
        return pickle.dumps((changed, shown, rest), pickle.HIGHEST_PROTOCOL), changed

    def sent(self, changed: dict[str, object]) -> None:
        """Remember what the other side has now."""
        self._sent.update(changed)


class MomentReader:
    """Turns bytes of a `MomentWriter` into moments."""

    def __init__(self) -> None:
        self._known: dict[str, Any] = dict.fromkeys(_SELDOM)

    def read(self, data: bytes, frame: UInt8Array) -> Moment:
        """Return the moment; its frame comes apart from it."""
        changed, shown, (robot, t_s, problem, plan, truth, rate_hz, world) = pickle.loads(data)
        self._known.update(changed)
        known, view = self._known, None
        if shown is not None:
            belief = shown["belief"]
            if belief is not None and belief.free_map is not None:
                shown["belief"] = replace(belief, free_map=replace(belief.free_map, state=known["map_state"]))
            finder, camera, held, source = known["marking_finder"], known["camera"], shown.pop("held"), None
            if held is not None:
                mounting, covariance = held
                as_held = camera if mounting is None else camera.held(mounting)
                source = MarkingSource.of(finder, frame, as_held, covariance)
            view = View(**shown, polar=known["polar"], grid=known["grid"], camera=camera, marking_source=source)
        return Moment(robot, frame, t_s, view, problem, known["colors"], plan, truth, rate_hz, known["settings"], world)


def _mounting(camera: OmniCamera | PinholeCamera) -> Mounting | None:
    if isinstance(camera, OmniCamera):
        return None
    return Mounting(**{name: getattr(camera, name) for name in MOUNTING_NAMES})
