"""Compiled vote on which goal is which: whether the frame shows the right colour where a pose predicts a goal.

The same points vote on whether red and blue are swapped in the frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled

Pair = tuple[float, float]
Vector = tuple[float, float, float]
Votes = tuple[int, int, int, int]


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


class GoalPalette(NamedTuple):
    """Colours of the goals under a frame's light.

    Parameters
    ----------
    hues : (3,) float64
        (B - R) / (B + G + R) of the goal at +x, the goal at -x, and white.
    log_ratios : (5, 2) float64
        Logarithms of R/G and B/G: of the goal at +x and at -x, of both with red and blue swapped, and of white.
    """

    hues: FloatArray
    log_ratios: FloatArray


@compiled
def _nearest_ratio(log_ratios: FloatArray, red: float, blue: float) -> int:
    """Row of the palette that is nearest to the logarithms of R/G and B/G."""
    nearest, least = 0, np.inf
    for k in range(log_ratios.shape[0]):
        away = (red - log_ratios[k, 0]) ** 2 + (blue - log_ratios[k, 1]) ** 2
        if away < least:
            nearest, least = k, away
    return nearest


@compiled
def _goal_pixel(camera: MirrorProjection, heading: Pair, x: float, y: float, z: float) -> tuple[int, int]:
    """Pixel of a direction from the viewpoint, robot frame; (-1, -1) where the camera does not see it.

    `heading` is the cosine and the sine of the camera's.
    """
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
    flip, (cos, sin) = 1.0 if camera.mirrored else -1.0, heading
    along, aside = (px * cos + py * sin) / away, (py * cos - px * sin) / away
    u = int(camera.center_px[0] + radius * along + 0.5)
    v = int(camera.center_px[1] + flip * radius * aside + 0.5)
    return u, v


@compiled
def vote_goal_colors(
    frame: UInt8Array,
    pose: Vector,
    points: FloatArray,
    sides: FloatArray,
    camera: MirrorProjection,
    palette: GoalPalette,
    hidden: UInt8Array,
) -> Votes:
    """Count points on the goals that have their own goal's colour, and those that have the other goal's.

    Parameters
    ----------
    frame : (H, W, 3) uint8
    pose : (float, float, float)
        x, y, theta of the robot.
    points : (N, 3) float64
        On the goals' inner walls, field frame, metres.
    sides : (N,) float64
        +1 or -1: which goal each point is on.
    camera : MirrorProjection
        The camera; may be plain.
    palette : GoalPalette
        Colours of the goals; may be plain.
    hidden : (H, W) uint8, or (0, 0)
        Non-zero: neither this pixel nor its neighbours may be looked at.

    Returns
    -------
    (int, int, int, int)
        Points that agree with the pose, and with its half turn, by hue; with the goals' own colours, and with those of
        swapped red and blue, each of the better half. A plain tuple, as making a named one takes as long as ten points.
    """
    camera, palette = MirrorProjection(*camera), GoalPalette(*palette)
    height, width = frame.shape[0], frame.shape[1]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    heading = math.cos(camera.heading_rad), math.sin(camera.heading_rad)
    viewpoint = camera.viewpoint
    hues = palette.hues
    right, wrong = 0, 0
    own_here, own_there, swapped_here, swapped_there = 0, 0, 0, 0
    for n in range(points.shape[0]):
        dx, dy = points[n, 0] - pose[0], points[n, 1] - pose[1]
        x = c * dx + s * dy - viewpoint[0]
        y = -s * dx + c * dy - viewpoint[1]
        z = points[n, 2] - viewpoint[2]
        u, v = _goal_pixel(camera, heading, x, y, z)
        if u < 1 or v < 1 or u >= width - 1 or v >= height - 1:
            continue
        if hidden.shape[0] == height and hidden[v, u] != 0:
            continue
        # one grey level more in each of the nine pixels: no logarithm of zero
        blue, green, red = 0, 9, 0
        is_positive = sides[n] > 0
        for j in range(-1, 2):
            for i in range(-1, 2):
                blue += frame[v + j, u + i, 0]
                green += frame[v + j, u + i, 1]
                red += frame[v + j, u + i, 2]
        log_green = math.log(green)
        nearest = _nearest_ratio(palette.log_ratios, math.log(red + 9.0) - log_green, math.log(blue + 9.0) - log_green)
        own_here += nearest == (0 if is_positive else 1)
        own_there += nearest == (1 if is_positive else 0)
        swapped_here += nearest == (2 if is_positive else 3)
        swapped_there += nearest == (3 if is_positive else 2)
        hue = (blue - red) / (blue + green + red - 8)
        to_positive, to_negative, to_white = abs(hue - hues[0]), abs(hue - hues[1]), abs(hue - hues[2])
        if to_white <= min(to_positive, to_negative):
            continue
        if (to_positive < to_negative) == is_positive:
            right += 1
        else:
            wrong += 1
    return right, wrong, max(own_here, own_there), max(swapped_here, swapped_there)
