"""Poses of ROS in the plane, checked where they come in: what is not finite or was never filled in is none."""

from __future__ import annotations

import math
from typing import Any

from field_models.errors import PacketError
from robocup_vision.geometry import Pose2

# a quaternion shorter than this is no rotation; others are normalised
_MIN_NORM = 1e-3


def place_of(position: Any, orientation: Any) -> tuple[float, float, float | None]:
    """Return where something is, and the direction of its x axis.

    Returns
    -------
    (float, float, float or None)
        x and y; the heading, None where the orientation is no rotation: not finite, or 0, 0, 0, 0.

    Raises
    ------
    PacketError
        If the position is not finite, or position and orientation are 0 alike: nobody has filled them in.
    """
    x_m, y_m, z_m = float(position.x), float(position.y), float(position.z)
    if not all(map(math.isfinite, (x_m, y_m, z_m))):
        raise PacketError(f"the position is not finite ({x_m:g}, {y_m:g}, {z_m:g})")
    heading_rad = heading_of(orientation)
    if heading_rad is None and x_m == y_m == z_m == 0.0:
        raise PacketError("position and orientation are all 0")
    return x_m, y_m, heading_rad


def heading_of(orientation: Any) -> float | None:
    """Return the direction of the x axis that a geometry_msgs/Quaternion turns; None where it is no rotation."""
    x, y, z, w = (float(getattr(orientation, name)) for name in "xyzw")
    norm = math.hypot(x, y, z, w)
    if not math.isfinite(norm) or norm < _MIN_NORM:
        return None
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def pose_of(message: Any) -> Pose2:
    """Return the pose in the plane of a geometry_msgs/Pose: its place, and its x axis' direction.

    Raises
    ------
    PacketError
        If it is not finite, or its orientation is no rotation.
    """
    x_m, y_m, heading_rad = place_of(message.position, message.orientation)
    if heading_rad is None:
        q = message.orientation
        raise PacketError(f"the orientation {q.x:g}, {q.y:g}, {q.z:g}, {q.w:g} is no rotation")
    return Pose2(x_m, y_m, heading_rad)
