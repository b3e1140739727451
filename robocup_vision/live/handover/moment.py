"""One moment of one robot as the page shows it (frame, view, command), and its encoding for another process.

What seldom changes (the samples' places, half a megabyte, camera, colours, map) is sent only when it is another object.
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
# parts of a view and of a moment that are sent only when they have become another object
_SENT_ON_CHANGE = ("polar", "grid", "camera", "colors", "settings", "map_state", "marking_finder")
_VIEW_FIELDS = tuple(field.name for field in fields(View))
_NO_FRAME = np.empty((0, 0, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class RobotSetup:
    """The constant properties of a robot."""

    name: str  #: its name on the page, unique there
    field: Field  #: the field it plays on
    camera: OmniCamera | PinholeCamera | None  #: its camera; None: not calibrated yet
    radius_m: float  #: radius of its outline from above


@dataclass(frozen=True, slots=True)
class RobotPlan:
    """A robot's command and the plan behind it."""

    #: commanded velocity in the robot frame: forward and left in m/s, turn in rad/s
    command: tuple[float, float, float] | None = None
    way: tuple[Point, ...] = ()  #: points it drives to, in order, field frame, metres
    reasons: tuple[str, ...] = ()  #: reasons for them, as text


class TrueRobot(NamedTuple):
    """A simulated robot: its name, side (+1 attacks the goal at +x, -1 the other one) and pose in the field frame."""

    name: str
    side: int
    pose: Pose2


class TrueWorld(NamedTuple):
    """True places in a simulation, field frame; robots, by name, and the "ball" can be put elsewhere."""

    robots: tuple[TrueRobot, ...]
    ball_m: Point | None


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """One moment of one robot."""

    robot: str
    frame: UInt8Array  #: (H, W, 3) uint8: BGR; no longer written to
    t_s: float  #: when it was taken
    view: View | None = None  #: what was seen in it; None: it was not processed
    problem: str = ""  #: why it was not processed; empty otherwise
    colors: Colors | None = None  #: colours with which it was processed
    plan: RobotPlan = RobotPlan()  #: the robot's command and plan
    truth: Pose2 | None = None  #: true pose, if it is known, as in a simulation
    rate_hz: float | None = None  #: rate of the source's frames, by their times
    settings: Mapping[str, str] | None = None  #: texts to show beside the picture: the method and other settings
    world: TrueWorld | None = None  #: where everything was in a simulation


class Display(Protocol):
    """Shows what loops have seen; safe to use from several threads."""

    def set_robots(self, setups: tuple[RobotSetup, ...]) -> None:
        """Show these robots, and forget all others."""
        ...

    def put(self, moment: Moment) -> None:
        """Hand a moment over without waiting."""
        ...

    def wait_until_made(self, timeout_s: float) -> bool:
        """Wait until all moments handed over can be seen; return whether they can."""
        ...

    def forget(self) -> None:
        """Forget all moments, because the source has gone to another time."""
        ...

    def say(self, line: str) -> None:
        """Show a line."""
        ...

    def set_status(self, **changes: Any) -> None:
        """Change the status values that are shown, by name."""
        ...

    def close(self) -> None:
        """End."""
        ...


class MomentWriter:
    """Encodes the moments of one robot."""

    def __init__(self) -> None:
        # holding the objects keeps a new one from having the identity of an old one
        self._sent: dict[str, object] = dict.fromkeys(_SENT_ON_CHANGE)

    def write(self, moment: Moment) -> tuple[bytes, dict[str, object]]:
        """Return the bytes of a moment without its frame, and the values to pass to `sent` once they are sent."""
        view = moment.view
        now: dict[str, object] = {"colors": moment.colors, "settings": moment.settings}
        shown = None
        if view is not None:
            shown = {name: getattr(view, name) for name in _VIEW_FIELDS}
            now |= {name: shown.pop(name) for name in ("polar", "grid", "camera")}
            shown["timings_s"] = dict(view.timings_s)
            # its frame is sent apart, and its camera is the view's with another mounting
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
        """Remember which values the other side has now."""
        self._sent.update(changed)


class MomentReader:
    """Decodes the bytes of a `MomentWriter`."""

    def __init__(self) -> None:
        self._known: dict[str, Any] = dict.fromkeys(_SENT_ON_CHANGE)

    def read(self, data: bytes, frame: UInt8Array) -> Moment:
        """Return the moment; its frame is passed apart."""
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
