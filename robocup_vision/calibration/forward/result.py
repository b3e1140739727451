"""What a calibration of a forward camera gives, and when it is refused for being too uncertain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robocup_vision.camera.pinhole import PinholeCamera

ONLY_ONE = "one image cannot be checked against others: use several"
# a less certain result is refused: relative focal length, height
_MAX_FOCAL_STD, _MAX_HEIGHT_STD_M = 0.03, 0.03


@dataclass(frozen=True)
class ForwardFrame:
    """One picture that was used: its index in the sequence, and its own tilt and roll (radians)."""

    index: int
    name: str
    tilt_rad: float
    roll_rad: float
    with_lines: bool


@dataclass(frozen=True)
class ForwardCalibration:
    """A calibrated forward camera with its uncertainty.

    Parameters
    ----------
    camera : PinholeCamera
        With its standard deviations; tilt and roll where they were the same in all pictures, else None.
    std : mapping of str to float
        Standard deviations of ``focal_px``, ``height_m`` and, where it is fixed, ``tilt_rad``; where they were fitted,
        of ``roll_rad``, ``center_u_px``, ``center_v_px``, and of the coefficients of the distortion, ``k1`` and ``k2``.
    correlation : float
        Between focal length and height.
    frames : tuple of ForwardFrame
        Pictures used.
    notes : tuple of str
        Messages for the user.
    residual_px : float or None
        Root mean square of what edges in the pictures are off; None where goals were fitted.
    line_width_m : float or None
        Of the painted lines by the pictures; None where too few are so near that both edges are seen.
    """

    camera: PinholeCamera
    std: Mapping[str, float]
    correlation: float
    frames: tuple[ForwardFrame, ...]
    notes: tuple[str, ...] = ()
    residual_px: float | None = None
    line_width_m: float | None = None


def too_uncertain(count: int, focal_std: float, height_std_m: float) -> str | None:
    """Return why a result by so many pictures is refused; None where it is not.

    Parameters
    ----------
    focal_std : float
        Standard deviation of the logarithm of the focal length.
    """
    for what, is_refused, size in (
        ("focal length", focal_std > _MAX_FOCAL_STD, f"{100 * focal_std:.0f} %"),
        ("height", height_std_m > _MAX_HEIGHT_STD_M, f"{height_std_m:.3f} m"),
    ):
        if is_refused:
            return f"{count} usable images leave the {what} uncertain by {size}"
    return None
