"""Filters the free floor over three frames, so that noise in one of them has no effect.

Steering remembers its detours, so a single wrong cell in its way would lead it astray.
"""

from __future__ import annotations

import math

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace


class SteadyFreeSpace:
    """The median of the last three frames' ranges, moved to the newest frame, less a margin; for mirror cameras.

    Parameters
    ----------
    margin_ratio : float
        Fraction of the range that is taken off: about the error of an edge by one pixel and by the delay of a period.
    """

    def __init__(self, margin_ratio: float = 0.02) -> None:
        if not 0.0 <= margin_ratio < 1.0:
            raise ArgumentError(f"margin_ratio must be from 0 to below 1, got {margin_ratio!r}")
        self._margin_ratio = margin_ratio
        self._last: tuple[FreeSpace, ...] = ()

    def update(self, free_space: FreeSpace, motion: Pose2) -> FreeSpace:
        """Update with a frame's free space; return the filtered one, which is the newest until there are three.

        Parameters
        ----------
        free_space : FreeSpace
            Of the newest frame; at the same bearings each time.
        motion : Pose2
            Motion since the frame before, in the robot's frame of then.
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
    """Return the free space from where the robot is now.

    Parameters
    ----------
    free_space : FreeSpace
        At evenly spaced bearings, all around or over a narrower view; what comes into that is not free.
    motion : Pose2
        Motion since its frame, in the robot's frame of then.
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
    # ends of each direction's floor at its middle and both sides, in the order of their bearings
    ends = (known[:, None] + (np.array([-half, 0.0, half]) - motion.theta_rad)).ravel()
    start, ranges = motion.inverse(), np.repeat(ranges, 3)
    ahead, left = ranges * np.cos(ends) + start.x_m, ranges * np.sin(ends) + start.y_m
    turned, away = np.arctan2(left, ahead), np.hypot(ahead, left)
    # a nearer obstacle hides a farther one; interpolation between the two would not
    if is_ring:
        # from one end before the first bearing to one beyond the last
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
