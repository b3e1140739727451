"""Result of a mirror camera's calibration: the camera, its uncertainty, the frames used, and notes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.omni.choice import Choice
from robocup_vision.calibration.omni.fit import Fit
from robocup_vision.calibration.omni.settings import OmniCalibrationSettings
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.geometry import Pose2


@dataclass(frozen=True, eq=False)
class CalibratedFrame:
    """One frame of a calibration."""

    index: int  #: index among the frames given
    name: str
    pose: Pose2  #: of the robot; on a point-symmetric field perhaps half a turn off
    #: (B, 2) float64, (L, 2) float64: points of the floor's edge and of painted lines
    boundary_px: FloatArray
    line_px: FloatArray
    #: (B,) float64, (L,) float64: their signed distances from the walls and lines of the pose
    boundary_residual_px: FloatArray
    line_residual_px: FloatArray


@dataclass(frozen=True, eq=False)
class OmniCalibration:
    """A calibrated mirror camera with its uncertainty."""

    camera: OmniCamera  #: ready for a camera file
    frames: tuple[CalibratedFrame, ...]  #: the frames used
    #: standard deviations: ``center_u_px``, ``center_v_px``, ``tilt_x_rad``, ``tilt_y_rad``, and, relative, those of
    #: the curve's two main numbers, ``scale`` (near the centre) and ``horizon``. They are marginal: a number that
    #: correlates with another has a large one.
    std: dict[str, float]
    choices: tuple[Choice, ...]  #: families of curves that were tried, the chosen one first
    notes: tuple[str, ...]  #: what the images do not determine, or do not separate, and which frames were left out


def standard_deviations(covariance: FloatArray) -> dict[str, float]:
    """Name the square roots of a covariance's diagonal (G, G) as `OmniCalibration.std` does."""
    std = np.sqrt(np.diag(covariance))
    names = ("center_u_px", "center_v_px", "tilt_x_rad", "tilt_y_rad", "scale", "horizon")
    return {name: float(value) for name, value in zip(names, std, strict=False)}


def range_std(
    fit: Fit, covariance: FloatArray, radius_px: FloatArray, as_good: Sequence[OmniCamera] = ()
) -> FloatArray:
    """Return the largest relative standard deviation (R,), all around, of the floor's range at some image radii (R,).

    The range is that from the foot of the mirror's axis, where the calibration puts the robot: a centre and a tilt that
    compensate for each other leave it as it is. Cameras that explain the images as well count as likely as the fit's.
    """
    bearing = np.arange(12) * math.tau / 12
    pixels = fit.camera.polar_to_pixel(bearing[:, None], radius_px[None]).reshape(-1, 2)
    floor_m = fit.camera.pixel_to_floor(pixels)
    range_m = np.hypot(*floor_m.T)
    by_vector = np.empty((len(pixels), len(fit.vector)))
    for g in range(len(fit.vector)):
        ahead = fit.vector.copy()
        ahead[g] += 1e-4
        by_vector[:, g] = (np.hypot(*fit.model.camera(ahead).pixel_to_floor(pixels).T) - range_m) / 1e-4
    variance = np.einsum("ng,gh,nh->n", by_vector, covariance, by_vector)
    for camera in as_good:
        variance += (np.hypot(*camera.pixel_to_floor(pixels).T) - range_m) ** 2 / (len(as_good) + 1)
    variance /= range_m**2
    std: FloatArray = np.sqrt(np.fmax.reduce(variance.reshape(len(bearing), -1), axis=0))
    return std


def undetermined(
    fit: Fit, covariance: FloatArray, tilted: bool, unknown: bool, settings: OmniCalibrationSettings
) -> list[str]:
    """Return a sentence for each number that the images do not determine, or do not separate from another.

    Parameters
    ----------
    tilted : bool
        Whether the tilt was fitted.
    unknown : bool
        Whether there was no start.
    settings : OmniCalibrationSettings
        Its `max_correlation` is used.
    """
    notes = []
    std = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(std, std)
    for tilt, center in ((2, 1), (3, 0)):
        if abs(correlation[tilt, center]) > settings.max_correlation:
            px = abs(covariance[tilt, center] / covariance[tilt, tilt]) * math.radians(0.1)
            notes.append(
                f"{fit.model.names[center]} and {fit.model.names[tilt]} are hard to separate (correlation "
                f"{correlation[tilt, center]:+.2f}): {px:.2f} px of the first look like 0.1 degrees of the second"
            )
    if not tilted:
        fixed = "zero" if unknown else "the start's"
        notes.append(f"the images do not separate the tilt from the centre: the tilt is {fixed}, the centre fits it")
    origin = "assumed" if unknown else "taken from the start"
    notes.append(f"heading, offset and mirroring of the camera are {origin}: pictures of a field do not show them")
    return notes
