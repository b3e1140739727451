"""Free floor all around a robot whose camera sees a part of it at a time, from the views of the last moments.

A head looks at the ball while its robot drives elsewhere. By the newest view alone the robot could drive only where it
looks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arguments import as_number
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.avoidance.steady_free_space import floor_ends
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace

# no floor reaches so far; what is not finite cannot be moved
_FAR_M = 1e3


@dataclass(frozen=True, slots=True)
class RecentFreeSpaceSettings:
    """Settings of `RecentFreeSpace`.

    Parameters
    ----------
    directions : int
        Of the free space around the robot: at 1 m a sector is 5 cm wide, less than a robot.
    unseen_radii : float
        Floor that none of the last views shows is taken for free up to so many robot radii from the robot's centre: it
        may step there, and looks before it goes on. With none, a robot that turns stops with each step.
    max_age_s : float
        Older views do not count: others have moved on by some robot widths, and odometry has slipped.
    every_s : float
        Views nearer together than this show the same floor: only the newest of them is used.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    directions: int = 120
    unseen_radii: float = 3.0
    max_age_s: float = 2.0
    every_s: float = 0.15

    def __post_init__(self) -> None:
        if self.directions < 3:
            raise ArgumentError(f"directions must be at least 3, got {self.directions!r}")
        for name in ("unseen_radii", "max_age_s", "every_s"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)!r}")


@dataclass(frozen=True, slots=True, eq=False)
class _OldView:
    t_s: float
    # (J, 2): where the floor ends, frame of the first view
    ends_m: FloatArray


class RecentFreeSpace:
    """Joins the free spaces of the last views; one object a robot.

    Each direction is that of the newest view that shows it, moved to where the robot is now. What an older view shows
    within the robot's radius is left out: the robot stands there.

    Parameters
    ----------
    robot_radius_m : float
        Of the robot.
    settings : RecentFreeSpaceSettings, optional
        See there.

    Raises
    ------
    ArgumentError
        If the radius is not positive.
    """

    def __init__(self, robot_radius_m: float, settings: RecentFreeSpaceSettings = RecentFreeSpaceSettings()) -> None:
        self._radius_m = as_number("robot_radius_m", robot_radius_m)
        if not self._radius_m > 0.0:
            raise ArgumentError(f"robot_radius_m must be positive, got {robot_radius_m!r}")
        self._settings = settings
        width_rad = math.tau / settings.directions
        self._bearing_rad = read_only((np.arange(settings.directions) + 0.5) * width_rad - math.pi)
        self.forget()

    def forget(self) -> None:
        """Forget all views: the robot was carried, or its motion since them is not known."""
        self._pose = Pose2(0.0, 0.0, 0.0)
        self._old: list[_OldView] = []
        self._newest: _OldView | None = None

    def update(self, free_space: FreeSpace, motion: Pose2, t_s: float) -> FreeSpace:
        """Update with a frame's free space; return that all around the robot.

        Parameters
        ----------
        free_space : FreeSpace
            Of the newest frame: bearings (J,) over what is in view, and ranges, robot frame.
        motion : Pose2
            Motion since the frame before, in the robot's frame of then.
        t_s : float
            When the newest frame was taken, seconds.

        Returns
        -------
        FreeSpace
            At evenly spaced bearings all around.
        """
        settings = self._settings
        self._pose = self._pose.compose(motion)
        newest = self._newest
        if newest is not None and (not self._old or newest.t_s - self._old[-1].t_s >= settings.every_s):
            self._old.append(newest)
        self._old = [view for view in self._old if 0.0 <= t_s - view.t_s <= settings.max_age_s]
        ends = floor_ends(free_space.bearing_rad, np.minimum(free_space.range_m, _FAR_M))
        self._newest = _OldView(t_s, self._pose.transform(ends))
        range_m = self._ranges(free_space)
        range_m.flags.writeable = False
        return FreeSpace(self._bearing_rad, range_m)

    def _ranges(self, free_space: FreeSpace) -> FloatArray:
        """Return the range of each direction, newest view first."""
        bearing_rad, away_m = free_space.bearing_rad, free_space.range_m
        # 0: the newest
        rank = np.zeros(len(away_m), dtype=np.int64)
        if self._old:
            newest_first = self._old[::-1]
            place = self._pose.inverse().transform(np.concatenate([view.ends_m for view in newest_first]))
            far_m = np.hypot(place[:, 0], place[:, 1])
            far_m[far_m < self._radius_m] = np.nan
            away_m = np.concatenate((away_m, far_m))
            bearing_rad = np.concatenate((bearing_rad, np.arctan2(place[:, 1], place[:, 0])))
            older = np.repeat(np.arange(1, len(self._old) + 1), [len(view.ends_m) for view in newest_first])
            rank = np.concatenate((rank, older))
        known = ~np.isnan(away_m)
        rank, away_m = rank[known], away_m[known]
        count, unseen = self._settings.directions, len(self._old) + 1
        turn = (bearing_rad[known] + math.pi) * (count / math.tau)
        index = np.floor(turn).astype(np.int64) % count
        first = np.full(count, unseen)
        np.minimum.at(first, index, rank)
        is_newest = rank == first[index]
        out = np.full(count, np.inf)
        np.minimum.at(out, index[is_newest], away_m[is_newest])
        out[first == unseen] = self._settings.unseen_radii * self._radius_m
        return np.asarray(out)
