"""A pinhole camera's rotation and its ideal projection, for one camera or many at once.

Camera frame: x ahead along the optical axis, y left, z up. Ideal pixels are those of a lens without distortion.
`kernels.algebra.pinhole` holds the same for compiled code.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray

# nearer to the camera's plane than this a point has no pixel
_MIN_DEPTH_M = 1e-6


def camera_rotation(pan_rad: npt.ArrayLike, tilt_rad: npt.ArrayLike, roll_rad: npt.ArrayLike) -> FloatArray:
    """Rotation (..., 3, 3) from the camera frame into that of the angles (...), Rz(pan) Ry(-tilt) Rx(roll).

    Both frames are x forward, y left, z up; a positive tilt looks up. All three angles have one shape.
    """
    cp, sp = np.cos(pan_rad), np.sin(pan_rad)
    ct, st = np.cos(tilt_rad), np.sin(tilt_rad)
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    rotation = np.empty((*np.shape(cp), 3, 3))
    rotation[..., 0, 0], rotation[..., 0, 1], rotation[..., 0, 2] = (
        cp * ct,
        -sp * cr - cp * st * sr,
        sp * sr - cp * st * cr,
    )
    rotation[..., 1, 0], rotation[..., 1, 1], rotation[..., 1, 2] = (
        sp * ct,
        cp * cr - sp * st * sr,
        -cp * sr - sp * st * cr,
    )
    rotation[..., 2, 0], rotation[..., 2, 1], rotation[..., 2, 2] = st, ct * sr, ct * cr
    return rotation


def project_ideal(
    focal_px: tuple[float | FloatArray, float | FloatArray], center_px: tuple[float, float], points_m: npt.ArrayLike
) -> FloatArray:
    """Ideal pixels (..., 2) of points (..., 3) of the camera frame, metres; NaN behind the camera.

    Parameters
    ----------
    focal_px : (float or (...), float or (...))
        Focal length along u and v.
    center_px : (float, float)
        Image of the optical axis.
    points_m : (..., 3) float64
        Ahead, left and up.
    """
    points = np.asarray(points_m, dtype=np.float64)
    depth = np.where(points[..., 0] > _MIN_DEPTH_M, points[..., 0], np.nan)
    (fu, fv), (cu, cv) = focal_px, center_px
    return np.stack([cu - fu * points[..., 1] / depth, cv - fv * points[..., 2] / depth], axis=-1)
