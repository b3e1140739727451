"""How much better a pose explains the line points of a picture than chance does.

A pose refined from a prior is judged by the points near the lines that the prior predicts. In a picture of anything,
some of many hundred points lie near any line. Lines that cover a hundredth of the carpet in view explain a hundredth of
points that have nothing to do with them.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.localization.lines.line_map import LineMap

# a line of 3 pixels to either side is met by one in three of its places
_GRID_PX = 8


def nats_beyond_chance(
    pixels: FloatArray, pose: Pose2, camera: PinholeCamera, line_map: LineMap, inlier_px: float
) -> float:
    """Return the log-likelihood ratio a line point of what a pose explains, against points thrown anywhere.

    Points that the pose puts off the field's floor (a room, spectators) count neither for nor against it, unless they
    lie on a line.

    Parameters
    ----------
    pixels : (N, 2) float64
        All line points of the picture.
    pose : Pose2
        The robot's pose in question.
    camera : PinholeCamera
        As held in the frame.
    line_map : LineMap
        Of the field.
    inlier_px : float
        A point within this many pixels of a line is explained.

    Returns
    -------
    float
        0: no more points are explained than chance explains.
    """
    width, height = camera.size_px
    v, u = np.mgrid[_GRID_PX // 2 : height : _GRID_PX, _GRID_PX // 2 : width : _GRID_PX]
    anywhere = np.column_stack([u.ravel(), v.ravel()]).astype(np.float64)
    seen, on_carpet = _explained(pixels, pose, camera, line_map, inlier_px)
    by_chance, places = _explained(anywhere, pose, camera, line_map, inlier_px)
    if not on_carpet:
        return 0.0
    # one place more on a line, and one more beside it: chance is never impossible
    chance = (by_chance + 1) / (places + 2)
    ratio = seen / on_carpet
    if ratio <= chance:
        return 0.0
    others = (1 - ratio) * math.log((1 - ratio) / (1 - chance)) if ratio < 1 else 0.0
    return ratio * math.log(ratio / chance) + others


def _explained(
    pixels: FloatArray, pose: Pose2, camera: PinholeCamera, line_map: LineMap, inlier_px: float
) -> tuple[int, int]:
    """Return how many pixels (N, 2) lie on a line, and how many on a line or the field's floor."""
    floor_m = pose.transform(camera.pixel_to_floor(pixels))
    is_floor = np.isfinite(floor_m).all(axis=1)
    pixels, floor_m = pixels[is_floor], floor_m[is_floor]
    near = line_map.nearest(floor_m)
    foot_px = camera.floor_to_pixel(pose.inverse().transform(floor_m - near.distance_m[:, None] * near.normal))
    # NaN, a line's point that the camera does not show, is far from any pixel
    on_line = np.hypot(*(foot_px - pixels).T) <= inlier_px
    return int(np.count_nonzero(on_line)), int(np.count_nonzero(line_map.counts(floor_m, on_line)))
