"""Makes sensor_msgs/CameraInfo of our cameras, and compares received ones with a camera file."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.messages.types import header, make

# largest distance of a point between two descriptions of the same lens, as a fraction of the image's width
_SAME_LENS = 0.005
_GRID = 9
_BROWN, _FISHEYE = ("plumb_bob", "rational_polynomial"), ("equidistant", "fisheye")


def camera_info(camera: OmniCamera | PinholeCamera, t_s: float, frame_id: str) -> Any:
    """Return sensor_msgs/CameraInfo; a mirror camera, which cannot be rectified, has no distortion model."""
    width, height = camera.size_px
    k, p, d, model = np.zeros(9), np.zeros(12), np.empty(0), ""
    if isinstance(camera, PinholeCamera):
        (fx, fy), (cx, cy) = camera.focal_px, camera.center_px
        k = np.array([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])
        p = np.array([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0])
        d, model = _lens_of(camera)
    whole = (0, 0, 0, 0, False)
    r = np.eye(3).ravel() if isinstance(camera, PinholeCamera) else np.zeros(9)
    return make("sensor_msgs/msg/CameraInfo", header(t_s, frame_id), height, width, model, d, k, r, p, 0, 0, whole)


def _lens_of(camera: PinholeCamera) -> tuple[FloatArray, str]:
    """Return the coefficients and the distortion model; both empty for a projection that ROS does not know."""
    if isinstance(camera, FisheyeCamera):
        known = camera.projection != "equisolid"
        return np.array(camera.coefficients if known else ()), "equidistant" if known else ""
    d = np.array(camera.distortion or (0.0,) * 5)
    d = np.append(d, 0.0) if len(d) == 4 else d
    return d, "rational_polynomial" if len(d) == 8 else "plumb_bob"


def camera_info_problem(message: Any, camera: OmniCamera | PinholeCamera) -> str:
    """Return how a sensor_msgs/CameraInfo differs from a camera file; empty if it does not.

    Size, focal length and centre are compared for the received images, with region of interest and binning. Lenses are
    compared by where both project the same points. For a mirror camera, and if the focal length of the camera_info is
    0, which means that it is not calibrated, only the size is compared.
    """
    binning = np.array([max(int(message.binning_x), 1), max(int(message.binning_y), 1)])
    roi, begin_px = message.roi, np.zeros(2)
    full = np.array([int(message.width), int(message.height)])
    if roi.width and roi.height:
        full, begin_px = np.array([int(roi.width), int(roi.height)]), np.array([int(roi.x_offset), int(roi.y_offset)])
    size = full // binning
    is_cut = bool((binning > 1).any() or (roi.width and roi.height))
    cut = " (after binning and region of interest)" if is_cut else ""
    if tuple(size.tolist()) != tuple(camera.size_px):
        return f"camera_info says {size[0]}x{size[1]}{cut}, the camera file {camera.size_px[0]}x{camera.size_px[1]}"
    k, d = np.asarray(message.k, dtype=np.float64), np.asarray(message.d, dtype=np.float64)
    if not (np.isfinite(k).all() and np.isfinite(d).all()):
        return "camera_info holds numbers that are not finite"
    if not isinstance(camera, PinholeCamera) or not k[0] > 0.0:
        return ""
    if isinstance(camera, FisheyeCamera) and not message.distortion_model:
        # a projection that ROS does not know
        return ""
    focal_px, center_px = k[[0, 4]] / binning, (k[[2, 5]] - begin_px) / binning
    model = str(message.distortion_model).lower()
    if d.any() and model not in (*_BROWN, *_FISHEYE):
        return f"camera_info has the distortion model {message.distortion_model!r}, which cannot be compared"
    apart_px = _apart_px(camera, focal_px, center_px, d, is_fisheye=model in _FISHEYE)
    if apart_px <= _SAME_LENS * camera.size_px[0]:
        return ""
    said, ours = (
        f"{focal[0]:.1f}, {focal[1]:.1f} and centre {center[0]:.1f}, {center[1]:.1f}"
        for focal, center in ((focal_px, center_px), (camera.focal_px, camera.center_px))
    )
    lens = f"{model or 'no distortion model'} {_listed(d)}"
    return (
        f"camera_info{cut} shows points up to {apart_px:.0f} px from where the camera file does: it says focal length"
        f" {said}, {lens}; the camera file {ours}, distortion {_listed(np.array(camera.distortion))}"
    )


def _apart_px(
    camera: PinholeCamera, focal_px: FloatArray, center_px: FloatArray, d: FloatArray, *, is_fisheye: bool
) -> float:
    """Return the largest distance between the projections of a point by a lens and by the camera."""
    width, height = camera.size_px
    u, v = np.meshgrid(np.linspace(0.0, width - 1.0, _GRID), np.linspace(0.0, height - 1.0, _GRID))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    ray = camera.pixel_to_camera_ray(pixels)
    # OpenCV can only project points in front of the camera
    seen = np.isfinite(ray).all(axis=1) & (ray[:, 0] > 0.05)
    # in the axes of OpenCV: right, down, ahead
    points = np.ascontiguousarray(ray[seen][:, [1, 2, 0]] * (-1.0, -1.0, 1.0))[:, None]
    matrix = np.array([[focal_px[0], 0.0, center_px[0]], [0.0, focal_px[1], center_px[1]], [0.0, 0.0, 1.0]])
    still = np.zeros(3)
    if is_fisheye:
        coefficients = np.zeros(4)
        coefficients[: len(d)] = d[:4]
        shown = cv2.fisheye.projectPoints(points, still, still, matrix, coefficients)[0]
    else:
        shown = cv2.projectPoints(points, still, still, matrix, d if len(d) in (4, 5, 8, 12, 14) else np.zeros(5))[0]
    return float(np.max(np.linalg.norm(shown.reshape(-1, 2) - pixels[seen], axis=1), initial=0.0))


def _listed(values: FloatArray) -> str:
    return f"[{', '.join(f'{value:.4g}' for value in values)}]"
