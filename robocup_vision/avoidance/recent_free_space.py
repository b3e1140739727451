"""Free space over several frames: filtered against noise, and kept from earlier views in other directions.

Steering remembers its detours, so that a single wrong cell would have lasting effects: `SteadyFreeSpace` takes the
median of three frames. A head may look at the ball while its robot drives elsewhere: `RecentFreeSpace` keeps the floor
seen before in the direction of motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.checks import as_positive
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace

# a range beyond any floor; it replaces infinity, which cannot be transformed
_FAR_M = 1e3


class SteadyFreeSpace:
    """The median of the last three frames' ranges, moved to the newest frame, less a margin; for mirror cameras.

    Parameters
    ----------
    margin_ratio : float
        Fraction by which ranges are reduced: about the error of an edge by one pixel and by the delay of a period.
    """

    def __init__(self, margin_ratio: float = 0.02) -> None:
        if not 0.0 <= margin_ratio < 1.0:
            raise ArgumentError(f"margin_ratio must be from 0 to below 1, got {margin_ratio!r}")
        self._margin_ratio = margin_ratio
        self._last: tuple[FreeSpace, ...] = ()

    def update(self, free_space: FreeSpace, motion: Pose2) -> FreeSpace:
        """Update with a frame's free space; return the filtered one, or the newest while there are fewer than three.

        Parameters
        ----------
        free_space : FreeSpace
            Free space of the newest frame, always at the same bearings.
        motion : Pose2
            Motion since the frame before, in the robot frame at that time.
        """
        carried = tuple(carry_free_space(before, motion) for before in self._last)
        self._last = (free_space, *carried[:1])
        middle = free_space.range_m
        if len(carried) == 2:
            middle = np.sort([middle, *(before.range_m for before in carried)], axis=0)[1]
        middle = (1 - self._margin_ratio) * middle
        middle.flags.writeable = False
        return FreeSpace(free_space.bearing_rad, middle)


def carry_free_space(free_space: FreeSpace, motion: Pose2) -> FreeSpace:
    """Return the free space seen from the robot's present pose.

    Parameters
    ----------
    free_space : FreeSpace
        At evenly spaced bearings, all around or over a narrower view, in which newly visible bearings get range 0.
    motion : Pose2
        Motion since its frame, in the robot frame at that time.
    """
    if math.hypot(motion.x_m, motion.y_m) < 1e-3 and abs(motion.theta_rad) < 1e-3:
        return free_space
    bearing, reach = free_space.bearing_rad, free_space.range_m
    finite = np.isfinite(reach)
    if not finite.any():
        return free_space
    known, ranges = (bearing, reach) if finite.all() else (bearing[finite], reach[finite])
    step = float(bearing[1] - bearing[0]) if len(bearing) > 1 else math.tau
    is_ring = abs(step * len(bearing) - math.tau) < 1e-6
    half = math.pi / len(bearing) if is_ring else step / 2
    # the floor's end in each direction, at the middle and both sides of its sector, in the order of their bearings
    ends = (known[:, None] + (np.array([-half, 0.0, half]) - motion.theta_rad)).ravel()
    start, ranges = motion.inverse(), np.repeat(ranges, 3)
    ahead, left = ranges * np.cos(ends) + start.x_m, ranges * np.sin(ends) + start.y_m
    turned, away = np.arctan2(left, ahead), np.hypot(ahead, left)
    # a nearer obstacle hides a farther one; interpolation between the two would not
    if is_ring:
        # append one point before the first bearing and one after the last, for interpolation over the seam
        around = bearing[0] + np.remainder(turned - bearing[0], math.tau)
        order = np.argsort(around, kind="stable")
        order = np.concatenate([order[-1:], order, order[:1]])
        around = around[order]
        around[0] -= math.tau
        around[-1] += math.tau
        seen = np.interp(bearing, around, away[order])
        index = np.rint((turned - bearing[0]) / (2 * half)).astype(int) % len(bearing)
    else:
        middle = float(bearing.mean())
        turned = middle + np.remainder(turned - middle + math.pi, math.tau) - math.pi
        order = np.argsort(turned, kind="stable")
        seen = np.interp(bearing, turned[order], away[order], left=0.0, right=0.0)
        index = np.rint((turned - bearing[0]) / step).astype(int)
        is_shown = (index >= 0) & (index < len(bearing))
        index, away = index[is_shown], away[is_shown]
    np.minimum.at(seen, index, away)
    seen.flags.writeable = False
    return FreeSpace(bearing, seen)


def floor_ends(bearing_rad: FloatArray, range_m: FloatArray) -> FloatArray:
    """Return the points (J, 2) where the floor ends in each direction, robot frame."""
    return np.stack([range_m * np.cos(bearing_rad), range_m * np.sin(bearing_rad)], axis=1)


_DIRECTIONS = 120  # directions of the free space around the robot: at 1 m a sector is 5 cm wide, less than a robot
# Floor that none of the last views shows counts as free up to this multiple of the robot's radius: the robot may start
# moving there, and sees it before it drives farther. With 0, a robot that turns would stop at each step.
_UNSEEN_RADII = 3.0
# older views are not used: others have moved by several robot widths, and odometry has drifted
_MAX_AGE_S = 2.0
_EVERY_S = 0.15  # of views closer in time than this only the newest is used, since they show the same floor


@dataclass(frozen=True, slots=True, eq=False)
class _OldView:
    t_s: float
    # (J, 2): where the floor ends, frame of the first view
    ends_m: FloatArray


class RecentFreeSpace:
    """Combines the free spaces of the last views; one object per robot.

    Each direction has the range by the newest view that shows it, moved to the robot's present pose. Ends of the floor
    in older views that are now within the robot's radius are ignored, since the robot stands there.

    Parameters
    ----------
    robot_radius_m : float
        Radius of the robot.

    Raises
    ------
    ArgumentError
        If the radius is not positive.
    """

    def __init__(self, robot_radius_m: float) -> None:
        self._radius_m = as_positive("robot_radius_m", robot_radius_m)
        width_rad = math.tau / _DIRECTIONS
        self._bearing_rad = read_only((np.arange(_DIRECTIONS) + 0.5) * width_rad - math.pi)
        self.forget()

    def forget(self) -> None:
        """Forget all views, because the robot was carried or its motion since is not known."""
        self._pose = Pose2(0.0, 0.0, 0.0)
        self._old: list[_OldView] = []
        self._newest: _OldView | None = None

    def update(self, free_space: FreeSpace, motion: Pose2, t_s: float) -> FreeSpace:
        """Update with a frame's free space; return the free space all around the robot.

        Parameters
        ----------
        free_space : FreeSpace
            Free space of the newest frame: bearings (J,) over the field of view, and ranges, robot frame.
        motion : Pose2
            Motion since the frame before, in the robot frame at that time.
        t_s : float
            Time of the newest frame, seconds.

        Returns
        -------
        FreeSpace
            At evenly spaced bearings all around.
        """
        self._pose = self._pose.compose(motion)
        newest = self._newest
        if newest is not None and (not self._old or newest.t_s - self._old[-1].t_s >= _EVERY_S):
            self._old.append(newest)
        self._old = [view for view in self._old if 0.0 <= t_s - view.t_s <= _MAX_AGE_S]
        ends = floor_ends(free_space.bearing_rad, np.minimum(free_space.range_m, _FAR_M))
        self._newest = _OldView(t_s, self._pose.transform(ends))
        range_m = self._ranges(free_space)
        range_m.flags.writeable = False
        return FreeSpace(self._bearing_rad, range_m)

    def _ranges(self, free_space: FreeSpace) -> FloatArray:
        """Return the range of each direction by the newest view that shows it."""
        bearing_rad, away_m = free_space.bearing_rad, free_space.range_m
        # age rank of the view of each floor end; 0: the newest
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
        count, unseen = _DIRECTIONS, len(self._old) + 1
        turn = (bearing_rad[known] + math.pi) * (count / math.tau)
        index = np.floor(turn).astype(np.int64) % count
        first = np.full(count, unseen)
        np.minimum.at(first, index, rank)
        is_newest = rank == first[index]
        out = np.full(count, np.inf)
        np.minimum.at(out, index[is_newest], away_m[is_newest])
        out[first == unseen] = _UNSEEN_RADII * self._radius_m
        return np.asarray(out)
