"""A pinhole camera's axes in the frame that it stands in, for the kernels that project points of the field."""

from __future__ import annotations

import math

from numba import njit

Axis = tuple[float, float, float]


@njit(cache=True, nogil=True)
def camera_axes(pan_rad: float, tilt_rad: float, roll_rad: float) -> tuple[Axis, Axis, Axis]:
    """Rows of R = Rz(pan) Ry(-tilt) Rx(roll), whose columns are the camera's axes: ahead, left and up."""
    cp, sp = math.cos(pan_rad), math.sin(pan_rad)
    ct, st = math.cos(tilt_rad), math.sin(tilt_rad)
    cr, sr = math.cos(roll_rad), math.sin(roll_rad)
    return (
        (cp * ct, -sp * cr - cp * st * sr, sp * sr - cp * st * cr),
        (sp * ct, cp * cr - sp * st * sr, -cp * sr - sp * st * cr),
        (st, ct * sr, ct * cr),
    )
