"""A pinhole camera in compiled code: its axes, and points of the field in its frame and as ideal pixels.

Camera frame: x ahead along the optical axis, y left, z up. Ideal pixels are those of a lens without distortion.
`camera.pinhole` has the same for NumPy arrays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled

Axis = tuple[float, float, float]


class PinholeView(NamedTuple):
    """The parameters of a robot's camera that the kernels need.

    robot_to_camera : (3, 3) float64, rotation of directions.
    viewpoint_m : (3,) float64, centre of projection in the robot frame.
    focal_px, center_px : (2,) float64, along u and v.
    """

    robot_to_camera: FloatArray
    viewpoint_m: FloatArray
    focal_px: FloatArray
    center_px: FloatArray


@compiled
def camera_axes(pan_rad: float, tilt_rad: float, roll_rad: float) -> tuple[Axis, Axis, Axis]:
    """Return the rows of R = Rz(pan) Ry(-tilt) Rx(roll), whose columns are the camera's axes ahead, left and up."""
    cp, sp = math.cos(pan_rad), math.sin(pan_rad)
    ct, st = math.cos(tilt_rad), math.sin(tilt_rad)
    cr, sr = math.cos(roll_rad), math.sin(roll_rad)
    return (
        (cp * ct, -sp * cr - cp * st * sr, sp * sr - cp * st * cr),
        (sp * ct, cp * cr - sp * st * sr, -cp * sr - sp * st * cr),
        (st, ct * sr, ct * cr),
    )


@compiled
def in_camera(rotation: tuple[Axis, Axis, Axis], x: float, y: float, z: float) -> Axis:
    """Transform a vector into the camera frame: components ahead, left and up."""
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = rotation
    return x * r00 + y * r10 + z * r20, x * r01 + y * r11 + z * r21, x * r02 + y * r12 + z * r22


@compiled
def point_in_camera(view: PinholeView, c: float, s: float, x: float, y: float, z: float) -> Axis:
    """Return a point of the field in the camera frame.

    c, s : cosine and sine of the robot's heading.
    x, y : the point minus the robot's position, field frame, metres; z : its height above the floor.
    """
    turn, viewpoint = view.robot_to_camera, view.viewpoint_m
    px, py, pz = c * x + s * y - viewpoint[0], c * y - s * x - viewpoint[1], z - viewpoint[2]
    return (
        turn[0, 0] * px + turn[0, 1] * py + turn[0, 2] * pz,
        turn[1, 0] * px + turn[1, 1] * py + turn[1, 2] * pz,
        turn[2, 0] * px + turn[2, 1] * py + turn[2, 2] * pz,
    )


@compiled
def ideal_pixel(
    fu: float, fv: float, cu: float, cv: float, ahead: float, left: float, up: float
) -> tuple[float, float]:
    """Return the pixel (u, v) of a point of the camera frame; `ahead` must be positive."""
    return cu - fu * left / ahead, cv - fv * up / ahead
