"""What a match was worth for one robot: how well it knew its place, how it moved, and how it got over its faults.

Truth and belief meet here and in the pictures only. Everything is counted as the match goes on, so that an hour of it
fits into memory.
"""

from __future__ import annotations

import cmath
import math
from array import array
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.scoring import FAIR_M, FAIR_RAD, NEAR_M, NEAR_RAD
from robocup_vision.geometry import Pose2
from sim2d.robot_link import Command
from sim2d.sensors.faults import Fault

# the two halves of the field are told apart only once something was seen of them
SETTLING_S = 2.0
# stuck: within this of one place for so long, though told to drive, faster than that, for at least half of it; and not
# even half as far as free wheels would have come, for a keeper sways on the spot as it wants to
STUCK_S, STUCK_WITHIN_M, STUCK_TOLD_MPS = 5.0, 0.10, 0.05
# a fault is over once the belief is right, and stays so for this long
_STAYS_RIGHT_S = 0.5


@dataclass(frozen=True, slots=True)
class RobotFigures:
    """One robot's match. Shares are of all frames; errors are of the frames with a believed pose.

    Parameters
    ----------
    robot, side, number : int
        Index in the match, +1 or -1 for the goal it attacks, number within its side.
    frames : int
        Control periods, each with one camera frame.
    within_5cm_3deg : float
        Share of frames after which the believed pose was that near the truth, in the right half of the field.
    median_error_m, p95_error_m, median_error_rad, p95_error_rad : float or None
        Of the believed pose; None if none was ever believed.
    lost_share : float
        Share of frames with no believed pose, or one more than 10 cm or 5 degrees off.
    longest_lost_s : float
        The longest it was lost on end.
    right_half_share : float or None
        Of the poses believed after the first 2 s, those nearer to the truth than to its half turn.
    collisions, wall_contacts : int
        Times it came to touch another robot, and something fixed.
    kicks : int
        Times it kicked the ball.
    distance_m : float
        Way driven.
    possession : float
        Share of the time it had the ball within reach, nearer than any other robot.
    longest_stuck_s : float
        Longest time, of 5 s or more, that it stayed within 10 cm of a place though its commands told it to drive
        (faster than 5 cm/s) for half of it or more, and free wheels would have driven twice as far; 0 if never.
    stopped_s : float or None
        When it was stopped, its player having failed.
    stopped_reason : str
        Why; empty if it was not.
    """

    robot: int
    side: int
    number: int
    frames: int
    within_5cm_3deg: float
    median_error_m: float | None
    p95_error_m: float | None
    median_error_rad: float | None
    p95_error_rad: float | None
    lost_share: float
    longest_lost_s: float
    right_half_share: float | None
    collisions: int
    wall_contacts: int
    kicks: int
    distance_m: float
    possession: float
    longest_stuck_s: float
    stopped_s: float | None
    stopped_reason: str


@dataclass(frozen=True, slots=True)
class FaultFigures:
    """A fault, and how long after its end the belief was right (5 cm, 3 degrees) for half a second on end.

    `recovery_s` is None if that never happened.
    """

    robot: int
    kind: str
    from_s: float
    until_s: float
    recovery_s: float | None


