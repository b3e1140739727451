"""A robot located by a look now and then, and by odometry that slips in between: for speed.py and gap_choices.py.

Its planner gets estimates only; it moves in truth. Its errors are distributed normally, or with heavier tails. In a
slalom it drives through gaps between opponents in a row, at a constant speed or as planned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.motion.path_following import drive, spread
from robocup_vision.planning import Disc, MotionLimits, PathFollower, PoseNoise, SpeedPlan, SpeedPlanner


@dataclass(frozen=True, slots=True)
class ErrorLaw:
    """Student's t distribution: the fewer degrees of freedom, the heavier its tails."""

    degrees: float = math.inf  #: of freedom; infinite: normal
    scale: float = 1.0  #: its unit, in the planner's standard deviations

    @classmethod
    def fitted(cls, errors: FloatArray) -> ErrorLaw:
        """Fit to errors (N,) in stated standard deviations, by maximum likelihood about zero."""
        degrees, _, scale = student.fit(errors, floc=0.0)
        return cls(float(degrees), float(scale))

    def draw(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw so many errors, in the planner's standard deviations."""
        if math.isinf(self.degrees):
            return np.asarray(self.scale * rng.standard_normal(count))
        return np.asarray(self.scale * rng.standard_t(self.degrees, count))


@dataclass(frozen=True, slots=True)
class Errors:
    """What a world's errors are."""

    #: of the robot's own pose, and of the places of others
    pose: ErrorLaw = ErrorLaw()
    obstacle: ErrorLaw = ErrorLaw()
    missed: float = 1.0  #: how often an opponent is missed in a look, of what the planner reckons with


# the planner's own
MATCHED = Errors()


LIMITS = MotionLimits(1.5, 3.0)
RADIUS_M = 0.09
PERIOD_S, LOOK_PERIOD_S = 1 / 30, 0.8
# of a look: what differs from look to look, and what all looks of a drive have in common (calibration, map)
LOOK_STD, BIAS_STD = np.array([0.02, 0.02, 0.02]), np.array([0.018, 0.018, 0.005])
DISC_STD_M = 0.012
NOISE = PoseNoise(0.06, 0.12, np.diag(LOOK_STD**2 + BIAS_STD**2))
# commands between two plans, and seconds without a safe speed after which the robot goes another way
PLAN_EVERY, PATIENCE_S = 3, 4.0
FOLLOWER = PathFollower(LIMITS)
PLANNER = SpeedPlanner(FOLLOWER, RADIUS_M, NOISE, LOOK_PERIOD_S)
_LOOK_EVERY = round(LOOK_PERIOD_S / PERIOD_S)
_STANDS_MPS = 0.02


class UncertainRobot:
    """Starts at rest near the origin, and estimates to be there."""

    def __init__(self, rng: np.random.Generator, errors: Errors = MATCHED) -> None:
        self._rng, self._law = rng, errors.pose
        self._bias = BIAS_STD * self._law.draw(rng, 3)
        truth = LOOK_STD * self._law.draw(rng, 3) - self._bias
        self.place_m, self._turn = (float(truth[0]), float(truth[1])), float(truth[2])
        self.velocity_mps, self._pending = (0.0, 0.0), (0.0, 0.0)
        self._believed, self._covariance = np.zeros(3), np.diag(LOOK_STD**2)
        self._since, self._at_look = np.zeros(2), self._covariance
        self._slip = self._draw_slip()
        # looks come when they come, not when the drive begins
        self._first = self._step = int(rng.integers(_LOOK_EVERY))

    @property
    def seconds(self) -> float:
        """Since the start."""
        return (self._step - self._first) * PERIOD_S

    @property
    def pose(self) -> Pose2:
        """The estimate."""
        return Pose2(*self._believed.tolist())

    @property
    def plans_now(self) -> bool:
        """Whether this is a time for a plan."""
        return self._step % PLAN_EVERY == 0

    def look(self) -> bool:
        """Look, if it is time to; return whether it was."""
        if self._step % _LOOK_EVERY != 0:
            return False
        seen = np.array([*self.place_m, self._turn]) + self._bias + LOOK_STD * self._law.draw(self._rng, 3)
        gain = self._covariance @ np.linalg.inv(self._covariance + np.diag(LOOK_STD**2))
        self._believed = self._believed + gain @ (seen - self._believed)
        self._covariance = (np.eye(3) - gain) @ self._covariance
        self._since, self._at_look = np.zeros(2), self._covariance
        self._slip = self._draw_slip()
        return True

    def plan(self, path_m: FloatArray, discs: tuple[Disc, ...]) -> SpeedPlan:
        """Return the largest safe speed by its estimates."""
        # velocities as the robot thinks them to be: turned by its error of heading
        off = float(self._believed[2]) - self._turn
        measured, pending = (Pose2(0, 0, off).transform(v).tolist() for v in (self.velocity_mps, self._pending))
        left_s = (_LOOK_EVERY - self._step % _LOOK_EVERY) * PERIOD_S
        return PLANNER.plan(
            path_m, self.pose, self._covariance + np.diag(BIAS_STD**2), measured, discs, pending, left_s
        )  # fmt: skip

    def follow(self, path_m: FloatArray, speed_mps: float) -> None:
        """Drive for one period."""
        command = FOLLOWER.command(path_m, self.pose, speed_mps)
        x, y = Pose2(0, 0, self._turn).transform(command).tolist()
        before = self.place_m
        self.place_m, self.velocity_mps = drive(
            before, self.velocity_mps, self._pending, (x, y), LIMITS.acceleration_mps2, LIMITS.dead_time_s, PERIOD_S
        )
        self._pending = (x, y)
        moved = np.array(self.place_m) - before
        # odometry in the robot's frame, with slip along and across the way
        wrong = Pose2(0, 0, float(self._believed[2]) - self._turn).transform(
            (1 + self._slip[0]) * moved + self._slip[1] * np.array([-moved[1], moved[0]])
        )
        self._believed = self._believed + np.append(wrong, 0.0)
        self._since += wrong
        before_covariance, since = self._at_look, self._since
        xx, xy, yy = spread(before_covariance, (NOISE.along, NOISE.aside), (float(since[0]), float(since[1])))
        covariance = before_covariance.copy()
        covariance[:2, :2] = [[xx, xy], [xy, yy]]
        covariance[0, 2] = covariance[2, 0] = before_covariance[0, 2] - since[1] * before_covariance[2, 2]
        covariance[1, 2] = covariance[2, 1] = before_covariance[1, 2] + since[0] * before_covariance[2, 2]
        self._covariance = covariance
        self._step += 1

    @property
    def stands(self) -> bool:
        """Whether it is at rest, in truth."""
        return math.hypot(*self.velocity_mps) < _STANDS_MPS

    def touches(self, discs_m: FloatArray) -> bool:
        """Whether it touches one of the discs (M, 3: x, y, radius), in truth."""
        away = np.hypot(discs_m[:, 0] - self.place_m[0], discs_m[:, 1] - self.place_m[1])
        return bool((away < discs_m[:, 2] + RADIUS_M).any())

    def _draw_slip(self) -> FloatArray:
        return np.array([NOISE.along, NOISE.aside]) * self._law.draw(self._rng, 2)


LATEST_S = 60.0


@dataclass(frozen=True, eq=False)
class Slalom:
    """Opponents in pairs, as they stand and as the robot estimates them, and the path it has planned between them."""

    discs: FloatArray
    believed: tuple[Disc, ...]
    path_m: FloatArray


@dataclass(frozen=True)
class SlalomDrive:
    """How a drive went."""

    seconds: float
    collided: bool
    refused: bool
    # whether it stood still for want of a safe speed
    stopped: bool


def draw_slalom(widths_m: FloatArray, rng: np.random.Generator, errors: Errors = MATCHED) -> Slalom:
    """Draw a course through gaps of these widths, 1.2 to 1.8 m apart."""
    discs, believed, path = [], [], [(0.0, 0.0)]
    x = 0.0
    for width in widths_m:
        x, y = x + rng.uniform(1.2, 1.8), rng.uniform(-0.4, 0.4)
        pair = []
        for side in (-1, 1):
            place = np.array([x, y + side * (0.5 * width + RADIUS_M)])
            seen = place + DISC_STD_M * errors.obstacle.draw(rng, 2)
            discs.append((*place, RADIUS_M))
            pair.append(Disc(float(seen[0]), float(seen[1]), RADIUS_M, DISC_STD_M**2 * np.eye(2)))
        believed += pair
        middle = 0.5 * (pair[0].y_m + pair[1].y_m)
        path += [(x - 0.45, middle), (x + 0.45, middle)]
    path.append((x + 1.5, 0.0))
    return Slalom(np.array(discs), tuple(believed), np.array(path))


def drive_slalom(
    course: Slalom, constant_mps: float | None, rng: np.random.Generator, errors: Errors = MATCHED
) -> SlalomDrive:
    """Drive it, at a constant speed or as planned (None)."""
    robot, collided, stopped, missed_s, speed = UncertainRobot(rng, errors), False, False, 0.0, constant_mps or 0.0

    def ended(refused: bool) -> SlalomDrive:
        return SlalomDrive(robot.seconds, collided, refused, stopped)

    while robot.seconds < LATEST_S:
        if math.dist((robot.pose.x_m, robot.pose.y_m), course.path_m[-1]) < 0.05:
            return ended(False)
        robot.look()
        if constant_mps is None and robot.plans_now:
            plan = robot.plan(course.path_m, course.believed)
            speed, missed_s = plan.speed_mps, 0.0 if plan.safe else missed_s + PLAN_EVERY * PERIOD_S
            stopped |= not plan.safe and robot.stands
            if missed_s > PATIENCE_S:
                return ended(True)
        robot.follow(course.path_m, speed)
        collided |= robot.touches(course.discs)
    return ended(True)
