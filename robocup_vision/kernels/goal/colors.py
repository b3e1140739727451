"""Compiled vote on which goal is which: whether the frame shows the right colour where a pose predicts a goal."""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from robocup_vision.arrays import FloatArray, UInt8Array


class MirrorProjection(NamedTuple):
    """A mirror camera on its robot, which projects points of space.

    Parameters
    ----------
    viewpoint : (3,) float64
        Robot frame, metres.
    robot_to_camera : (3, 3) float64
        Rotation of directions.
    center_px : (float, float)
        Image of the mirror's axis.
    heading_rad : float
        Bearing of the image's +u direction.
    mirrored : bool
        Whether bearing grows clockwise in the image as shown.
    usable_px : (float, float)
        Least and greatest usable image radius.
    q_step, radius_of_q : float, (Q,) float64
        Image radius tabulated over inverse range.
    """

    viewpoint: FloatArray
    robot_to_camera: FloatArray
    center_px: tuple[float, float]
    heading_rad: float
    mirrored: bool
    usable_px: tuple[float, float]
    q_step: float
    radius_of_q: FloatArray


@njit(cache=True, nogil=True)
def _goal_pixel(camera: MirrorProjection, x: float, y: float, z: float) -> tuple[int, int]:
    """Pixel of a direction from the viewpoint, robot frame; (-1, -1) where the camera does not see it."""
    to_camera = camera.robot_to_camera
    px = to_camera[0, 0] * x + to_camera[0, 1] * y + to_camera[0, 2] * z
    py = to_camera[1, 0] * x + to_camera[1, 1] * y + to_camera[1, 2] * z
    pz = to_camera[2, 0] * x + to_camera[2, 1] * y + to_camera[2, 2] * z
    away = math.sqrt(px * px + py * py)
    if away < 1e-9:
        return -1, -1
    place = -pz / (away * camera.viewpoint[2]) / camera.q_step
    if place < 0.0 or place >= camera.radius_of_q.shape[0] - 1:
        return -1, -1
    radius = camera.radius_of_q[int(place)]
    if radius < camera.usable_px[0] or radius > camera.usable_px[1]:
        return -1, -1
    angle = math.atan2(py, px) - camera.heading_rad
    flip = 1.0 if camera.mirrored else -1.0
    u = int(camera.center_px[0] + radius * math.cos(angle) + 0.5)
    v = int(camera.center_px[1] + flip * radius * math.sin(angle) + 0.5)
    return u, v


@njit(cache=True, nogil=True)
def vote_goal_colors(
    frame: UInt8Array,
    pose: FloatArray,
    points: FloatArray,
    sides: FloatArray,
    camera: MirrorProjection,
    hues: FloatArray,
    hidden: UInt8Array,
) -> tuple[int, int]:
    """Count points on the goals that have their own goal's colour, and those that have the other goal's.

    Parameters
    ----------
    frame : (H, W, 3) uint8
    pose : (3,) float64
        x, y, theta of the robot.
    points : (N, 3) float64
        On the goals' inner walls, field frame, metres.
    sides : (N,) float64
        +1 or -1: which goal each point is on.
    camera : MirrorProjection
        The camera.
    hues : (3,) float64
        (B - R) / (B + G + R) of the goal at +x, the goal at -x, and white.
    hidden : (H, W) uint8, or (0, 0)
        Non-zero: neither this pixel nor its neighbours may be looked at.

    Returns
    -------
    (int, int)
        Votes for this pose and for its half turn.
    """
    height, width = frame.shape[0], frame.shape[1]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    viewpoint = camera.viewpoint
    right, wrong = 0, 0
    for n in range(points.shape[0]):
        dx, dy = points[n, 0] - pose[0], points[n, 1] - pose[1]
        x = c * dx + s * dy - viewpoint[0]
        y = -s * dx + c * dy - viewpoint[1]
        z = points[n, 2] - viewpoint[2]
        u, v = _goal_pixel(camera, x, y, z)
        if u < 1 or v < 1 or u >= width - 1 or v >= height - 1:
            continue
        if hidden.shape[0] == height and hidden[v, u] != 0:
            continue
        blue, red, total = 0.0, 0.0, 1.0
        for j in range(-1, 2):
            for i in range(-1, 2):
                blue += frame[v + j, u + i, 0]
                red += frame[v + j, u + i, 2]
                total += float(frame[v + j, u + i, 0]) + frame[v + j, u + i, 1] + frame[v + j, u + i, 2]
        hue = (blue - red) / total
        to_positive, to_negative, to_white = abs(hue - hues[0]), abs(hue - hues[1]), abs(hue - hues[2])
        if to_white <= min(to_positive, to_negative):
            continue
        if (to_positive < to_negative) == (sides[n] > 0):
            right += 1
        else:
            wrong += 1
    return right, wrong
