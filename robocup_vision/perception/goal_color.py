"""Finds goal paint of a hue family, relative to the image's own white: no colour is set by hand.

A pixel belongs to the family whose rule-book hue is nearest, among the families that occur on this pitch, so the
boundaries lie half-way between goal, carpet, ball and beacons.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from field_models import COLOR_NAMES
from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.kernels.goal.paint.shine import fill_shine


@dataclass(frozen=True, slots=True)
class GoalColorSettings:
    """Settings of the search for goal paint of a hue."""

    min_saturation: float = 0.30  #: a third of full paint: glare that leaves less looks white
    min_value: int = 25  #: of 255: below it hue is noise
    min_shine: int = 170  #: paint that a lamp washes white is at least so bright in all channels
    max_cast: float = 1.3  #: strongest colour cast that is corrected by the image's bright end: a stronger one is paint


def is_chromatic(color: str) -> bool:
    """Whether a named colour has a hue at all."""
    bgr = COLOR_NAMES[color]
    return max(bgr) - min(bgr) > 0.3 * max(bgr)


def hue_of(color: str) -> float:
    """Hue of a named colour in OpenCV's half degrees, 0 to 180."""
    return float(cv2.cvtColor(np.array([[COLOR_NAMES[color]]], np.uint8), cv2.COLOR_BGR2HSV)[0, 0, 0])


def hue_families(field: Field) -> dict[str, tuple[float, float]]:
    """Hue interval (half degrees, may pass 0 or 180) of each goal colour of a field that has a hue."""
    names = {"green", "orange", field.ball_color, *(goal.color for goal in field.goals)}
    names |= {color for beacon in field.beacons for color in beacon.colors}
    hues = {name: hue_of(name) for name in names if is_chromatic(name)}
    families = {}
    for color in dict.fromkeys(goal.color for goal in field.goals if is_chromatic(goal.color)):
        others = [(hues[name] - hues[color] + 90.0) % 180.0 - 90.0 for name in hues if name != color]
        above = min((d for d in others if d > 0), default=60.0)
        below = max((d for d in others if d < 0), default=-60.0)
        # where no rival is near, a family still ends: 40 degrees of hue either way
        families[color] = (hues[color] + max(below / 2, -20.0), hues[color] + min(above / 2, 20.0))
    return families


def white_gains(image: UInt8Array, settings: GoalColorSettings = GoalColorSettings()) -> npt.NDArray[np.float64]:
    """Factors (3,) for B, G, R that make the image's bright end white."""
    coarse = image[::4, ::4].reshape(-1, 3)
    bright = np.array([np.partition(coarse[:, c], -len(coarse) // 20)[-len(coarse) // 20] for c in range(3)], float)
    gains = bright.max() / np.maximum(bright, 1.0)
    return np.asarray(np.minimum(gains, settings.max_cast), np.float64)


def hue_masks(
    image: UInt8Array, families: dict[str, tuple[float, float]], settings: GoalColorSettings = GoalColorSettings()
) -> dict[str, UInt8Array]:
    """Masks (H, W) uint8, 255 on paint, one for each hue family."""
    balanced, hsv = _balanced(image, settings)
    masks = {}
    for color, (low, high) in families.items():
        least = np.array([max(low, 0.0), 255 * settings.min_saturation, settings.min_value])
        most = np.array([min(high, 179.0), 255, 255])
        mask = cv2.inRange(hsv, least, most)
        for wrapped_low, wrapped_high in ((low + 180.0, 179.0), (0.0, high - 180.0)):
            if wrapped_low <= wrapped_high and (wrapped_low > 90.0 if low < 0 else high > 179.0):
                least[0], most[0] = wrapped_low, wrapped_high
                mask = cv2.bitwise_or(mask, cv2.inRange(hsv, least, most))
        masks[color] = np.asarray(mask, np.uint8)
        _fill(masks[color], balanced, settings.min_shine)
    return masks


def _balanced(image: UInt8Array, settings: GoalColorSettings) -> tuple[UInt8Array, UInt8Array]:
    """Return the image with its bright end made white, and its hue, saturation and value."""
    gains = white_gains(image, settings)
    balanced = image if np.all(gains < 1.02) else np.asarray(cv2.LUT(image, _gain_table(gains)), np.uint8)
    return balanced, np.asarray(cv2.cvtColor(balanced, cv2.COLOR_BGR2HSV), np.uint8)


def _fill(mask: UInt8Array, balanced: UInt8Array, min_shine: int) -> None:
    """Add the shine that paint surrounds, along rows (posts), then along columns (the bar)."""
    u, v, width, height = cv2.boundingRect(mask)
    box = np.s_[v : v + height, u : u + width]
    for upright in (False, True):
        fill_shine(mask[box], balanced[box], min_shine, mask.shape[1] // 8, upright)


def _gain_table(gains: npt.NDArray[np.float64]) -> UInt8Array:
    ramp = np.arange(256)[:, None] * gains
    return np.minimum(np.rint(ramp), 255).astype(np.uint8).reshape(1, 256, 3)
