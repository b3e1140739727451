"""What a calibration of a forward camera gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robocup_vision.camera.pinhole import PinholeCamera


@dataclass(frozen=True)
class ForwardFrame:
    """One picture that was used: its index in the sequence, and its own tilt and roll (radians)."""

    index: int
    name: str
    tilt_rad: float
    roll_rad: float


@dataclass(frozen=True)
class ForwardCalibration:
    """A calibrated forward camera with its uncertainty.

    Parameters
    ----------
    camera : PinholeCamera
        With its standard deviations; tilt and roll where they were the same in all pictures, else None.
    std : mapping of str to float
        Standard deviations of ``focal_px``, ``height_m``, ``center_u_px``, ``center_v_px``; where they were the same in
        all pictures, of ``tilt_rad`` and ``roll_rad``; where they were fitted, of the coefficients of the distortion,
        ``k1`` and ``k2``.
    correlation : float
        Between focal length and height.
    frames : tuple of ForwardFrame
        Pictures used.
    notes : tuple of str
        Messages for the user.
    residual_px : float
        Root mean square of what edges in the pictures are off.
    line_width_m : float or None
        Of the painted lines by the pictures; None where too few are so near that both edges are seen.
    """

    camera: PinholeCamera
    std: Mapping[str, float]
    correlation: float
    frames: tuple[ForwardFrame, ...]
    notes: tuple[str, ...]
    residual_px: float
    line_width_m: float | None = None
