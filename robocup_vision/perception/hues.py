"""The hue of a thing that stands on the floor: of its team's marker or shirt, wherever that is on it."""

from __future__ import annotations

import math

import cv2
import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera

# every so many pixels of a frame are kept: a robot is larger
STEP_PX = 4
# a thing is looked at up to so many of a robot's diameters over the floor, on so many rows and columns
_HIGH, _ROWS, _COLUMNS = 1.5, 16, 9
# part of its width: bodies are narrower higher up
_MIDDLE = 0.5
# a saturated colour: of its brightest channel, what the darkest one lacks; and counts of the brightest one
_SATURATED, _LIT = 0.4, 60.0
# part of what is looked at that must be saturated
_MIN_PART = 0.08
# hues so near to the floor's are the floor's
_LIKE_FLOOR_RAD = math.radians(35.0)


def thumbnail_of(frame: UInt8Array) -> UInt8Array:
    """Return every fourth pixel of a frame (H, W, 3), a copy."""
    height, width = frame.shape[:2]
    size = max(width // STEP_PX, 1), max(height // STEP_PX, 1)
    return np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)


def hue_of(
    thumbnail: UInt8Array,
    camera: OmniCamera | PinholeCamera,
    place_m: tuple[float, float],
    width_m: float,
    radius_m: float,
) -> float | None:
    """Return the hue that most of what is saturated on a thing has, radians from 0 to a turn; None: too little is.

    It is looked at in an upright rectangle over the middle half of its near side. What has the hue of the floor before
    it is floor, or mirrors it; where that floor is not in view, nothing is told.

    Parameters
    ----------
    thumbnail : (h, w, 3) uint8
        Of the frame, `thumbnail_of`, BGR.
    camera : OmniCamera or PinholeCamera
        Of the frame.
    place_m : (float, float)
        Middle of its near side, robot frame.
    width_m : float
        Distance between the ends of that.
    radius_m : float
        Of a robot of the league.
    """
    away_m = max(math.dist(place_m, camera.offset_m), 1e-6)
    ahead = (place_m[0] - camera.offset_m[0]) / away_m, (place_m[1] - camera.offset_m[1]) / away_m
    aside = 0.5 * _MIDDLE * width_m * np.linspace(-1.0, 1.0, _COLUMNS)
    up = 2.0 * _HIGH * radius_m * (np.arange(_ROWS) + 0.5) / _ROWS
    across, height = np.meshgrid(aside, up)
    # the middle of a body stands behind its near side; a mirror shows it there
    body = np.stack(
        [np.asarray(place_m)[0] - across * ahead[1], np.asarray(place_m)[1] + across * ahead[0], height], -1
    )
    hues = _saturated_hues(thumbnail, camera, body.reshape(-1, 3))
    if hues is None or len(hues[0]) < _MIN_PART * hues[1]:
        return None
    before = [(place_m[0] - part * radius_m * ahead[0], place_m[1] - part * radius_m * ahead[1]) for part in (0.4, 0.8)]
    floor = np.array([(x - o * ahead[1], y + o * ahead[0], 0.0) for x, y in before for o in aside])
    beside = _saturated_hues(thumbnail, camera, floor)
    if beside is None:
        return None
    found = hues[0]
    if len(beside[0]):
        found = found[np.abs(_wrapped(found - _median(beside[0]))) > _LIKE_FLOOR_RAD]
    if len(found) < _MIN_PART * hues[1]:
        return None
    return _median(found) % math.tau


def _saturated_hues(
    thumbnail: UInt8Array, camera: OmniCamera | PinholeCamera, points_m: FloatArray
) -> tuple[FloatArray, int] | None:
    """Return hues (N,) of those points (M, 3), robot frame, that show a saturated colour, and how many are in view."""
    height, width = thumbnail.shape[:2]
    pixels = camera.point_to_pixel(points_m) * (width / camera.size_px[0], height / camera.size_px[1])
    with np.errstate(invalid="ignore"):
        shown = ((pixels >= 0) & (pixels < (width, height))).all(axis=1)
    if not shown.any():
        return None
    column, row = pixels[shown].astype(np.intp).T
    color = thumbnail[row, column].astype(np.float64)
    most, least = color.max(axis=1), color.min(axis=1)
    blue, green, red = color[(most > _LIT) & (most - least > _SATURATED * most)].T
    return np.arctan2(math.sqrt(3.0) * (green - blue), 2.0 * red - green - blue), int(np.count_nonzero(shown))


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
