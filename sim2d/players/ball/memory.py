"""What a player remembers of the ball between frames: where it was seen, how it rolled, which robot has it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.tracking import Track

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class BallMemorySettings:
    """Values of `BallMemory` and `HiddenBall`."""

    #: A ball unseen for so long may be anywhere: a kicked one crosses a field in this time.
    forget_s: float = 4.0
    #: Weight of a new velocity against the remembered one: smooths the error of two positions a frame apart.
    velocity_gain: float = 0.4
    #: Longest time between two positions of which a velocity is made: after more the ball may have turned.
    max_gap_s: float = 0.25
    #: A faster ball is a wrong detection.
    max_speed_mps: float = 4.0
    #: A ball unseen for so long at a visible place is gone from there.
    missed_s: float = 0.5
    #: A ball that others told of is not there if the robot sees the floor there from no farther than this: small
    #: cameras miss balls that are far.
    told_missed_m: float = 1.0
    #: A ball unseen for so long is hidden by the robot that held it.
    hidden_s: float = 0.15
    #: A ball nearer than this to another robot's centre, in reaches (robot radius plus ball radius), is held by it.
    taken_reaches: float = 2.0


class BallMemory:
    """The ball as last seen, in the field frame."""

    def __init__(self, settings: BallMemorySettings = BallMemorySettings()) -> None:
        self.settings = settings
        self._place: Point | None = None
        self._velocity: Point = (0.0, 0.0)
        self._seen_s = -math.inf

    def update(self, place: Point, t_s: float, velocity_mps: Point | None = None) -> None:
        """Update with a position (field frame, metres) at a time (seconds).

        Parameters
        ----------
        velocity_mps : (float, float), optional
            Its velocity, where that is known; else it is computed from positions.
        """
        settings = self.settings
        gap_s = t_s - self._seen_s
        if velocity_mps is not None:
            self._velocity = velocity_mps
        elif self._place is not None and 0.0 < gap_s <= settings.max_gap_s:
            moved = ((place[0] - self._place[0]) / gap_s, (place[1] - self._place[1]) / gap_s)
            if math.hypot(*moved) > settings.max_speed_mps:
                moved = (0.0, 0.0)
            (x, y), gain = self._velocity, settings.velocity_gain
            self._velocity = (x + gain * (moved[0] - x), y + gain * (moved[1] - y))
        else:
            self._velocity = (0.0, 0.0)
        self._place, self._seen_s = place, t_s

    def miss(self) -> None:
        """Update with the fact that it is not where it was last seen."""
        self._place = None

    def place(self, t_s: float) -> Point | None:
        """Where it was last seen, field frame; None when that is too long ago."""
        return self._place if self.age_s(t_s) <= self.settings.forget_s else None

    @property
    def velocity_mps(self) -> Point:
        """Its velocity when last seen, field frame."""
        return self._velocity

    def age_s(self, t_s: float) -> float:
        """Seconds since it was seen."""
        return t_s - self._seen_s


class HiddenBall:
    """The ball behind the robot that held it when it was last seen, in the field frame.

    Parameters
    ----------
    reach_m : float
        From a robot's centre to the centre of a ball that it touches.
    """

    def __init__(self, reach_m: float, settings: BallMemorySettings = BallMemorySettings()) -> None:
        self._reach_m, self._settings = reach_m, settings
        self._carrier: int | None = None

    def update(self, ball: Point, tracks: Sequence[Track], age_s: float) -> None:
        """Update with where the ball is seen, and the robots that are tracked, as of `age_s` ago."""
        away = {track.number: math.dist(track.place_after(age_s), ball) for track in tracks}
        nearest = min(away, key=away.__getitem__, default=None)
        is_taken = nearest is not None and away[nearest] < self._settings.taken_reaches * self._reach_m
        self._carrier = nearest if is_taken else None

    def place(self, robot: Point, tracks: Sequence[Track], age_s: float) -> tuple[Point, Point] | None:
        """Return where the ball is, hidden from the robot, and its velocity; None if no known robot holds it."""
        track = next((track for track in tracks if track.number == self._carrier), None)
        if track is None:
            return None
        x, y = track.place_after(age_s)
        part = self._reach_m / max(math.dist((x, y), robot), self._reach_m)
        return (x + part * (x - robot[0]), y + part * (y - robot[1])), (track.vx_mps, track.vy_mps)


def block_ball(free_space: FreeSpace, ball: Point, radius_m: float) -> FreeSpace:
    """Return free space in which the ball (robot frame) is an obstacle too, so that steering goes round it."""
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
