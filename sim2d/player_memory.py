"""What a player remembers between frames, as its steering and tactics need it: the ball, and who moves where."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.avoidance.moving_obstacles import MovingObstacle
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.tracking import Track

Point = tuple[float, float]

# a ball unseen for so long may be anywhere
_FORGOTTEN_S = 4.0
# share of a new velocity in the remembered one, and the longest gap over which one is worked out
_NEW_SHARE, _LONGEST_GAP_S = 0.4, 0.25
# faster than any ball: a wrong sighting
_FASTEST_MPS = 4.0


class BallMemory:
    """The ball as last seen, in the field frame."""

    def __init__(self) -> None:
        self._place: Point | None = None
        self._velocity: Point = (0.0, 0.0)
        self._seen_s = -math.inf

    def see(self, place: Point, t_s: float) -> None:
        """Take in a sighting (field frame, metres) of a time (seconds)."""
        gap_s = t_s - self._seen_s
        if self._place is not None and 0.0 < gap_s <= _LONGEST_GAP_S:
            moved = ((place[0] - self._place[0]) / gap_s, (place[1] - self._place[1]) / gap_s)
            if math.hypot(*moved) > _FASTEST_MPS:
                moved = (0.0, 0.0)
            x, y = self._velocity
            self._velocity = (x + _NEW_SHARE * (moved[0] - x), y + _NEW_SHARE * (moved[1] - y))
        else:
            self._velocity = (0.0, 0.0)
        self._place, self._seen_s = place, t_s

    def miss(self) -> None:
        """Take in that it is not where it was last seen."""
        self._place = None

    def place(self, t_s: float) -> Point | None:
        """Where it was last seen, field frame; None when that is too long ago."""
        return self._place if self.age_s(t_s) <= _FORGOTTEN_S else None

    @property
    def velocity_mps(self) -> Point:
        """Its velocity when last seen, field frame."""
        return self._velocity

    def age_s(self, t_s: float) -> float:
        """Seconds since it was seen."""
        return t_s - self._seen_s


def block_ball(free_space: FreeSpace, ball: Point, radius_m: float) -> FreeSpace:
    """Free space in which the ball (robot frame) is an obstacle too, for going round it."""
    away = math.hypot(*ball)
    if away <= radius_m:
        return free_space
    off = np.abs(np.remainder(free_space.bearing_rad - math.atan2(ball[1], ball[0]) + math.pi, math.tau) - math.pi)
    hidden = off <= math.asin(radius_m / away) + math.pi / len(free_space.bearing_rad)
    return FreeSpace(
        free_space.bearing_rad, np.where(hidden, np.minimum(free_space.range_m, away - radius_m), free_space.range_m)
    )


def moving_obstacle(track: Track, radius_m: float, robot: Pose2, age_s: float) -> MovingObstacle:
    """Return a track (field frame, of some seconds ago) as an obstacle around the robot now."""
    vx, vy = track.vx_mps, track.vy_mps
    x_m, y_m = robot.inverse().transform((track.x_m + age_s * vx, track.y_m + age_s * vy)).tolist()
    c, s = math.cos(robot.theta_rad), math.sin(robot.theta_rad)
    place, velocity = (
        math.sqrt(max(float(np.linalg.eigvalsh(part)[-1]), 0.0))
        for part in (track.covariance[:2, :2], track.covariance[2:, 2:])
    )
    return MovingObstacle(x_m, y_m, c * vx + s * vy, c * vy - s * vx, radius_m, place + age_s * velocity, velocity)


def is_in_sight(free_space: FreeSpace, place: Point) -> bool:
    """Whether nothing hides a place on the floor (robot frame)."""
    off = np.abs(np.remainder(free_space.bearing_rad - math.atan2(place[1], place[0]) + math.pi, math.tau) - math.pi)
    nearest = int(np.argmin(off))
    return bool(off[nearest] < math.radians(5) and free_space.range_m[nearest] >= math.hypot(*place))
