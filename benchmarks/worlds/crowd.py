"""A robot among others that move, and what its ranges show of them: the scene of tracking.py and moving_obstacles.py.

The world is that of the simulated matches (acceleration, dead time, slip, collisions). Ranges are simulated instead of
images: of each of 256 bearings the first body or wall, with noise, with things that are missed for some frames, that
show through in the middle, and with specks where nothing is; nothing is seen behind anything. Poses come from the truth
with an error that wanders, and its covariance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.pose_filter import PoseFilter
from robocup_vision.tracking import Detection, KnownFreeSpace, ReturnDetector
from robocup_vision.vision import Vision
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import CONTROL_PERIOD_S, Command, RobotLimits
from sim2d.sensors.match_camera import MatchCamera
from sim2d.world.world import World

BEARINGS = 256
# ranges: error common to a thing in a frame, and of each bearing; metres and fraction of the range
COMMON_STD, SINGLE_STD = (0.008, 0.015), (0.004, 0.008)
LONGEST_M = 2.5
# the same for the obstacles in a mirror camera's images, metres and fraction; farther away they are not used
CAMERA_STD, CAMERA_LONGEST_M = (0.01, 0.05), 1.3
# ratio of the frames in which a thing in view is missed, frames in a row, ratio in which its middle shows through
MISSED, MISSED_FRAMES, THROUGH = 0.12, 2.0, 0.05
# control periods from frame to frame of a film
EVERY = 2
# specks in a frame, all over the field
SPECKS = 0.6
# error of the pose: metres, radians, and seconds over which it changes
POSE_STD, POSE_TIME_S = (0.012, 0.012, 0.012), 0.5


class Sensor:
    """Ranges of one robot among so many others of a radius, and its estimated pose."""

    def __init__(self, field: Field, others: int, radius_m: float, period_s: float, rng: np.random.Generator) -> None:
        self._field, self._radius_m, self._rng = field, radius_m, rng
        self.bearing_rad: FloatArray = np.asarray((np.arange(BEARINGS) + 0.5) * (math.tau / BEARINGS) - math.pi)
        self.pose_covariance: FloatArray = np.diag(np.square(POSE_STD))
        self._missed = rng.random(others) < MISSED
        self._kept = math.exp(-period_s / POSE_TIME_S)
        self._offset = rng.standard_normal(3) * POSE_STD
        # the number of walls' edges each ray may meet is small: segments (S, 2, 2)
        self._walls = np.stack([field.floor_polygon, np.roll(field.floor_polygon, -1, axis=0)], axis=1)

    def estimated(self, pose: Pose2) -> Pose2:
        """Return the estimated pose in this frame."""
        fresh = math.sqrt(1 - self._kept**2)
        self._offset = self._kept * self._offset + fresh * self._rng.standard_normal(3) * POSE_STD
        return Pose2(*(pose.array + self._offset).tolist())

    def ranges(self, pose: Pose2, places_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Measured ranges (J,) from a pose with things at places (N, 2), and the true ratio of each in view (N,)."""
        rng = self._rng
        walls = wall_ranges(self._walls, pose, self.bearing_rad)
        bodies = disc_ranges(places_m, self._radius_m, pose, self.bearing_rad)
        first = np.minimum(bodies.min(axis=0), walls) if len(bodies) else walls
        in_view = (bodies <= first) & np.isfinite(bodies)
        ratio = in_view.sum(axis=1) / np.maximum(np.isfinite(bodies).sum(axis=1), 1)
        # a miss lasts for some frames
        again = 1 - 1 / MISSED_FRAMES
        begin = MISSED * (1 - again) / (1 - MISSED)
        self._missed = rng.random(len(places_m)) < np.where(self._missed, again, begin)
        seen = walls * (1 + 0.3 * COMMON_STD[1] * rng.standard_normal())
        order = np.argsort(-np.hypot(*(places_m - (pose.x_m, pose.y_m)).T)) if len(places_m) else ()
        for index in order:
            if self._missed[index]:
                continue
            ray = in_view[index].copy()
            if rng.random() < THROUGH:
                lit = np.flatnonzero(np.isfinite(bodies[index]))
                off = np.abs(
                    np.angle(np.exp(1j * (self.bearing_rad - np.angle(np.exp(1j * self.bearing_rad[lit]).sum()))))
                )
                ray &= off > off[lit].max() / 3
            common = rng.standard_normal() * (COMMON_STD[0] + COMMON_STD[1] * bodies[index].min())
            seen = np.where(ray, np.minimum(seen, np.where(ray, bodies[index], np.inf) + common), seen)
        for _ in range(int(rng.poisson(SPECKS))):
            half_x, half_y = self._field.length_m / 2, self._field.width_m / 2
            x, y = pose.inverse().transform(rng.uniform((-half_x, -half_y), (half_x, half_y))).tolist()
            at = round((math.atan2(y, x) + math.pi) / math.tau * BEARINGS - 0.5)
            wide = int(rng.integers(1, 5))
            hit = np.arange(at, at + wide) % BEARINGS
            seen[hit] = np.minimum(seen[hit], math.hypot(x, y))
        seen = seen + rng.standard_normal(BEARINGS) * (SINGLE_STD[0] + SINGLE_STD[1] * seen)
        return np.where(seen > LONGEST_M, np.inf, np.maximum(seen, 0.01)), ratio


