"""Collects one robot's figures in a match: localisation errors, motion, recovery from faults.

Only this module and the films compare estimates with the truth. Figures are accumulated to save memory.
"""

from __future__ import annotations

import cmath
import math
from array import array
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from robocup_vision.calibration.online import OnlineState
from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.scoring import FAIR_M, FAIR_RAD, NEAR_M, NEAR_RAD
from robocup_vision.geometry import Pose2
from sim2d.robot_link import CONTROL_PERIOD_S, Command
from sim2d.sensors.faults import Fault

# a robot needs some frames to decide between the two halves of the field
SETTLING_S = 2.0
# A robot is stuck if it stays for this time within this distance of one place although its commands were faster than
# this speed for at least half of the time. It must also have driven less than half as far as free wheels would have
# come, because a keeper moves to and fro on purpose.
STUCK_S, STUCK_WITHIN_M, STUCK_COMMANDED_MPS = 5.0, 0.10, 0.05
# time between two recorded calibrations of a player's camera
CALIBRATION_EVERY_S = 5.0
# a robot has recovered once its estimate is right, and stays so for this long
_STAYS_RIGHT_S = 0.5


@dataclass(frozen=True, slots=True)
class CalibrationFigures:
    """A player's estimate of its camera at one time, see `OnlineState`."""

    #: Time of the estimate.
    t_s: float
    #: Image centre and tilt in use; for a pinhole camera `tilt_rad` is its tilt and roll.
    center_px: tuple[float, float]
    tilt_rad: tuple[float, float]
    #: Standard deviations.
    center_std_px: tuple[float, float]
    tilt_std_rad: tuple[float, float]
    #: Scale of the image against the camera file's, and its standard deviation.
    scale: float
    scale_std: float
    #: Numbers of changes of the camera, and of knocks detected, so far.
    steps: int
    knocks: int


@dataclass(frozen=True, slots=True)
class RobotFigures:
    """One robot's figures. Ratios refer to all frames, errors to the frames with an estimated pose."""

    #: Index in the match, +1 or -1 for the goal it attacks, number within its side.
    robot: int
    side: int
    number: int
    #: Control periods, each with one camera frame.
    frames: int
    #: Fraction of frames after which the estimated pose was within 5 cm and 3 degrees of the truth.
    within_5cm_3deg: float
    #: Errors of the estimated pose; None if there was no estimate.
    median_error_m: float | None
    p95_error_m: float | None
    median_error_rad: float | None
    p95_error_rad: float | None
    #: Fraction of frames without an estimate, or with an error of more than 10 cm or 5 degrees.
    lost_ratio: float
    #: Longest continuous time in that state.
    longest_lost_s: float
    #: Fraction of the poses estimated after the first 2 s that are nearer to the truth than to its half turn.
    right_half_ratio: float | None
    #: Numbers of contacts with other robots, and with fixed objects.
    collisions: int
    wall_contacts: int
    #: Number of kicks of the ball.
    kicks: int
    #: Distance driven.
    distance_m: float
    #: Fraction of the time for which it had the ball within reach, nearer than any other robot.
    possession: float
    #: Longest time, of 5 s or more, that it stayed within 10 cm of a place though its commands were to drive (faster
    #: than 5 cm/s) for half of it or more, and free wheels would have driven twice as far; 0 if never.
    longest_stuck_s: float
    #: When it was stopped because its player failed; None if it was not.
    stopped_s: float | None
    #: Reason; empty if it was not stopped.
    stopped_reason: str
    #: The player's estimates of its camera, every 5 s; empty if the player does not calibrate.
    calibration: tuple[CalibrationFigures, ...] = ()


@dataclass(frozen=True, slots=True)
class FaultFigures:
    """A fault, and the recovery from it.

    `recovery_s` is the time from the fault's end until the estimate is right (within 5 cm and 3 degrees) and stays so
    for half a second; None if that never happened.
    """

    robot: int
    kind: str
    from_s: float
    until_s: float
    recovery_s: float | None


@dataclass(slots=True)
class _Run:
    """How long a condition has held until now, and the longest time it has ever held."""

    now_s: float = 0.0
    longest_s: float = 0.0

    def add(self, holds: bool) -> None:
        self.now_s = self.now_s + CONTROL_PERIOD_S if holds else 0.0
        self.longest_s = max(self.longest_s, self.now_s)


@dataclass(slots=True)
class _Recovery:
    fault: Fault
    right_since_s: float | None = None
    recovery_s: float | None = None

    def add(self, t_s: float, is_near: bool) -> None:
        if self.recovery_s is not None or t_s < self.fault.until_s:
            return
        if not is_near:
            self.right_since_s = None
            return
        if self.right_since_s is None:
            self.right_since_s = t_s
        if t_s - self.right_since_s >= _STAYS_RIGHT_S:
            self.recovery_s = self.right_since_s - self.fault.until_s


