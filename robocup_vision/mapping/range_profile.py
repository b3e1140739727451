"""A range profile: the range to the first obstacle in every direction, of any sensor; the input of the map."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import BoolArray, FloatArray, read_only
from robocup_vision.kernels.floor import free_floor
from robocup_vision.view import View

# factor on the smallest spacing of bearings above which a gap between them belongs to no cone
_GAP = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class RangeProfile:
    """Ranges all around, or over the sensor's field of view.

    Raises
    ------
    ArgumentError
        If the sizes differ, bearings do not ascend within one turn, or a range or depth is negative.
    """

    #: (J,) float64: bearings in the robot frame, ascending within one turn. Each stands for a cone that extends halfway
    #: to its neighbours, but not into a wide gap.
    bearing_rad: FloatArray
    #: (J,) float64: free distance from the robot's centre, metres; NaN where the sensor measures nothing
    range_m: FloatArray
    hit: BoolArray  #: (J,) bool: whether an obstacle is at the range; otherwise the floor beyond is unknown
    depth_m: FloatArray | float = 0.0  #: (J,) float64 or float: the obstacle is between range and range + depth

    def __post_init__(self) -> None:
        bearing, range_m = read_only(self.bearing_rad), read_only(self.range_m)
        hit = np.array(self.hit, dtype=np.bool_)
        hit.flags.writeable = False
        if bearing.ndim != 1 or not len(bearing):
            raise ArgumentError(f"bearing_rad must be (J,) with at least one bearing, got shape {bearing.shape}")
        if range_m.shape != bearing.shape or hit.shape != bearing.shape:
            raise ArgumentError(
                f"bearing_rad, range_m and hit must be as long as each other, got {bearing.shape}, {range_m.shape} and "
                f"{hit.shape}"
            )
        if not np.isfinite(bearing).all() or not (np.diff(bearing) > 0).all() or bearing[-1] - bearing[0] >= math.tau:
            raise ArgumentError("bearing_rad must be finite and ascend within one turn")
        depth = np.asarray(self.depth_m, dtype=np.float64)
        if depth.shape not in ((), bearing.shape):
            raise ArgumentError(f"depth_m must be a number or as long as the bearings, got shape {depth.shape}")
        if (range_m < 0).any() or not (depth >= 0).all():
            raise ArgumentError("ranges and depths must not be negative, and depths be numbers")
        for name, value in (("bearing_rad", bearing), ("range_m", range_m), ("hit", hit)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "depth_m", read_only(np.broadcast_to(depth, bearing.shape)))


def cones(bearing_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return lower and upper edges (J,) of bearings' cones, radians: halfway to the neighbours, but not into a gap."""
    ahead = np.append(np.diff(bearing_rad), bearing_rad[0] + math.tau - bearing_rad[-1])
    least = float(ahead.min())
    half = 0.5 * np.where(ahead <= _GAP * least, ahead, least)
    return bearing_rad - np.roll(half, 1), bearing_rad + half


def floor_profile(view: View) -> RangeProfile:
    """Return the range in each direction at which the floor's colour ends; a ball ends it, too.

    Parameters
    ----------
    view : View
        View of a frame, preferably by a `Vision` whose directions are no farther apart than a map cell at the greatest
        range.

    Raises
    ------
    ArgumentError
        If the view shows no floor.

    Notes
    -----
    A ball does not end `view.free_space`, because a robot may drive to it. The obstacle is in the first ring that is
    not free.
    """
    grid = view.grid
    if grid is None:
        raise ArgumentError("the view shows no floor, so it has no range profile")
    bounds = grid.ring_bounds_m
    passable = np.where(view.marks == free_floor.BALL, free_floor.BLOCKED, view.marks).astype(np.uint8)
    range_m = grid.measure(passable).range_m
    ring = np.searchsorted(bounds, range_m)
    hit = ring < len(bounds) - 1
    depth = np.where(hit, bounds[np.minimum(ring + 1, len(bounds) - 1)] - range_m, 0.0)
    return RangeProfile(grid.bearing_rad, range_m, hit, depth)
