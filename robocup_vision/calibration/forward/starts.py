"""Starts of a calibration: the known parameters of a camera, and trial values of lens and mounting for the others.

A fisheye's image circle is found by its rim. Regions that are dark in every picture and reach a corner are beyond the
lens or part of the robot. The lens's border is a circle about the picture's middle; that of the robot is not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import PinholeCamera

# trial values of unknown parameters, with steps within the convergence range of a fit
# least and greatest horizontal field of view
_VIEWS_RAD = {
    "pinhole": (math.radians(42.0), math.radians(96.0)),
    "fisheye": (math.radians(75.0), math.radians(190.0)),
}
# step of the focal length, as a logarithm
_FOCAL_STEP = 0.13
# from small robots to those of the middle size, and large humanoids
_HEIGHTS_M = (0.16, 0.21, 0.28, 0.37, 0.5, 0.66, 0.88)
_TILTS_RAD: tuple[float, ...] = tuple(np.linspace(-0.7, 0.1, 9).tolist())
# deviations from a camera file's focal length, as logarithms
_LOG_FOCALS = (-0.16, -0.08, 0.0, 0.08, 0.16)
# brightness of a rim relative to the picture's middle third, above that of stray light
_DARK = 0.15
# greatest distance of the border from the circle, relative to the radius; least ratio of the directions with a visible
# circle in which the border is found
_NEAR, _MIN_FOUND = 0.01, 0.8
_DIRECTIONS = 360
_MIN_DIRECTIONS = 40
# usable ratio of the greatest radius, because lenses darken towards the rim
_USED = 0.98
LENS_MODELS: tuple[LensModel, ...] = ("pinhole", "fisheye")


def dark_rim(frames: Sequence[UInt8Array]) -> tuple[float, float, float] | None:
    """Return centre u, v and radius (px) of the circle beyond which all pictures are dark; None without one.

    Parameters
    ----------
    frames : sequence of (H, W, 3) uint8
        BGR, of one camera; more frames reduce confusion of dark objects with the rim.
    """
    brightest = np.max([cv2.blur(np.max(frame, axis=-1), (3, 3)) for frame in frames], axis=0).astype(np.float64)
    height, width = brightest.shape
    middle = brightest[height // 3 : -(height // 3), width // 3 : -(width // 3)]
    lit = brightest > _DARK * float(np.median(middle))
    border = _outermost(lit)
    for _ in range(3):
        if len(border) < _MIN_DIRECTIONS:
            return None
        u, v, radius = _circle(border)
        border = border[np.abs(np.hypot(border[:, 0] - u, border[:, 1] - v) - radius) < 3 * _NEAR * radius]
    if np.hypot(u - (width - 1) / 2, v - (height - 1) / 2) > 0.15 * max(width, height):
        return None
    near = np.abs(np.hypot(border[:, 0] - u, border[:, 1] - v) - radius) < _NEAR * radius
    angle = np.linspace(0.0, 2 * np.pi, _DIRECTIONS, endpoint=False)
    on_circle = np.stack([u + radius * np.cos(angle), v + radius * np.sin(angle)], axis=1)
    visible = ((on_circle > 2.0) & (on_circle < (width - 3.0, height - 3.0))).all(axis=1)
    if np.count_nonzero(near) < max(_MIN_FOUND * np.count_nonzero(visible), _MIN_DIRECTIONS):
        return None
    return u, v, radius


def circle_of(rim: tuple[float, float, float], center_px: tuple[float, float]) -> tuple[float, float]:
    """Return the usable inner and outer radius (px) about a lens's centre, limited by a rim."""
    u, v, radius = rim
    return 0.0, _USED * radius - float(np.hypot(u - center_px[0], v - center_px[1]))


def _outermost(lit: BoolArray) -> FloatArray:
    """(N, 2) float64: the outermost lit pixels on rays from the middle, if not at the picture's border."""
    height, width = lit.shape
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    found = []
    for angle in np.linspace(0.0, 2 * np.pi, _DIRECTIONS, endpoint=False):
        way = np.array([np.cos(angle), np.sin(angle)])
        length = float(np.min(middle / np.maximum(np.abs(way), 1e-9)))
        steps = np.arange(0.0, length, 0.5)
        column, row = np.rint(middle[:, None] + way[:, None] * steps).astype(np.intp)
        shown = np.flatnonzero(lit[row, column])
        if len(shown) and steps[shown[-1]] < length - 3.0:
            found.append(middle + way * (steps[shown[-1]] + 0.25))
    return np.array(found).reshape(-1, 2)


