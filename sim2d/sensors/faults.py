"""Simulated faults of a robot's camera, odometry or body, and the latency that real frames have.

A fault is a value with its time. `FaultySenses` applies faults to a robot's senses before its player receives them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import UInt8Array
from robocup_vision.geometry import Pose2
from sim2d.robot_link import TIME_SLACK_S, Senses

SenseFaultKind = Literal["dropped", "delayed", "frozen", "black", "odometry"]

_KINDS = ("dropped", "delayed", "frozen", "black", "odometry")


@dataclass(frozen=True, slots=True)
class SenseFault:
    """A camera or an odometry that fails for a while.

    Parameters
    ----------
    robot : int
        Index of the robot.
    kind : {"dropped", "delayed", "frozen", "black", "odometry"}
        Frames are lost at random, come late, repeat the last good one as if it were new, or are black; or the odometry
        has a scale error.
    from_s, until_s : float
        Beginning and end of the fault.
    amount : float
        "dropped": fraction of the frames, 0 to 1. "delayed": seconds. "odometry": relative error, 0.2 for a fifth too
        much, -0.2 for a fifth too little. Otherwise unused.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    robot: int
    kind: SenseFaultKind
    from_s: float = 0.0
    until_s: float = math.inf
    amount: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in _KINDS:
            raise ArgumentError(f"a fault's kind must be one of {', '.join(_KINDS)}, got {self.kind!r}")
        if not 0.0 <= self.from_s <= self.until_s:
            raise ArgumentError(f"a fault must not end before it begins, got {self.from_s!r} to {self.until_s!r} s")
        low, high = {"dropped": (0.0, 1.0), "delayed": (0.0, 10.0), "odometry": (-1.0, 1.0)}.get(
            self.kind, (-math.inf, math.inf)
        )
        if not low <= self.amount <= high:
            raise ArgumentError(f"amount of '{self.kind}' must be within {low:g} to {high:g}, got {self.amount!r}")

    def is_on(self, t_s: float) -> bool:
        """Return whether the fault is active at a time."""
        return self.from_s - TIME_SLACK_S <= t_s < self.until_s - TIME_SLACK_S


@dataclass(frozen=True, slots=True)
class BodyFault:
    """A robot pushed, turned or carried elsewhere; its odometry does not measure that.

    Parameters
    ----------
    robot : int
        Index of the robot.
    at_s : float
        Time of the fault.
    push_m : (float, float)
        Displacement by a push, field frame, metres.
    turn_rad : float
        Turn during the push.
    carry_to : Pose2 or None
        Pose to which it is carried, field frame.
    """

    robot: int
    at_s: float
    push_m: tuple[float, float] = (0.0, 0.0)
    turn_rad: float = 0.0
    carry_to: Pose2 | None = None

    def __post_init__(self) -> None:
        if not self.at_s >= 0.0:
            raise ArgumentError(f"a fault's time must not be negative, got {self.at_s!r} s")

    @property
    def kind(self) -> Literal["pushed", "turned", "carried"]:
        """The kind of fault in a word."""
        if self.carry_to is not None:
            return "carried"
        return "pushed" if any(self.push_m) else "turned"

    @property
    def from_s(self) -> float:
        """Its beginning."""
        return self.at_s

    @property
    def until_s(self) -> float:
        """Its end, which is its beginning."""
        return self.at_s


Fault = SenseFault | BodyFault


