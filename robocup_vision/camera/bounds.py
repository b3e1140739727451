"""Bounds of a camera's lengths and angles, which detect values in millimetres or degrees."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from field_models.errors import ArgumentError
from robocup_vision.geometry import in_degrees

# greatest height of a robot's camera; a viewpoint from a mirror's fitted curve may be higher
_MAX_LENGTH_M, _MAX_VIEWPOINT_M = 3.0, 100.0
_MAX_STD_RAD = 0.5
_POSITIVE = ("height_m", "viewpoint_height_m")


class Problem(NamedTuple):
    """Problem of a camera's value, with a hint on its cause."""

    what: str
    hint: str = ""


def problem_of(name: str, value: float | tuple[float, ...] | None) -> Problem | None:
    """Return the problem of a camera's length or angle; None if there is none, or the value is unknown.

    The key's name says what it is: a length ends in "_m", an angle in "_rad", a standard deviation in "_std_m" and the
    like.
    """
    for one in value if isinstance(value, tuple) else (value,):
        if one is None:
            continue
        if name in _POSITIVE and not one > 0:
            return Problem("must be positive")
        if name.endswith(("_std_m", "_std_rad", "_std_px", "_s")) and not 0 <= one < math.inf:
            return Problem("must not be negative")
        if name.endswith("_std_rad") and one > _MAX_STD_RAD:
            return Problem(f"must be in radians, at most {_MAX_STD_RAD:g}", in_degrees(one))
        most_m = _MAX_VIEWPOINT_M if name == "viewpoint_height_m" else _MAX_LENGTH_M
        if name.endswith("_m") and not abs(one) <= most_m:
            meant = f"; in millimetres it is {1e-3 * one:g} m, in centimetres {1e-2 * one:g} m"
            return Problem(f"must be in metres, at most {most_m:g}", meant)
        if name == "tilt_rad" and not abs(one) <= math.pi / 2:
            return Problem("must lie between -pi/2 and pi/2", in_degrees(one))
        if name.endswith("_rad") and not abs(one) <= math.tau:
            return Problem("must be in radians, within one turn", in_degrees(one))
    return None


def require_bounds(values: Mapping[str, float | tuple[float, ...] | None]) -> None:
    """Check lengths and angles of a camera by their names.

    Raises
    ------
    ArgumentError
        If a value is out of its bounds.
    """
    for name, value in values.items():
        problem = problem_of(name, value)
        if problem is not None:
            raise ArgumentError(f"{name} {problem.what}, got {value!r}{problem.hint}")