@dataclass(slots=True)
class _Run:
    """How long something has lasted, and the longest it ever did."""

    now_s: float = 0.0
    longest_s: float = 0.0

    def add(self, holds: bool, step_s: float) -> None:
        self.now_s = self.now_s + step_s if holds else 0.0
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
    """Counts one robot's match, one control period after the other.

    Parameters
    ----------
    robot, side, number : int
        See `RobotFigures`.
    step_s : float
        The control period.
    acceleration_mps2 : float
        Of free wheels.
    faults : sequence of Fault
        Those of this robot.
    """

    def __init__(
        self,
        robot: int,
        side: int,
        number: int,
        step_s: float,
        acceleration_mps2: float,
        faults: Sequence[Fault] = (),
    ) -> None:
        self._robot, self._side, self._number, self._step_s = robot, side, number, step_s
        self._frames = self._near = self._lost_frames = 0
        self._half_frames = self._right_half = 0
        self._error_m, self._error_rad = array("f"), array("f")
        self._lost, self._stuck = _Run(), _Run()
        self._acceleration_mps2 = acceleration_mps2
        self._way = _Way(step_s, acceleration_mps2)
        self._distance_m = 0.0
        self._before: Pose2 | None = None
        self._possession_s = 0.0
        self._recoveries = [_Recovery(fault) for fault in faults]
        self.collisions = self.wall_contacts = self.kicks = 0
        self.stopped_s: float | None = None
        self.stopped_reason = ""

    def add(self, t_s: float, truth: Pose2, belief: object, command: Command, has_ball: bool) -> None:
        """Take in a control period: where the robot was, where it believed to be, and what it then asked for."""
        self._frames += 1
        is_near = False
        is_lost = True
        if isinstance(belief, PoseEstimate):
            error_m, error_rad = belief.pose.error_to(truth)
            self._error_m.append(error_m)
            self._error_rad.append(error_rad)
            is_near = error_m <= NEAR_M and error_rad <= NEAR_RAD
            is_lost = not (error_m <= FAIR_M and error_rad <= FAIR_RAD)
            if t_s >= SETTLING_S:
                self._half_frames += 1
                self._right_half += error_m + error_rad <= sum(belief.pose.half_turn().error_to(truth))
        self._near += is_near
        self._lost_frames += is_lost
        self._lost.add(is_lost, self._step_s)
        self._possession_s += has_ball * self._step_s
        if self._before is not None:
            self._distance_m += math.hypot(truth.x_m - self._before.x_m, truth.y_m - self._before.y_m)
        self._before = truth
        self._stuck.add(self._way.add(truth, command), self._step_s)
        for recovery in self._recoveries:
            recovery.add(t_s, is_near)

    def put_down(self) -> None:
        """Say that the robot is being carried elsewhere, a way it does not drive."""
        self._before = None
        self._way = _Way(self._step_s, self._acceleration_mps2)

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
            lost_share=self._lost_frames / frames,
            longest_lost_s=self._lost.longest_s,
            right_half_share=self._right_half / self._half_frames if self._half_frames else None,
            collisions=self.collisions,
            wall_contacts=self.wall_contacts,
            kicks=self.kicks,
            distance_m=self._distance_m,
            possession=self._possession_s / (frames * self._step_s),
            longest_stuck_s=stuck_s + STUCK_S if stuck_s else 0.0,
            stopped_s=self.stopped_s,
            stopped_reason=self.stopped_reason,
        )

    @property
    def fault_figures(self) -> tuple[FaultFigures, ...]:
        """How it got over each of its faults so far."""
        return tuple(
            FaultFigures(self._robot, r.fault.kind, r.fault.from_s, r.fault.until_s, r.recovery_s)
            for r in self._recoveries
        )


@dataclass(slots=True)
class _Step:
    """A control period: where the robot was, if it was told to drive, how far it and how far free wheels came."""

    x_m: float
    y_m: float
    is_told: bool
    came_m: float
    free_m: float


@dataclass(slots=True)
class _Way:
    """The last seconds, step by step."""

    step_s: float
    acceleration_mps2: float
    steps: deque[_Step] = field(default_factory=deque)
    velocity_mps: complex = 0j
    # what the robot was told a period ago, field frame: it obeys about that late
    told_mps: complex = 0j

    def add(self, truth: Pose2, command: Command) -> bool:
        """Take in a period; tell whether the robot has been stuck for the last seconds."""
        place = complex(truth.x_m, truth.y_m)
        last = complex(self.steps[-1].x_m, self.steps[-1].y_m) if self.steps else place
        change, most = self.told_mps - self.velocity_mps, self.acceleration_mps2 * self.step_s
        free_mps = self.velocity_mps + change * min(1.0, most / max(abs(change), 1e-9))
        step = _Step(
            truth.x_m, truth.y_m, abs(self.told_mps) > STUCK_TOLD_MPS, abs(place - last), abs(free_mps) * self.step_s
        )
        self.steps.append(step)
        self.velocity_mps = (place - last) / self.step_s
        self.told_mps = complex(command.forward_mps, command.left_mps) * cmath.rect(1.0, truth.theta_rad)
        if len(self.steps) <= round(STUCK_S / self.step_s):
            return False
        first = self.steps.popleft()
        if any(math.hypot(s.x_m - first.x_m, s.y_m - first.y_m) > STUCK_WITHIN_M for s in self.steps):
            return False
        if sum(s.is_told for s in self.steps) < len(self.steps) / 2:
            return False
        return sum(s.came_m for s in self.steps) < sum(s.free_m for s in self.steps) / 2


def _quantile(values: array[float], share: float) -> float | None:
    return float(np.quantile(np.frombuffer(values, dtype=np.float32), share)) if values else None
