"""How neck and body hold a forward camera in one frame, as joints or an inertial sensor tell it."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from field_models.errors import ArgumentError

# an angle beyond a turn, or a deviation beyond half a radian, is in degrees
_MAX_ANGLE_RAD, _MAX_STD_RAD = math.tau, 0.5


@dataclass(frozen=True, slots=True)
class Mounting:
    """Orientation and height of a pinhole camera in one frame; what is None is as the camera file says.

    The angles are those of the camera file: R = Rz(pan) Ry(-tilt) Rx(roll), robot frame, so that a camera that looks
    down has a negative tilt. The body's sway belongs to tilt and roll where a sensor tells it, else to their standard
    deviations.

    Parameters
    ----------
    pan_rad, tilt_rad, roll_rad : float or None
        Orientation.
    height_m : float or None
        Of the centre of projection over the floor.
    pan_std_rad, tilt_std_rad, roll_std_rad, height_std_m : float or None
        Standard deviations of these in this frame.

    Raises
    ------
    ArgumentError
        If a value is not finite or out of its range.
    """

    pan_rad: float | None = None
    tilt_rad: float | None = None
    roll_rad: float | None = None
    height_m: float | None = None
    pan_std_rad: float | None = None
    tilt_std_rad: float | None = None
    roll_std_rad: float | None = None
    height_std_m: float | None = None

    def __post_init__(self) -> None:
        for name, value in self.known.items():
            if isinstance(value, bool) or not isinstance(value, float | int) or not math.isfinite(value):
                raise ArgumentError(f"a mounting's {name} must be a finite number, got {value!r}")
            if name.endswith(("_std_rad", "_std_m")):
                problem = "must not be negative" if value < 0.0 else ""
                if name.endswith("_rad") and value > _MAX_STD_RAD:
                    problem = f"must be in radians, at most {_MAX_STD_RAD}"
            elif name == "height_m":
                problem = "must be positive" if value <= 0.0 else ""
            else:
                limit = math.pi / 2 if name == "tilt_rad" else _MAX_ANGLE_RAD
                problem = f"must be in radians, within {limit:.4g} of 0" if abs(value) > limit else ""
            if problem:
                raise ArgumentError(f"a mounting's {name} {problem}, got {value!r}")

    @property
    def known(self) -> dict[str, float]:
        """What is not None, by name."""
        return {name: value for name in MOUNTING_NAMES if (value := getattr(self, name)) is not None}

    @property
    def pans_only(self) -> bool:
        """Whether it tells nothing but the pan, and how well that is known."""
        return not self.known.keys() - {"pan_rad", "pan_std_rad"}


# also columns of frames.csv
MOUNTING_NAMES = tuple(field.name for field in dataclasses.fields(Mounting))
