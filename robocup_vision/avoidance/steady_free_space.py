"""Free floor over three frames: what noise blocks in one of them, or opens, does not count.

Steering remembers its detours, so a single speck in its way would lead it off.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace

# a pixel, to which an edge is seen, and a period's lag are some such share of the range
_DOUBT_SHARE = 0.02


class SteadyFreeSpace:
    """The middle of the last three frames' ranges, carried to the newest, less what is in doubt.

    For a camera that sees all around.
    """

    def __init__(self) -> None:
        self._last: tuple[FreeSpace, ...] = ()

    def update(self, free_space: FreeSpace, motion: Pose2) -> FreeSpace:
        """Take in a frame's free space, and return the steady one: the newest alone until there are three.

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
        middle = (1 - _DOUBT_SHARE) * middle
        middle.flags.writeable = False
        return FreeSpace(free_space.bearing_rad, middle)


def carry_free_space(free_space: FreeSpace, motion: Pose2) -> FreeSpace:
    """Free space as seen from where the robot is by now.

    Parameters
    ----------
    free_space : FreeSpace
        All around, at evenly spaced bearings.
    motion : Pose2
        Motion since it was seen, in the robot's frame of then.
    """
    if math.hypot(motion.x_m, motion.y_m) < 1e-3 and abs(motion.theta_rad) < 1e-3:
        return free_space
    bearing, reach = free_space.bearing_rad, free_space.range_m
    finite = np.isfinite(reach)
    if not finite.any():
        return free_space
    half = math.pi / len(bearing)
    ends = np.concatenate([_ends(bearing[finite] + turn, reach[finite]) for turn in (-half, 0.0, half)])
    moved = motion.inverse().transform(ends)
    turned, away = np.arctan2(moved[:, 1], moved[:, 0]), np.hypot(moved[:, 0], moved[:, 1])
    order = np.argsort(turned)
    seen = np.interp(bearing, turned[order], away[order], period=math.tau)
    # what lies before something else hides it; a mean between the two would not
    index = np.rint((turned - bearing[0]) / (2 * half)).astype(int) % len(bearing)
    np.minimum.at(seen, index, away)
    seen.flags.writeable = False
    return FreeSpace(bearing, seen)


def _ends(bearing_rad: FloatArray, range_m: FloatArray) -> FloatArray:
    return np.stack([range_m * np.cos(bearing_rad), range_m * np.sin(bearing_rad)], axis=1)
