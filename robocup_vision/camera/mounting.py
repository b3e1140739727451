"""How neck and body hold a forward camera in one frame, as joints or an inertial sensor tell it."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from field_models.errors import ArgumentError
from robocup_vision.camera.bounds import problem_of


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
            problem = problem_of(name, value)
            if problem is not None:
                raise ArgumentError(f"a mounting's {name} {problem.what}, got {value!r}{problem.hint}")

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
