"""Test whether red and blue are swapped in a frame, by the colours of points on two goals of different colours.

Swapped red and blue turn yellow into cyan and blue into orange, but the light changes these colours, too. White, which
shows the light, is unreliable in hard shadows and close to a goal, so the light is fitted with priors at white and at
neutral.
"""

from __future__ import annotations

import math

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array

SWAPPED_BY_GOALS = (
    "the goals look as with red and blue swapped: Vision takes RGB frames with channels='rgb', BGR ones with 'bgr'"
)

# one grey level for each of nine pixels, to avoid the logarithm of zero
_DARKEST = 9
# least distance of every goal's colour from each goal's with red and blue swapped, given the accuracy of paints;
# yellow and cyan are each other's
MIN_DISTANCE = 0.5
MIN_RATIO = 3.0  # ratio of votes for the goals' own colours to those for swapped ones that decides without a fit
_REACH = 0.6  # distance from a goal's colour beyond which a point does not support it
# standard deviations of the light: about white, if its cast is possible, and about neutral
_WHITE_STD = 0.2
_LIGHT_STD = 0.3
# cast of the white reference beyond which votes do not decide, because it may be another paint
MAX_NEUTRAL = 0.5
_MAX_LIGHT = math.log(2.0)  # cast of the white reference beyond which it is another paint
# number of points for one unit of log-likelihood, because points on one wall are not independent
_LIGHT_POINTS = 4.0


def goal_points(field: Field) -> tuple[FloatArray, FloatArray]:
    """Return points (N, 3) float64 on the goals' panels, field frame, metres, and the side (N,) of each one's goal."""
    points, sides = [], []
    for goal in field.goals:
        for x0, y0, x1, y1 in goal.panels.tolist():
            for along in (0.15, 0.4, 0.6, 0.85):
                for up in (0.4, 0.8):
                    points.append([x0 + along * (x1 - x0), y0 + along * (y1 - y0), up * goal.height_m])
                    sides.append(float(goal.side))
    return np.array(points).reshape(-1, 3), np.array(sides)


def log_ratios_at(frame: UInt8Array, pixels: FloatArray, shown: BoolArray) -> FloatArray:
    """Return mean log R/G and log B/G, (N, 2) float64, over 3 x 3 BGR pixels around those of `pixels` that are shown.

    The shown (P,) of the pixels (P, 2), u and v, must be at least one pixel inside the frame's border.
    """
    u, v = np.rint(pixels[shown]).astype(int).T
    steps = np.arange(-1, 2)
    patches = frame[v[:, None, None] + steps[:, None], u[:, None, None] + steps]
    blue, green, red = np.log(patches.sum(axis=(1, 2), dtype=np.int64) + _DARKEST).T
    return np.stack([red - green, blue - green], axis=1)


def is_inside(pixels: FloatArray, frame: UInt8Array, mask: UInt8Array | None) -> BoolArray:
    """Return which pixels (P, 2) are inside a frame, with their neighbours, and not masked."""
    height, width = frame.shape[:2]
    u, v = np.rint(np.clip(np.nan_to_num(pixels, nan=-1.0), -1, max(width, height))).astype(int).T
    inside = (u > 0) & (v > 0) & (u < width - 1) & (v < height - 1)
    if mask is not None:
        inside[inside] = mask[v[inside], u[inside]] == 0
    return np.asarray(inside)


def swapped_nats(
    log_ratios: FloatArray,
    is_positive: BoolArray,
    palette: FloatArray,
) -> float:
    """Return the log-likelihood ratio, nats, of goals with red and blue swapped to the goals' own colours.

    Parameters
    ----------
    log_ratios : (N, 2) float64
        Logarithms of R/G and B/G of points on the goals.
    is_positive : (N,) bool
        The goal of each, up to a half turn.
    palette : (5, 2) float64
        `Colors.goal_log_ratios`.
    """
    white, paints = palette[4], palette[:4] - palette[4]
    own, swapped = (
        max(
            _support(log_ratios - np.where(is_positive[:, None], first, second), white)
            for first, second in ((pair[0], pair[1]), (pair[1], pair[0]))
        )
        for pair in (paints[:2], paints[2:])
    )
    return (swapped - own) / _LIGHT_POINTS


def _support(lights: FloatArray, white: FloatArray) -> float:
    """Return the number of points that agree under the best light, minus the cost of that light.

    `lights` (N, 2) are the lights that give the points their goal's colour; `white` (2,) is the light by white.
    """
    tried = np.vstack([np.zeros(2), white, lights])
    cost = (tried**2).sum(axis=1) / _LIGHT_STD**2
    if float(np.abs(white).max()) < _MAX_LIGHT:
        cost = np.minimum(cost, ((tried - white) ** 2).sum(axis=1) / _WHITE_STD**2)
    away2 = ((lights[None] - tried[:, None]) ** 2).sum(axis=2)
    agree = np.maximum(0.0, 1.0 - away2 / _REACH**2).sum(axis=1)
    return float((agree - 0.5 * _LIGHT_POINTS * cost).max())
