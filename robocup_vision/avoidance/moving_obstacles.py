"""Describes moving obstacles to steering, and fills the free ranges that they hide."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.avoidance.steering_settings import SteeringSettings
from robocup_vision.disc import Disc
from robocup_vision.kernels.motion.moving_contact import COLUMNS


def moving_table(
    moving: Sequence[Disc], robot_radius_m: float, settings: SteeringSettings = SteeringSettings()
) -> FloatArray:
    """Return what `moving_contact_time` takes, (M, 8) float64.

    Parameters
    ----------
    moving : sequence of Disc
        Moving obstacles.
    robot_radius_m : float
        Added to their own.
    settings : SteeringSettings, optional
        How many standard deviations are kept clear of, and how much of them at most.
    """
    sigmas = settings.obstacle_sigmas
    rows = [
        (
            o.x_m, o.y_m, o.vx_mps, o.vy_mps, o.radius_m + robot_radius_m,
            sigmas * o.std_m, sigmas * o.velocity_std_mps, settings.max_margin_m,
        )
        for o in moving
    ]  # fmt: skip
    return np.array(rows, dtype=np.float64).reshape(-1, COLUMNS)


def ranges_past(
    bearing_rad: FloatArray, range_m: FloatArray, moving: Sequence[Disc], margin_m: float = 0.05
) -> FloatArray:
    """Return free ranges (J,) without the returns of moving obstacles: there the smaller range beside each counts.

    Parameters
    ----------
    bearing_rad, range_m : (J,) float64
        Directions, ascending, and free ranges; robot frame.
    moving : sequence of Disc
        Moving obstacles.
    margin_m : float
        A range that ends so near to a disc's rim is one of its returns.
    """
    own = np.zeros(len(bearing_rad), dtype=bool)
    half = 0.5 * float(np.median(np.diff(bearing_rad)))
    for o in moving:
        distance, reach = math.hypot(o.x_m, o.y_m), o.radius_m + margin_m
        width = math.asin(min(reach / distance, 1.0)) if distance > 0 else math.pi
        off = np.abs(np.remainder(bearing_rad - math.atan2(o.y_m, o.x_m) + math.pi, math.tau) - math.pi)
        own |= (off <= width + half) & (np.abs(range_m - distance) <= reach)
    if not own.any() or own.all():
        return range_m
    past = range_m.copy()
    others = np.flatnonzero(~own)
    hidden = np.flatnonzero(own)
    after = np.searchsorted(others, hidden)
    past[hidden] = np.fmin(range_m[others[after - 1]], range_m[others[after % len(others)]])
    return past
