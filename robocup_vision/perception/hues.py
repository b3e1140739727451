"""Hues of obstacles, such as of a team's marker or shirt."""

from __future__ import annotations

import math

import cv2
import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera

# step in pixels of the reduced frame, small compared with a robot
STEP_PX = 4
# sampled height above the floor, in robot diameters; number of rows and columns of samples
_HIGH, _ROWS, _COLUMNS = 1.5, 16, 9
# sampled part of an obstacle's width, because bodies are narrower higher up
_MIDDLE = 0.5
# distances in front of it at which the floor is sampled, in robot radii
_BEFORE = np.array([0.4, 0.8])
# a colour is saturated if its channels differ by this ratio of the greatest, which must exceed this level
_SATURATED, _LIT = 0.4, 60.0
# least ratio of saturated samples
_MIN_PART = 0.08
# largest hue difference to the floor in front at which a sample counts as floor
_LIKE_FLOOR_RAD = math.radians(35.0)


def thumbnail_of(frame: UInt8Array) -> UInt8Array:
    """Return a copy of every fourth pixel of a frame (H, W, 3)."""
    height, width = frame.shape[:2]
    size = max(width // STEP_PX, 1), max(height // STEP_PX, 1)
    return np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)


def hues_of(
    thumbnail: UInt8Array,
    camera: OmniCamera | PinholeCamera,
    places_m: FloatArray,
    widths_m: FloatArray,
    radius_m: float,
) -> tuple[float | None, ...]:
    """Return the hue of most saturated pixels of each obstacle, radians from 0 to a turn; None if too few are.

    Samples lie in an upright rectangle over the middle half of its near side. Those with the hue of the floor in front
    are floor or reflect it. The hue is None if that floor is not in view.

    Parameters
    ----------
    thumbnail : (h, w, 3) uint8
        `thumbnail_of` the frame, BGR.
    places_m : (N, 2) float64
        Middles of their near sides, robot frame.
    widths_m : (N,) float64
        Widths of the near sides.
    """
    ahead = places_m - np.array(camera.offset_m)
    ahead = ahead / np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-6)[:, None]
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    aside = 0.5 * _MIDDLE * widths_m[:, None] * np.linspace(-1.0, 1.0, _COLUMNS)
    across = places_m[:, None] + aside[..., None] * left[:, None]
    up = 2.0 * _HIGH * radius_m * (np.arange(_ROWS) + 0.5) / _ROWS
    # rows of the obstacle, then two rows of the floor in front
    nearer_m = np.concatenate([np.zeros(_ROWS), _BEFORE * radius_m])
    heights_m = np.concatenate([up, np.zeros(len(_BEFORE))])
    points = np.empty((len(places_m), len(heights_m), _COLUMNS, 3))
    points[..., :2] = across[:, None] - nearer_m[:, None, None] * ahead[:, None, None]
    points[..., 2] = heights_m[:, None]
    height, width = thumbnail.shape[:2]
    pixels = camera.point_to_pixel(points) * (width / camera.size_px[0], height / camera.size_px[1])
    with np.errstate(invalid="ignore"):
        shown = ((pixels >= 0) & (pixels < (width, height))).all(axis=-1)
    column, row = np.moveaxis(np.where(shown[..., None], pixels, 0.0).astype(np.intp), -1, 0)
    blue, green, red = np.moveaxis(thumbnail[row, column].astype(np.float64), -1, 0)
    most, least = np.maximum(np.maximum(blue, green), red), np.minimum(np.minimum(blue, green), red)
    saturated = shown & (most > _LIT) & (most - least > _SATURATED * most)
    hue = np.arctan2(math.sqrt(3.0) * (green - blue), 2.0 * red - green - blue)
    return tuple(_hue(*one) for one in zip(hue, saturated, shown, strict=True))


def _hue(hue: FloatArray, saturated: BoolArray, shown: BoolArray) -> float | None:
    """Return the hue of an obstacle from its rows and those of the floor in front."""
    found, floor = hue[:_ROWS][saturated[:_ROWS]], hue[_ROWS:][saturated[_ROWS:]]
    needed = _MIN_PART * max(int(np.count_nonzero(shown[:_ROWS])), 1)
    if not shown[_ROWS:].any() or len(found) < needed:
        return None
    if len(floor):
        found = found[np.abs(_wrapped(found - _median(floor))) > _LIKE_FLOOR_RAD]
    return _median(found) % math.tau if len(found) >= needed else None


def _wrapped(angle_rad: FloatArray) -> FloatArray:
    return np.asarray((angle_rad + math.pi) % math.tau - math.pi)


def _median(angle_rad: FloatArray) -> float:
    """Return the median of angles (N,), relative to the most frequent direction."""
    steps = 24
    counts = np.bincount((angle_rad % math.tau * (steps / math.tau)).astype(np.intp) % steps, minlength=steps)
    around = counts + np.roll(counts, 1) + np.roll(counts, -1)
    middle = (float(np.argmax(around)) + 0.5) * math.tau / steps
    off = _wrapped(angle_rad - middle)
    near = off[np.abs(off) < math.pi / 3]
    return middle + float(np.median(near if len(near) else off))
