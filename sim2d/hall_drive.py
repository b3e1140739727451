"""Drives a robot through a hall with only a landmark map; each frame is rendered at its true pose.

Section 4.3.3 of Ogawa et al. (2011): omnidirectional wheels, no odometry, 0.15 m/s.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.kernels.motion.path_following import nearest_on_path
from robocup_vision.landmarks.vision import LandmarkVision
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.planning.speed.speed_planner import PathFollower
from sim2d.rendering.hall.bustle import Bustle
from sim2d.rendering.hall.hall import Hall, HallCamera
from sim2d.rendering.sensor import Sensor

SPEED_MPS = 0.15
PERIOD_S = 0.4
# largest relative error of the wheels and of their direction during a drive, and relative noise in each period
_SLIP, _SKEW_RAD, _JITTER = 0.05, 0.04, 0.15
_TURN_PER_S, _MAX_TURN_RPS = 1.2, 0.5
_ARRIVED_M = 0.03
_AHEAD_M = 0.25


@dataclass(frozen=True, slots=True)
class DriveStep:
    """One period of a drive."""

    #: Time of the frame.
    t_s: float
    #: True pose of the robot.
    truth: Pose2
    #: Estimated pose of the robot.
    pose: PoseEstimate | NotLocated
    #: Distance of its true place from the path.
    off_path_m: float


def drive(
    vision: LandmarkVision,
    hall: Hall,
    bustle: Bustle,
    path: Sequence[Pose2],
    start: Pose2,
    sensor: Sensor,
    rng: np.random.Generator,
    *,
    supersample: int = 2,
    limit_s: float = 120.0,
) -> Iterator[DriveStep]:
    """Drive along a path until the robot believes that it is at the end, or the time is up.

    Parameters
    ----------
    vision : LandmarkVision
        The robot's only means of localisation. While it is not located, the robot stands still.
    path : sequence of Pose2
        The places to pass, with the direction to look at each; the first is the prior of the start.
    start : Pose2
        True pose at the start.
    """
    renderer = HallCamera(vision.camera, supersample)
    follower = PathFollower(MotionLimits(SPEED_MPS, 0.5), ahead_m=_AHEAD_M)
    places = np.array([pose.array[:2] for pose in path])
    slip, skew = 1 + _SLIP * rng.uniform(-1, 1), _SKEW_RAD * rng.uniform(-1, 1)
    truth, prior = start, path[0]
    for step in range(math.ceil(limit_s / PERIOD_S)):
        t_s = step * PERIOD_S
        light = renderer.render(hall, truth, bustle.light_at(t_s), bustle.panels(t_s, truth))
        frame = sensor.expose(light, rng)
        pose = vision.look(frame, t_s, prior=prior if step == 0 else None).pose
        yield DriveStep(t_s, truth, pose, nearest_on_path(places, (truth.x_m, truth.y_m))[1])
        if isinstance(pose, NotLocated):
            continue
        here = pose.pose
        if math.hypot(here.x_m - path[-1].x_m, here.y_m - path[-1].y_m) < _ARRIVED_M:
            return
        ahead = follower.command(places, here, SPEED_MPS)
        nearest = int(np.argmin(np.hypot(*(places - here.array[:2]).T)))
        off_rad = wrap_angle(path[nearest].theta_rad - here.theta_rad)
        turn_rps = min(max(_TURN_PER_S * off_rad, -_MAX_TURN_RPS), _MAX_TURN_RPS)
        moved = Pose2(0.0, 0.0, skew).transform(ahead * slip * (1 + _JITTER * rng.standard_normal(2))) * PERIOD_S
        turned = turn_rps * slip * (1 + _JITTER * rng.standard_normal()) * PERIOD_S
        truth = truth.compose(Pose2(float(moved[0]), float(moved[1]), float(turned)))
