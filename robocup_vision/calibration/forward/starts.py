"""Starts of a calibration: what is known of a camera, and lenses and mountings that are tried for what is not."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import PinholeCamera

LensModel = Literal["pinhole", "fisheye"]
LENS_MODELS: tuple[LensModel, ...] = ("pinhole", "fisheye")


@dataclass(frozen=True, slots=True)
class KnownOfCamera:
    """What is roughly known of a camera; None: nothing.

    Parameters
    ----------
    model : {"pinhole", "fisheye"}
        Of its lens.
    view_rad : float or None
        Horizontal field of view, to a tenth.
    height_m : float or None
        Of the lens over the floor, to a tenth.
    tilt_rad : float or None
        To 3 degrees; negative where it looks down. It must be the same in all pictures.

    Raises
    ------
    ArgumentError
        A value is out of its bounds.
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


@dataclass(frozen=True, slots=True)
class StartSettings:
    """What is tried where it is not known: steps are as far apart as a fit bridges.

    Parameters
    ----------
    pinhole_views_rad, fisheye_views_rad : (float, float)
        Least and greatest horizontal field of view.
    focal_step : float
        From one focal length to the next, as a logarithm.
    heights_m : tuple of float
        Of small robots to those of the middle size, and large humanoids.
    tilts_rad : (float, float)
        Least and greatest.
    tilt_step_rad : float
        From one to the next.
    log_focals : tuple of float
        Logarithms of the focal length that are tried about that of a camera file.
    """

    pinhole_views_rad: tuple[float, float] = (math.radians(42.0), math.radians(96.0))
    fisheye_views_rad: tuple[float, float] = (math.radians(75.0), math.radians(190.0))
    focal_step: float = 0.13
    heights_m: tuple[float, ...] = (0.16, 0.21, 0.28, 0.37, 0.5, 0.66, 0.88)
    tilts_rad: tuple[float, float] = (-0.7, 0.1)
    tilt_step_rad: float = 0.1
    log_focals: tuple[float, ...] = (-0.16, -0.08, 0.0, 0.08, 0.16)


def starts_of(
    size_px: tuple[int, int], known: KnownOfCamera, settings: StartSettings = StartSettings()
) -> list[PinholeCamera]:
    """Return cameras of which one is about right, the centre of each in the picture's middle.

    Parameters
    ----------
    size_px : (int, int)
        Of the pictures.
    known : KnownOfCamera
        What is not tried.
    settings : StartSettings, optional
        What is.
    """
    width, height = size_px
    middle = (width - 1) / 2, (height - 1) / 2
    views = settings.pinhole_views_rad if known.model == "pinhole" else settings.fisheye_views_rad
    if known.view_rad is None:
        most, least = (math.log(_focal_px(width, view, known.model)) for view in views)
        focals = np.exp(np.linspace(least, most, 1 + math.ceil((most - least) / settings.focal_step))).tolist()
    else:
        focals = [_focal_px(width, known.view_rad, known.model)]
    heights = settings.heights_m if known.height_m is None else (known.height_m,)
    tilts = _tilts(settings) if known.tilt_rad is None else [known.tilt_rad]
    kind = PinholeCamera if known.model == "pinhole" else FisheyeCamera
    return [
        kind((width, height), (focal, focal), middle, up, pan_rad=0.0, tilt_rad=tilt, roll_rad=0.0)
        for focal in focals
        for up in heights
        for tilt in tilts
    ]


def starts_about(camera: PinholeCamera, settings: StartSettings = StartSettings()) -> list[PinholeCamera]:
    """Return a camera with the focal lengths that are tried about its own, and tilts where its own is unknown."""
    (fu, fv), scales = camera.focal_px, [math.exp(log) for log in settings.log_focals]
    tilts = _tilts(settings) if camera.tilt_rad is None else [camera.tilt_rad]
    return [replace(camera, focal_px=(fu * scale, fv * scale), tilt_rad=tilt) for scale in scales for tilt in tilts]


def _tilts(settings: StartSettings) -> list[float]:
    low, high = settings.tilts_rad
    return [float(tilt) for tilt in np.linspace(low, high, 1 + round((high - low) / settings.tilt_step_rad))]


def _focal_px(width_px: int, view_rad: float, model: LensModel) -> float:
    """Focal length with which a lens shows so much of the horizon across the picture."""
    half = view_rad / 2
    return 0.5 * width_px / (math.tan(half) if model == "pinhole" else half)
