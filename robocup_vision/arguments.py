"""Checks of the arguments of public objects; an error says in one line what is expected.

Each check returns the value, so that it can be used in an expression.
"""

from __future__ import annotations

import math
import numbers
from pathlib import Path

import numpy as np

from field_models.catalog import load_field
from field_models.errors import ArgumentError, FrameError
from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, in_degrees

# no field and no robot's step is longer: a larger value is probably in millimetres
_MAX_AWAY_M = 100.0
# thirty thousand years: a larger value is probably in milliseconds or nanoseconds
_MAX_TIME_S = 1e12


def as_field(value: object) -> Field:
    """Return a field; load it if its name or file is given.

    Raises
    ------
    ArgumentError
        If the value is none of these.
    FileError
        If the field file is not valid.
    """
    if isinstance(value, Field):
        return value
    if isinstance(value, (str, Path)):
        return load_field(value)
    raise ArgumentError(f"field must be a Field, or the name or file of one, got {_shown(value)}")


def as_camera(value: object) -> OmniCamera | PinholeCamera:
    """Return a camera.

    Raises
    ------
    ArgumentError
        If it is none.
    """
    if isinstance(value, (OmniCamera, PinholeCamera)):
        return value
    raise ArgumentError(f"camera must be what load_camera(path) returns, got {_shown(value)}")


def as_pose(name: str, value: object) -> Pose2:
    """Return a finite pose or motion.

    Raises
    ------
    ArgumentError
        If it is not a `Pose2`, not finite, or farther away than anything on a field.
    """
    if not isinstance(value, Pose2):
        raise ArgumentError(f"{name} must be a Pose2(x_m, y_m, theta_rad), got {_shown(value)}")
    if not (_is_finite(value.x_m) and _is_finite(value.y_m) and _is_finite(value.theta_rad)):
        raise ArgumentError(f"{name} must be finite, got {value}")
    if max(abs(value.x_m), abs(value.y_m)) > _MAX_AWAY_M:
        raise ArgumentError(f"{name} must be in metres, within {_MAX_AWAY_M:g} m, got {value}")
    return value


def as_prior(value: object) -> PoseEstimate | Pose2 | None:
    """Return a finite prior; `NotLocated` counts as no prior.

    Raises
    ------
    ArgumentError
        If it is neither a pose nor an estimate, or not finite.
    """
    if value is None or isinstance(value, NotLocated):
        return None
    if not isinstance(value, PoseEstimate):
        return as_pose("prior", value)
    as_pose("prior", value.pose)
    if not all(map(math.isfinite, value.covariance.ravel().tolist())):
        raise ArgumentError(f"the prior's covariance must be finite, got {value.covariance.tolist()}")
    return value


def as_time(value: object) -> float:
    """Return a time, seconds.

    Raises
    ------
    ArgumentError
        If it is not a finite number, or so large that float64 cannot resolve milliseconds.
    """
    if isinstance(value, float) and -_MAX_TIME_S <= value <= _MAX_TIME_S:
        return value
    time_s = as_number("t_s", value)
    if abs(time_s) > _MAX_TIME_S:
        raise ArgumentError(f"t_s must be in seconds, at most {_MAX_TIME_S:g}, got {time_s:g}")
    return time_s


def require_kind(name: str, value: object, kind: type | tuple[type, ...], wanted: str) -> None:
    """Check that a value is of a class.

    Parameters
    ----------
    name : str
        Name of the argument.
    value : object
        Value of the argument.
    kind : type or tuple of type
        Class or classes of which it must be an instance.
    wanted : str
        How the user gets such a value.

    Raises
    ------
    ArgumentError
        If it is of another class.
    """
    if not isinstance(value, kind):
        raise ArgumentError(f"{name} must be {wanted}, got {type(value).__name__}")


def as_number(name: str, value: object) -> float:
    """Return a finite number.

    Raises
    ------
    ArgumentError
        If it is none.
    """
    # a check against numbers.Real takes ten times as long as one against float, which most values are
    if not isinstance(value, (float, numbers.Real)):
        raise ArgumentError(f"{name} must be a number, got {_shown(value)}")
    if not math.isfinite(value):
        raise ArgumentError(f"{name} must be finite, got {value!r}")
    return float(value)


def as_angle(name: str, value: object) -> float:
    """Return a finite angle, radians.

    Raises
    ------
    ArgumentError
        If it is none, or more than a turn.
    """
    angle_rad = as_number(name, value)
    if abs(angle_rad) > math.tau:
        raise ArgumentError(f"{name} must be in radians, within one turn, got {angle_rad!r}{in_degrees(angle_rad)}")
    return angle_rad


def as_count(name: str, value: object, low: int, high: int) -> int:
    """Return a whole number within bounds.

    Raises
    ------
    ArgumentError
        If it is none.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise ArgumentError(f"{name} must be a whole number, got {_shown(value)}")
    whole = int(value)
    if whole < low:
        raise ArgumentError(f"{name} must be at least {low}, got {whole}")
    if whole > high:
        raise ArgumentError(f"{name} must be at most {high}, got {whole}")
    return whole


def as_frame(value: object, size_px: tuple[int, int]) -> UInt8Array:
    """Return a frame of width and height `size_px`.

    Raises
    ------
    FrameError
        If it is not a colour image of 8 bits, or of another size.
    """
    shape = (size_px[1], size_px[0], 3)
    if isinstance(value, np.ndarray) and value.dtype == np.uint8 and value.shape == shape:
        return value
    got = f"{value.dtype} {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
    raise FrameError(f"frame must be uint8 {shape} as the camera file says, got {got}")


def _is_finite(value: object) -> bool:
    return isinstance(value, (float, numbers.Real)) and math.isfinite(value)


def _shown(value: object) -> str:
    """Describe a value in one line: its type, and its repr if that is short."""
    text = repr(value)
    kind = type(value).__name__
    return f"{kind} {text}" if len(text) <= 60 and "\n" not in text else f"a value of type {kind}"