class RobotLog:
    """Collects one robot's figures, one control period after the other.

    Parameters
    ----------
    acceleration_mps2 : float
        The robot's acceleration limit, for the motion of free wheels.
    """

    def __init__(
        self,
        robot: int,
        side: int,
        number: int,
        acceleration_mps2: float,
        faults: Sequence[Fault] = (),
    ) -> None:
        self._robot, self._side, self._number = robot, side, number
        self._frames = self._near = self._lost_frames = 0
        self._half_frames = self._right_half = 0
        self._error_m, self._error_rad = array("f"), array("f")
        self._lost, self._stuck = _Run(), _Run()
        self._acceleration_mps2 = acceleration_mps2
        self._way = _Way(acceleration_mps2)
        self._distance_m = 0.0
        self._before: Pose2 | None = None
        self._possession_s = 0.0
        self._recoveries = [_Recovery(fault) for fault in faults]
        self._calibration: list[CalibrationFigures] = []
        self.collisions = self.wall_contacts = self.kicks = 0
        self.stopped_s: float | None = None
        self.stopped_reason = ""

    def add(self, t_s: float, truth: Pose2, estimate: object, command: Command, has_ball: bool) -> None:
        """Add a control period: true pose, estimated pose or none, command, and whether the robot has the ball."""
        self._frames += 1
        is_near = False
        is_lost = True
        if isinstance(estimate, PoseEstimate):
            error_m, error_rad = estimate.pose.error_to(truth)
            self._error_m.append(error_m)
            self._error_rad.append(error_rad)
            is_near = error_m <= NEAR_M and error_rad <= NEAR_RAD
            is_lost = not (error_m <= FAIR_M and error_rad <= FAIR_RAD)
            if t_s >= SETTLING_S:
                self._half_frames += 1
                self._right_half += error_m + error_rad <= sum(estimate.pose.half_turn().error_to(truth))
        self._near += is_near
        self._lost_frames += is_lost
        self._lost.add(is_lost)
        self._possession_s += has_ball * CONTROL_PERIOD_S
        if self._before is not None:
            self._distance_m += math.hypot(truth.x_m - self._before.x_m, truth.y_m - self._before.y_m)
        self._before = truth
        self._stuck.add(self._way.add(truth, command))
        for recovery in self._recoveries:
            recovery.add(t_s, is_near)

    def add_calibration(self, t_s: float, state: OnlineState | None) -> None:
        """Add the player's estimate of its camera, if there is one and `CALIBRATION_EVERY_S` has passed."""
        if state is None or (self._calibration and t_s < self._calibration[-1].t_s + CALIBRATION_EVERY_S - 1e-9):
            return
        values = (getattr(state, one.name) for one in fields(CalibrationFigures)[1:])
        self._calibration.append(CalibrationFigures(t_s, *values))

    def put_down(self) -> None:
        """Start a new path: the robot was carried elsewhere."""
        self._before = None
        self._way = _Way(self._acceleration_mps2)

    @property
    def figures(self) -> RobotFigures:
        """The figures so far."""
        frames = max(self._frames, 1)
        stuck_s = self._stuck.longest_s
        return RobotFigures(
            robot=self._robot,
            side=self._side,
            number=self._number,
            frames=self._frames,
            within_5cm_3deg=self._near / frames,
            median_error_m=_quantile(self._error_m, 0.5),
            p95_error_m=_quantile(self._error_m, 0.95),
            median_error_rad=_quantile(self._error_rad, 0.5),
            p95_error_rad=_quantile(self._error_rad, 0.95),
            lost_ratio=self._lost_frames / frames,
            longest_lost_s=self._lost.longest_s,
            right_half_ratio=self._right_half / self._half_frames if self._half_frames else None,
            collisions=self.collisions,
            wall_contacts=self.wall_contacts,
            kicks=self.kicks,
            distance_m=self._distance_m,
            possession=self._possession_s / (frames * CONTROL_PERIOD_S),
            longest_stuck_s=stuck_s + STUCK_S if stuck_s else 0.0,
            stopped_s=self.stopped_s,
            stopped_reason=self.stopped_reason,
            calibration=tuple(self._calibration),
        )

    @property
    def fault_figures(self) -> tuple[FaultFigures, ...]:
        """The recovery from each of the robot's faults so far."""
        return tuple(
            FaultFigures(self._robot, r.fault.kind, r.fault.from_s, r.fault.until_s, r.recovery_s)
            for r in self._recoveries
        )


@dataclass(slots=True)
class _Step:
    """A control period: position x + iy, whether a drive was commanded, distances driven and of free wheels."""

    place_m: complex
    is_commanded: bool
    driven_m: float
    free_m: float


@dataclass(slots=True)
class _Way:
    """The steps of the last `STUCK_S` seconds; vectors of the field frame are complex, x + iy."""

    acceleration_mps2: float
    steps: deque[_Step] = field(default_factory=deque)
    velocity_mps: complex = 0j
    # the command of the period before, field frame: the robot obeys with about this delay
    commanded_mps: complex = 0j

    def add(self, truth: Pose2, command: Command) -> bool:
        """Add a period; return whether the robot has been stuck for the last seconds."""
        place = complex(truth.x_m, truth.y_m)
        last = self.steps[-1].place_m if self.steps else place
        change, max_change = self.commanded_mps - self.velocity_mps, self.acceleration_mps2 * CONTROL_PERIOD_S
        free_mps = self.velocity_mps + change * min(1.0, max_change / max(abs(change), 1e-9))
        is_commanded = abs(self.commanded_mps) > STUCK_COMMANDED_MPS
        self.steps.append(_Step(place, is_commanded, abs(place - last), abs(free_mps) * CONTROL_PERIOD_S))
        self.velocity_mps = (place - last) / CONTROL_PERIOD_S
        self.commanded_mps = complex(command.forward_mps, command.left_mps) * cmath.rect(1.0, truth.theta_rad)
        if len(self.steps) <= round(STUCK_S / CONTROL_PERIOD_S):
            return False
        first = self.steps.popleft()
        if any(abs(step.place_m - first.place_m) > STUCK_WITHIN_M for step in self.steps):
            return False
        if sum(s.is_commanded for s in self.steps) < len(self.steps) / 2:
            return False
        return sum(s.driven_m for s in self.steps) < sum(s.free_m for s in self.steps) / 2


def _quantile(values: array[float], level: float) -> float | None:
    return float(np.quantile(np.frombuffer(values, dtype=np.float32), level)) if values else None
