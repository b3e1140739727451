"""What the tests of the steering kernels share: grown profiles, and plain NumPy twins."""

import math

import numpy as np

from robocup_vision.avoidance.steering import profile_edges
from robocup_vision.kernels.mapping import grown_profile as kernels

RADIUS = 0.09
BINS = kernels.BINS
EDGES = profile_edges(BINS)


def around(count):
    return np.arange(count) * math.tau / count


def sectors_of(count):
    """Return sectors yet to be measured."""
    return kernels.Sectors(np.empty((count, 4)), np.empty((count, 4), dtype=np.int64))


def empty_profile():
    """Return a profile yet to be grown."""
    return kernels.Profile(EDGES, np.empty(BINS), np.empty(kernels.FINE), np.empty(kernels.COARSE))


def grown(range_m, bearing_rad=None):
    """Return the profile and the smallest range in it."""
    range_m = np.asarray(range_m, dtype=float)
    bearing_rad = around(range_m.shape[0]) if bearing_rad is None else bearing_rad
    sectors, profile = sectors_of(range_m.shape[0]), empty_profile()
    assert kernels.measure_sectors(bearing_rad, sectors)
    return profile, kernels.grow_profile(range_m, sectors, RADIUS, profile)


def with_minima(profile):
    """Return a profile of these ranges (BINS,), and the smallest range in it."""
    lows = [profile.reshape(groups, -1).min(axis=1) for groups in (kernels.FINE, kernels.COARSE)]
    around = (np.minimum(np.minimum(low, np.roll(low, 1)), np.roll(low, -1)) for low in lows)
    return kernels.Profile(EDGES, profile, *around), profile.min()


def plain_bin(x, y):
    """Bin of the directions (x, y): the diamond angle from the bearing by trigonometry."""
    quadrant, angle = np.divmod(np.arctan2(y, x) % math.tau, math.pi / 2)
    along = np.sin(angle) / (np.sin(angle) + np.cos(angle))
    return np.floor((quadrant + along) * BINS / 4).astype(int) % BINS


def plain_positions(start, velocity, target, acceleration, times):
    """Positions (N, 2) at the times (N,): eq. 12 by the mean velocity while it changes, and its target after that."""
    velocity, target = np.array(velocity), np.array(target)
    settle = np.hypot(*(target - velocity)) / acceleration
    changing = np.clip(times, 0.0, settle)
    reached = velocity + (target - velocity) * (changing / settle if settle > 0 else np.ones_like(times))[:, None]
    out = np.array(start) + changing[:, None] * 0.5 * (velocity + reached)
    return out + np.maximum(times - settle, 0.0)[:, None] * target