class FaultySenses:
    """Applies one robot's faults to its senses.

    Parameters
    ----------
    rng : numpy Generator
        Chooses the frames that are dropped.
    """

    def __init__(self, faults: Sequence[SenseFault], rng: np.random.Generator) -> None:
        self._faults = tuple(faults)
        self._rng = rng
        self._longest_delay_s = max((f.amount for f in self._faults if f.kind == "delayed"), default=0.0)
        self._exposed: deque[Senses] = deque()
        self._last_good: tuple[UInt8Array, tuple[UInt8Array | None, ...] | None] | None = None
        self._handed_on_s = -math.inf

    def apply(self, senses: Senses) -> Senses:
        """Return the senses with the faults; call it once each control period, in order."""
        pan_now_rad = senses.frame_pan_rad
        on = {fault.kind: fault.amount for fault in self._faults if fault.is_on(senses.t_s)}
        if "odometry" in on:
            gain, step = 1.0 + on["odometry"], senses.odometry
            odometry = Pose2(gain * step.x_m, gain * step.y_m, gain * step.theta_rad)
            senses = replace(senses, odometry=odometry)
        if "delayed" in on or self._longest_delay_s:
            senses = self._delayed(senses, on.get("delayed", 0.0))
        if "frozen" in on:
            # the picture is old, but its time and pan are those of now
            came = self._last_good is not None
            frame, rig_frames = (None, None) if self._last_good is None else self._last_good
            senses = replace(
                senses,
                frame=frame,
                rig_frames=rig_frames,
                frame_t_s=senses.t_s if came else None,
                frame_pan_rad=pan_now_rad if came else None,
            )
        elif senses.frame is not None:
            self._last_good = senses.frame, senses.rig_frames
        if "black" in on and senses.frame is not None:
            black = _black(senses.frame)
            rig_black = None if senses.rig_frames is None else tuple(map(_black, senses.rig_frames))
            senses = replace(senses, frame=black, rig_frames=rig_black)
        if "dropped" in on and self._rng.random() < on["dropped"]:
            senses = senses.with_frame_of(None)
        return senses

    def _delayed(self, senses: Senses, delay_s: float) -> Senses:
        if senses.frame is not None:
            self._exposed.append(senses)
        newest: Senses | None = None
        while self._exposed and _exposed_s(self._exposed[0]) < senses.t_s - self._longest_delay_s - TIME_SLACK_S:
            self._exposed.popleft()
        for then in self._exposed:
            if self._handed_on_s < _exposed_s(then) <= senses.t_s - delay_s + TIME_SLACK_S:
                newest = then
        if newest is not None:
            self._handed_on_s = _exposed_s(newest)
        return senses.with_frame_of(newest)


def _black(frame: UInt8Array | None) -> UInt8Array | None:
    if frame is None:
        return None
    black = np.zeros_like(frame)
    black.flags.writeable = False
    return black


def _exposed_s(senses: Senses) -> float:
    return senses.t_s if senses.frame_t_s is None else senses.frame_t_s


@dataclass(frozen=True, slots=True)
class LatencySettings:
    """Settings of `LateFrames`."""

    #: Smallest and greatest latency of a frame.
    min_s: float = 0.02
    max_s: float = 0.06
    #: Standard deviation of a frame's latency about the robot's usual latency, which is drawn once.
    jitter_s: float = 0.005
    #: Fraction of the frames that are lost.
    lost_ratio: float = 0.02

    def __post_init__(self) -> None:
        if not 0.0 <= self.min_s <= self.max_s <= 1.0:
            raise ArgumentError(f"min_s and max_s must be within 0 to 1 s and in order, got {self.min_s}, {self.max_s}")
        if not 0.0 <= self.lost_ratio <= 1.0:
            raise ArgumentError(f"lost_ratio must be within 0 to 1, got {self.lost_ratio}")


class LateFrames:
    """Delays one robot's frames; all its other senses have no delay."""

    def __init__(self, settings: LatencySettings, rng: np.random.Generator) -> None:
        self._settings, self._rng = settings, rng
        self._usual_s = float(rng.uniform(settings.min_s, settings.max_s))
        self._waiting: deque[tuple[float, Senses]] = deque()

    def apply(self, senses: Senses) -> Senses:
        """Return the senses with the newest frame that has arrived; call it once each control period, in order."""
        settings = self._settings
        late_s = self._usual_s + settings.jitter_s * float(self._rng.standard_normal())
        is_lost = float(self._rng.random()) < settings.lost_ratio
        if senses.frame is not None and not is_lost:
            due_s = senses.t_s + max(settings.min_s, min(settings.max_s, late_s))
            self._waiting.append((due_s, senses))
        newest: Senses | None = None
        while self._waiting and self._waiting[0][0] <= senses.t_s + TIME_SLACK_S:
            newest = self._waiting.popleft()[1]
        return senses.with_frame_of(newest)
