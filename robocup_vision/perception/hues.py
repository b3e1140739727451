"""The hue of a thing that stands on the floor: of its team's marker or shirt, wherever that is on it."""

from __future__ import annotations

import math

import cv2
import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera

# step in pixels of the reduced frame: a robot is larger
STEP_PX = 4
# height over the floor up to which an obstacle is looked at, in robot diameters, and the rows and columns sampled
_HIGH, _ROWS, _COLUMNS = 1.5, 16, 9
# part of its width: bodies are narrower higher up
_MIDDLE = 0.5
# how far before it the floor is looked at, in a robot's radii
_BEFORE = np.array([0.4, 0.8])
# a saturated colour: of its brightest channel, what the darkest one lacks; and counts of the brightest one
_SATURATED, _LIT = 0.4, 60.0
# part of what is looked at that must be saturated
_MIN_PART = 0.08
# largest hue difference from the floor's that counts as floor
_LIKE_FLOOR_RAD = math.radians(35.0)


def thumbnail_of(frame: UInt8Array) -> UInt8Array:
    """Return every fourth pixel of a frame (H, W, 3), a copy."""
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
    """Return the hue that most of what is saturated on each thing has, radians from 0 to a turn; None: too little is.

    It is looked at in an upright rectangle over the middle half of its near side. What has the hue of the floor before
    it is floor, or mirrors it; where that floor is not in view, nothing is told.

    Parameters
    ----------
    thumbnail : (h, w, 3) uint8
        Of the frame, `thumbnail_of`, BGR.
    places_m : (N, 2) float64
        Middles of their near sides, robot frame.
    widths_m : (N,) float64
        Distances between the ends of these.
    """
    ahead = places_m - np.array(camera.offset_m)
    ahead = ahead / np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-6)[:, None]
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    aside = 0.5 * _MIDDLE * widths_m[:, None] * np.linspace(-1.0, 1.0, _COLUMNS)
    across = places_m[:, None] + aside[..., None] * left[:, None]
    up = 2.0 * _HIGH * radius_m * (np.arange(_ROWS) + 0.5) / _ROWS
    # rows over the thing, then two on the floor before it
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
    """Return a thing's hue by what its rows and those of the floor before it show."""
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
    """Return the median of angles (N,) about the direction in which most of them lie."""
    steps = 24
    counts = np.bincount((angle_rad % math.tau * (steps / math.tau)).astype(np.intp) % steps, minlength=steps)
    around = counts + np.roll(counts, 1) + np.roll(counts, -1)
    middle = (float(np.argmax(around)) + 0.5) * math.tau / steps
    off = _wrapped(angle_rad - middle)
    near = off[np.abs(off) < math.pi / 3]
    return middle + float(np.median(near if len(near) else off))
