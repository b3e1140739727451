"""Repeats the calls of a recording, with the same or other settings, and compares the outputs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from field_models.errors import ArgumentError, FileError
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import wrap_angle
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.recording.loops import Changes, loop_kind
from robocup_vision.recording.recording import Recording
from robocup_vision.recording.values import value_codec

_CODEC = value_codec()


@dataclass(frozen=True, slots=True, eq=False)
class ReplayedCall:
    """One call that was repeated."""

    number: int  #: 0, 1, ... in the order of the run
    kind: str  #: what was called
    t_s: float  #: time that the call refers to
    #: outputs in the run, and now
    recorded: Mapping[str, Any]
    replayed: Mapping[str, Any]

    @property
    def is_same(self) -> bool:
        """Whether both agree in every bit."""
        return _plain(self.recorded) == _plain(self.replayed)


def replay(
    recording: Recording, changes: Changes = Changes(), from_s: float | None = None, to_s: float | None = None
) -> Iterator[ReplayedCall]:
    """Repeat the calls of a recording.

    Parameters
    ----------
    from_s, to_s : float, optional
        Only calls between these times are yielded. Earlier ones are also repeated, because the memory depends on them.

    Yields
    ------
    ReplayedCall

    Raises
    ------
    ArgumentError
        If the span contains no calls, or the changes are not possible.
    FileError
        If a part of the file is damaged, or there are no calls in it.
    RobocupVisionError
        If the loop cannot be made again.
    """
    for name, t_s in (("--from", from_s), ("--to", to_s)):
        if t_s is not None and not math.isfinite(t_s):
            raise ArgumentError(f"{name} must be a finite number of seconds, got {t_s}")
    if from_s is not None and to_s is not None and not from_s <= to_s:
        raise ArgumentError(f"--to must not be before --from, got {to_s:g} before {from_s:g}")
    _require_calls(recording, from_s, to_s)
    loop = loop_kind(recording.run.loop).make(recording.run, changes)
    for call in recording.calls(to_s=to_s):
        replayed = loop.call(call)
        if from_s is None or call.t_s >= from_s:
            yield ReplayedCall(call.number, call.kind, call.t_s, call.outputs, replayed)


def _require_calls(recording: Recording, from_s: float | None, to_s: float | None) -> None:
    """Refuse a span without calls, for which a comparison would report that everything is the same."""
    if next(recording.call_times(from_s, to_s), None) is not None:
        return
    times = list(recording.call_times())
    if not times:
        raise FileError(recording.path, "holds no call, there is nothing to replay")
    asked = " ".join(f"{name} {t_s:g}" for name, t_s in (("--from", from_s), ("--to", to_s)) if t_s is not None)
    raise ArgumentError(
        f"{recording.path}: no call is in {asked}, they are from {min(times):.3f} s to {max(times):.3f} s"
    )


@dataclass(slots=True)
class Spread:
    """Differences between a replayed and a recorded quantity, over the calls that have both."""

    values: list[float] = field(default_factory=list)

    def add(self, value: float) -> None:
        """Add one difference, which must not be negative."""
        self.values.append(value)

    @property
    def median(self) -> float | None:
        """The median (of an even number, the upper one); None if there are no differences."""
        ordered = sorted(self.values)
        return ordered[len(ordered) // 2] if ordered else None

    @property
    def largest(self) -> float | None:
        """The largest difference; None if there are none."""
        return max(self.values, default=None)


@dataclass(slots=True)
class Differences:
    """Differences between a replay and its recording."""

    #: number of calls, and of those whose outputs agree in every bit
    calls: int = 0
    same: int = 0
    first_s: float | None = None  #: time of the first call that differed
    located: tuple[int, int] = (0, 0)  #: number of frames that were located, then and now
    seen: tuple[int, int] = (0, 0)  #: number of frames in which a ball was found, then and now
    looks: int = 0
    #: differences between both, over the calls in which both have a value
    pose_m: Spread = field(default_factory=Spread)
    pose_rad: Spread = field(default_factory=Spread)
    belief_m: Spread = field(default_factory=Spread)
    belief_rad: Spread = field(default_factory=Spread)
    ball_m: Spread = field(default_factory=Spread)
    command_mps: Spread = field(default_factory=Spread)

    def add(self, call: ReplayedCall) -> None:
        """Add one call."""
        self.calls += 1
        if call.is_same:
            self.same += 1
        elif self.first_s is None:
            self.first_s = call.t_s
        then, now = call.recorded, call.replayed
        if then.get("pose") is not None or now.get("pose") is not None:
            self.looks += 1
            self.located = _counted(self.located, _pose(then, "pose"), _pose(now, "pose"))
            self.seen = _counted(self.seen, then.get("ball"), now.get("ball"))
        for name, position, heading in (
            ("pose", self.pose_m, self.pose_rad),
            ("belief", self.belief_m, self.belief_rad),
        ):
            a, b = _pose(then, name), _pose(now, name)
            if a is not None and b is not None:
                position.add(math.hypot(a.pose.x_m - b.pose.x_m, a.pose.y_m - b.pose.y_m))
                heading.add(abs(wrap_angle(a.pose.theta_rad - b.pose.theta_rad)))
        a_ball, b_ball = then.get("ball"), now.get("ball")
        if isinstance(a_ball, Ball) and isinstance(b_ball, Ball):
            self.ball_m.add(math.hypot(a_ball.x_m - b_ball.x_m, a_ball.y_m - b_ball.y_m))
        a_mps, b_mps = then.get("velocity_mps"), now.get("velocity_mps")
        if a_mps is not None and b_mps is not None:
            self.command_mps.add(math.dist(a_mps, b_mps))

    @property
    def is_same(self) -> bool:
        """Whether the outputs of all calls agree in every bit."""
        return self.same == self.calls


def _counted(counts: tuple[int, int], then: object, now: object) -> tuple[int, int]:
    return counts[0] + (then is not None), counts[1] + (now is not None)


def _pose(outputs: Mapping[str, Any], name: str) -> PoseEstimate | None:
    pose = outputs.get(name)
    return pose if isinstance(pose, PoseEstimate) else None


def _plain(outputs: Mapping[str, Any]) -> bytes:
    return _CODEC.pack(outputs)