def disc_ranges(places_m: FloatArray, radius_m: float, pose: Pose2, bearing_rad: FloatArray) -> FloatArray:
    """Range (N, J) at which each ray meets each disc; infinite where it does not."""
    x, y = pose.inverse().transform(places_m.reshape(-1, 2)).T[..., None]
    c, s = np.cos(bearing_rad), np.sin(bearing_rad)
    along, aside = x * c + y * s, y * c - x * s
    rest = radius_m**2 - aside**2
    meets = (rest > 0) & (along > 0)
    return np.where(meets, np.maximum(along - np.sqrt(np.maximum(rest, 0.0)), 0.0), np.inf)


def wall_ranges(walls_m: FloatArray, pose: Pose2, bearing_rad: FloatArray) -> FloatArray:
    """Range (J,) of the nearest of the walls (S, 2, 2)."""
    a, b = pose.inverse().transform(walls_m[:, 0]), pose.inverse().transform(walls_m[:, 1])
    ray = np.stack([np.cos(bearing_rad), np.sin(bearing_rad)])
    edge = b - a
    cross = edge[:, :1] * ray[1] - edge[:, 1:] * ray[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        away = (edge[:, 0] * a[:, 1] - edge[:, 1] * a[:, 0])[:, None] / cross
        along = (a[:, :1] * ray[1] - a[:, 1:] * ray[0]) / -cross
        meets = (away > 0) & (along >= 0) & (along <= 1)
    return np.asarray(np.where(meets, away, np.inf).min(axis=0))


@dataclass(frozen=True, eq=False)
class Frame:
    """What one frame shows, and the truth."""

    t_s: float  #: when
    robot: Pose2  #: where the robot takes itself to be
    robot_covariance: FloatArray  #: (3, 3) float64: of that
    truth: Pose2  #: where it is
    detections: tuple[Detection, ...]  #: returns inside the known free floor
    places_m: FloatArray  #: (N, 2) float64: the others
    #: (N,) bool: seen by ranges: those hardly hidden. By camera: those near enough to be counted.
    in_view: npt.NDArray[np.bool_]


class Wanderer:
    """Drives a robot from place to place, at a speed of its own that changes."""

    def __init__(self, field: Field, fastest_mps: float, rng: np.random.Generator) -> None:
        self._half: FloatArray = np.array([field.length_m / 2, field.width_m / 2]) - 0.12
        self._fastest_mps, self._rng = fastest_mps, rng
        self._choose()

    def _choose(self) -> None:
        self._goal = self._rng.uniform(-self._half, self._half)
        self._speed = self._rng.uniform(0.3, 1.0) * self._fastest_mps
        self._pause_s = 0.5 if self._rng.random() < 0.2 else 0.0

    def command(self, pose: Pose2, others_m: FloatArray) -> Command:
        """Return the velocity it aims at: towards its place, pushed off by those close before it."""
        here = np.array([pose.x_m, pose.y_m])
        way = self._goal - here
        if math.hypot(*way) < 0.08 or self._rng.random() < 0.3 * CONTROL_PERIOD_S:
            self._choose()
        if self._pause_s > 0:
            self._pause_s -= CONTROL_PERIOD_S
            return Command()
        wanted = way / max(math.hypot(*way), 1e-9) * min(self._speed, 2 * math.hypot(*way))
        for away in here - others_m:
            distance = math.hypot(*away)
            if distance < 0.3:
                wanted = wanted + away / distance * (0.3 - distance) * 3.0
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        return Command(float(c * wanted[0] + s * wanted[1]), float(c * wanted[1] - s * wanted[0]), 0.0)


def film(field: Field, seed: Sequence[int], others: int = 6) -> list[Frame]:
    """Return 10 s of a robot that drives among others, half as fast as they."""
    rng = np.random.default_rng(seed)
    limits = RobotLimits(speed_mps=1.0)
    sensor = Sensor(field, others, limits.radius_m, EVERY * CONTROL_PERIOD_S, rng)
    detector = ReturnDetector(KnownFreeSpace.of_field(field), limits.radius_m, longest_m=LONGEST_M)
    taken = []
    for period, world in enumerate(moves(field, limits, others, 150 * EVERY, rng)):
        if period % EVERY == 0:
            truth, places = _truth(world)
            range_m, in_view = sensor.ranges(truth, places)
            robot, covariance = sensor.estimated(truth), sensor.pose_covariance
            seen = detector.in_profile(sensor.bearing_rad, range_m, robot, covariance)
            taken.append(Frame(world.t_s, robot, covariance, truth, seen, places, in_view > 0.3))
    return taken


def camera_film(field: Field, seed: Sequence[int]) -> list[Frame]:
    """Return 6 s among four others through the images of a mirror camera: poses and obstacles are those of `Vision`.

    Counted are the others within `CAMERA_LONGEST_M`, hidden or not: what is farther away is a pixel or two.
    """
    rng = np.random.default_rng(seed)
    limits, camera = RobotLimits(speed_mps=0.8), sekimori_camera()
    eye, vision, belief = MatchCamera(field, camera, limits, rng), Vision(field, camera), PoseFilter()
    detector = ReturnDetector(
        KnownFreeSpace.of_field(field), limits.radius_m, range_std=CAMERA_STD, longest_m=CAMERA_LONGEST_M
    )
    taken = []
    for period, world in enumerate(moves(field, limits, 4, 90 * EVERY, rng)):
        belief.predict(world.odometry(0), world.t_s)
        if period % EVERY == 0:
            truth, places = _truth(world)
            view = vision.look(eye.render(world.state, 0), world.t_s, prior=belief.prior(world.t_s))
            belief.update(view.pose, world.t_s)
            known = belief.belief
            if known:
                seen = detector.in_obstacles(view.obstacles, known.pose, known.covariance)
                near = np.hypot(*(places - (truth.x_m, truth.y_m)).T) < CAMERA_LONGEST_M
                taken.append(Frame(world.t_s, known.pose, known.covariance, truth, seen, places, near))
    return taken


def moves(field: Field, limits: RobotLimits, others: int, periods: int, rng: np.random.Generator) -> Iterator[World]:
    """Go through a world in which a robot and others wander, before every step of it."""
    starts: list[Pose2] = []
    half = np.array([field.length_m / 2, field.width_m / 2]) - 0.12
    while len(starts) <= others:
        x, y = rng.uniform(-half, half).tolist()
        if all(math.hypot(x - p.x_m, y - p.y_m) > 0.25 for p in starts):
            starts.append(Pose2(x, y, float(rng.uniform(-math.pi, math.pi))))
    world = World.course(field, (), starts, limits, rng)
    drivers = [Wanderer(field, limits.speed_mps * (0.5 if k == 0 else 1.0), rng) for k in range(others + 1)]
    for _ in range(periods):
        yield world
        poses = [r.pose for r in world.state.robots]
        places = np.array([[p.x_m, p.y_m] for p in poses])
        world.step({k: d.command(poses[k], np.delete(places, k, axis=0)) for k, d in enumerate(drivers)})


def _truth(world: World) -> tuple[Pose2, FloatArray]:
    """Return the robot's pose, and places (N, 2) of the others."""
    own, *rest = world.state.robots
    return own.pose, np.array([[r.pose.x_m, r.pose.y_m] for r in rest])
