"""Whether red and blue are swapped in a frame: by the colours of points on two goals of different colours.

Red and blue swapped turn yellow into cyan and blue into orange. The light changes these colours, too. White tells the
light, but in hard shadows and close to a goal it is estimated badly; so the light is fitted, near to white's or to
none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class SwappedChannelsSettings:
    """When goals show that red and blue are swapped; lengths are in logarithms of R/G and B/G.

    Parameters
    ----------
    min_distance : float
        Channels are judged where every goal's colour is so far from each goal's with red and blue swapped: paint is not
        known better. Yellow and cyan are each other's.
    min_ratio : float
        Votes for the goals' own colours, of those for swapped ones, that settle it without a fit.
    reach : float
        A point so far from its goal's colour does not support it.
    white_std, light_std : float
        Standard deviations of the light: about white, where white may be that, and about neutral.
    max_neutral : float
        White of a stronger cast may be some paint: votes that go by it settle nothing.
    max_light : float
        A white of a stronger cast is some paint.
    light_points : float
        So many points weigh as much as one unit of log-likelihood of the light: points on one wall are not independent.
    """

    min_distance: float = 0.5
    min_ratio: float = 3.0
    reach: float = 0.6
    white_std: float = 0.2
    light_std: float = 0.3
    max_neutral: float = 0.5
    max_light: float = math.log(2.0)
    light_points: float = 4.0


def are_swapped(
    log_ratios: FloatArray,
    is_positive: BoolArray,
    palette: FloatArray,
    settings: SwappedChannelsSettings = SwappedChannelsSettings(),
) -> bool:
    """Return whether the points fit goals whose red and blue are swapped better than the goals' own colours.

    Parameters
    ----------
    log_ratios : (N, 2) float64
        Logarithms of R/G and B/G of points on the goals.
    is_positive : (N,) bool
        Which goal each is on, up to a half turn.
    palette : (5, 2) float64
        `Colors.goal_log_ratios`.
    settings : SwappedChannelsSettings, optional
        Distances.
    """
    white, paints = palette[4], palette[:4] - palette[4]
    own, swapped = (
        max(
            _support(log_ratios - np.where(is_positive[:, None], first, second), white, settings)
            for first, second in ((pair[0], pair[1]), (pair[1], pair[0]))
        )
        for pair in (paints[:2], paints[2:])
    )
    return swapped > own


def _support(lights: FloatArray, white: FloatArray, settings: SwappedChannelsSettings) -> float:
    """Return how many points agree under one light, less what that light costs, for the best light.

    Parameters
    ----------
    lights : (N, 2) float64
        The light under which each point would have its goal's colour.
    white : (2,) float64
        The light by white.
    settings : SwappedChannelsSettings
        Distances.
    """
    tried = np.vstack([np.zeros(2), white, lights])
    cost = (tried**2).sum(axis=1) / settings.light_std**2
    if float(np.abs(white).max()) < settings.max_light:
        cost = np.minimum(cost, ((tried - white) ** 2).sum(axis=1) / settings.white_std**2)
    away2 = ((lights[None] - tried[:, None]) ** 2).sum(axis=2)
    agree = np.maximum(0.0, 1.0 - away2 / settings.reach**2).sum(axis=1)
    return float((agree - 0.5 * settings.light_points * cost).max())
