"""What a calibration says: the camera, how sure it is, the frames it rests on, and what the images could not tell."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.omni.choice import Choice
from robocup_vision.calibration.omni.fit import Fit
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.geometry import Pose2

# numbers that trade off against one another more than this cannot be told apart
_APART = 0.9


@dataclass(frozen=True, eq=False)
class CalibratedFrame:
    """One frame as the calibration explains it.

    Parameters
    ----------
    index : int
        Which of the frames given.
    name : str
        What it is called.
    pose : Pose2
        The robot; on a point-symmetric field perhaps half a turn off.
    boundary_px, line_px : (B, 2) float64, (L, 2) float64
        Points of the floor's edge and of painted lines.
    boundary_residual_px, line_residual_px : (B,) float64, (L,) float64
        Their signed distances from the walls and lines of the pose.
    """

    index: int
    name: str
    pose: Pose2
    boundary_px: FloatArray
    line_px: FloatArray
    boundary_residual_px: FloatArray
    line_residual_px: FloatArray


@dataclass(frozen=True, eq=False)
class OmniCalibration:
    """A calibrated mirror camera, with what is known of how good it is.

    Parameters
    ----------
    camera : OmniCamera
        Ready for a camera file.
    frames : tuple of CalibratedFrame
        The frames it rests on.
    std : mapping of str to float
        Standard deviations: ``center_u_px``, ``center_v_px``, ``tilt_x_rad``, ``tilt_y_rad``, and, relative, those of
        the curve's two main numbers, ``scale`` (near the centre) and ``horizon``. Each as if all others were unknown:
        what trades off against something else has a large one.
    choices : tuple of Choice
        Families of curves that were tried, the chosen one first.
    notes : tuple of str
        What could not be told, or told apart, and which frames were left out.
    """

    camera: OmniCamera
    frames: tuple[CalibratedFrame, ...]
    std: dict[str, float]
    choices: tuple[Choice, ...]
    notes: tuple[str, ...]


def standard_deviations(fit: Fit, covariance: FloatArray) -> dict[str, float]:
    """Name the square roots of a covariance's diagonal (G, G) as `OmniCalibration.std` does."""
    std = np.sqrt(np.diag(covariance))
    names = ("center_u_px", "center_v_px", "tilt_x_rad", "tilt_y_rad", "scale", "horizon")
    return {name: float(value) for name, value in zip(names, std, strict=False)}


def trade_offs(fit: Fit, covariance: FloatArray, tilted: bool, unknown: bool) -> list[str]:
    """Say in sentences what the images could not tell, or not tell apart."""
    notes = []
    std = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(std, std)
    for tilt, center in ((2, 1), (3, 0)):
        if abs(correlation[tilt, center]) > _APART:
            px = abs(covariance[tilt, center] / covariance[tilt, tilt]) * math.radians(0.1)
            notes.append(
                f"{fit.model.names[center]} and {fit.model.names[tilt]} trade off (correlation "
                f"{correlation[tilt, center]:+.2f}): {px:.2f} px of the one look like 0.1 degrees of the other"
            )
    if not tilted:
        kept = "zero" if unknown else "what the start has"
        notes.append(f"the tilt cannot be told from the centre: it stays {kept}, and the centre takes its place")
    origin = "assumed" if unknown else "taken from the start"
    notes.append(f"heading, offset and mirroring of the camera are {origin}: no picture of a field tells them")
    return notes