def _circle(points: FloatArray) -> tuple[float, float, float]:
    """Return centre and radius of the circle through points (N, 2), by least squares of the squared radius."""
    design = np.column_stack([2.0 * points, np.ones(len(points))])
    (u, v, rest), *_ = np.linalg.lstsq(design, (points**2).sum(axis=1), rcond=None)
    return float(u), float(v), float(np.sqrt(max(rest + u * u + v * v, 1e-9)))


LensModel = Literal["pinhole", "fisheye"]


@dataclass(frozen=True, slots=True)
class KnownOfCamera:
    """Rough knowledge of a camera; None is unknown.

    Parameters
    ----------
    model : {"pinhole", "fisheye"}
        Model of the lens.
    view_rad : float or None
        Horizontal field of view, within 10 %.
    height_m : float or None
        Height of the lens above the floor, within 10 %.
    tilt_rad : float or None
        Tilt within 3 degrees, negative downwards. It must be the same in all pictures.

    Raises
    ------
    ArgumentError
        If a value is out of its bounds.
    """

    model: LensModel = "pinhole"
    view_rad: float | None = None
    height_m: float | None = None
    tilt_rad: float | None = None

    def __post_init__(self) -> None:
        if self.model not in LENS_MODELS:
            raise ArgumentError(f"model must be one of {', '.join(LENS_MODELS)}, got {self.model!r}")
        widest = math.pi if self.model == "pinhole" else math.tau
        if self.view_rad is not None and not 0.0 < self.view_rad < widest:
            most = f"{math.degrees(widest):.0f} degrees"
            raise ArgumentError(f"the view of a {self.model} camera is less than {most}, got {self.view_rad!r}")
        if self.height_m is not None and not 0.0 < self.height_m <= 3.0:
            raise ArgumentError(f"height must be in metres, above 0 and at most 3, got {self.height_m!r}")
        if self.tilt_rad is not None and not abs(self.tilt_rad) <= math.pi / 2:
            raise ArgumentError(f"tilt must be in radians, between -pi/2 and pi/2, got {self.tilt_rad!r}")


def starts_of(size_px: tuple[int, int], known: KnownOfCamera | PinholeCamera) -> list[PinholeCamera]:
    """Return cameras of which one is close to the true one; an unknown centre is the picture's middle.

    Starts from a camera have its height, focal lengths near its own, and its tilt if it has one.
    """
    tilts = _TILTS_RAD if known.tilt_rad is None else (known.tilt_rad,)
    if isinstance(known, PinholeCamera):
        scales = [math.exp(log) for log in _LOG_FOCALS]
        scaled = [replace(known, focal_px=(known.focal_px[0] * one, known.focal_px[1] * one)) for one in scales]
        return [replace(one, tilt_rad=tilt) for one in scaled for tilt in tilts]
    width, height = size_px
    middle = (width - 1) / 2, (height - 1) / 2
    if known.view_rad is None:
        most, least = (math.log(_focal_px(width, view, known.model)) for view in _VIEWS_RAD[known.model])
        focals = np.exp(np.linspace(least, most, 1 + math.ceil((most - least) / _FOCAL_STEP))).tolist()
    else:
        focals = [_focal_px(width, known.view_rad, known.model)]
    heights = _HEIGHTS_M if known.height_m is None else (known.height_m,)
    kind = PinholeCamera if known.model == "pinhole" else FisheyeCamera
    return [
        kind((width, height), (focal, focal), middle, up, pan_rad=0.0, tilt_rad=tilt, roll_rad=0.0)
        for focal in focals
        for up in heights
        for tilt in tilts
    ]


def _focal_px(width_px: int, view_rad: float, model: LensModel) -> float:
    """Return the focal length for a horizontal field of view."""
    half = view_rad / 2
    return 0.5 * width_px / (math.tan(half) if model == "pinhole" else half)
