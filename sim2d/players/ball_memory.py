"""What a player remembers between frames: where the ball was last seen or who has it, and the floor of a late frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robocup_vision.belief import Track
from robocup_vision.perception.free_space import FreeSpace

Point = tuple[float, float]

# a ball so near to another robot's middle, in reaches, is its
TAKEN_REACHES = 2.0
# a ball unseen for so long may be anywhere
FORGOTTEN_S = 4.0
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

    def update(self, place: Point, t_s: float) -> None:
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
        return self._place if self.age_s(t_s) <= FORGOTTEN_S else None

    @property
    def velocity_mps(self) -> Point:
        """Its velocity when last seen, field frame."""
        return self._velocity

    def age_s(self, t_s: float) -> float:
        """Seconds since it was seen."""
        return t_s - self._seen_s


class HiddenBall:
    """The ball behind whoever had it when it was last seen, in the field frame.

    Parameters
    ----------
    reach_m : float
        From a robot's middle to a ball that it touches.
    """

    def __init__(self, reach_m: float) -> None:
        self._reach_m = reach_m
        self._carrier: int | None = None

    def update(self, ball: Point, tracks: Sequence[Track], age_s: float) -> None:
        """Take in where the ball is seen, and who is followed, as of `age_s` ago."""
        away = {track.number: math.dist(track.place_after(age_s), ball) for track in tracks}
        nearest = min(away, key=away.__getitem__, default=None)
        is_taken = nearest is not None and away[nearest] < TAKEN_REACHES * self._reach_m
        self._carrier = nearest if is_taken else None

    def place(self, robot: Point, tracks: Sequence[Track], age_s: float) -> tuple[Point, Point] | None:
        """Where the ball is, out of the robot's sight, and its velocity; None if nobody is known to have it."""
        track = next((track for track in tracks if track.number == self._carrier), None)
        if track is None:
            return None
        x, y = track.place_after(age_s)
        share = self._reach_m / max(math.dist((x, y), robot), self._reach_m)
        return (x + share * (x - robot[0]), y + share * (y - robot[1])), (track.vx_mps, track.vy_mps)


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


def is_in_sight(free_space: FreeSpace, place: Point) -> bool:
    """Whether nothing hides a place on the floor (robot frame)."""
    off = np.abs(np.remainder(free_space.bearing_rad - math.atan2(place[1], place[0]) + math.pi, math.tau) - math.pi)
    nearest = int(np.argmin(off))
    return bool(off[nearest] < math.radians(5) and free_space.range_m[nearest] >= math.hypot(*place))
