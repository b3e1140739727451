"""Predicted feet of a field's walls in a camera's view, and a pinhole camera's tilt by these.

For a low camera, half a degree of tilt changes the range of a board at 3 m by a seventh, but lines near the robot show
little of it. The estimated tilt puts most measured ends of the floor at the predicted feet of walls. Bearings on which
robots or balls hide a foot are outliers.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.polar_view import PolarView


def wall_range_m(walls: FloatArray, foot: Pose2, bearing_rad: FloatArray) -> FloatArray:
    """Return the range of the nearest wall in each direction from a foot, (K,), metres; inf where there is none.

    The walls (W, 4) are segments x0, y0, x1, y1 in the field frame, metres.
    """
    if not len(walls):
        return np.full(len(bearing_rad), np.inf)
    angle = foot.theta_rad + bearing_rad[:, None]
    dx, dy = np.cos(angle), np.sin(angle)
    x0, y0, x1, y1 = walls.T
    ax, ay, bx, by = x0 - foot.x_m, y0 - foot.y_m, x1 - x0, y1 - y0
    with np.errstate(divide="ignore", invalid="ignore"):
        across = dx * by - dy * bx
        away = (ax * by - ay * bx) / across
        along = (ax * dy - ay * dx) / across
    hit = (away > 0) & (along >= 0) & (along <= 1)
    return np.asarray(np.where(hit, away, np.inf).min(axis=1))


def wall_px(walls: FloatArray, robot: Pose2, view: PolarView | FloorView) -> FloatArray:
    """Return the predicted feet of walls, as `radius_px` of each of the view's bearings (K,); NaN without a wall."""
    foot = robot.compose(Pose2(*view.camera.offset_m, 0.0))
    nearest = wall_range_m(walls, foot, view.bearing_rad)
    used = view.columns_in_use
    radius = np.interp(-1.0 / nearest, -1.0 / view.range_m[:used], view.radius_px[:used])
    return read_only(np.where(np.isfinite(nearest), radius, np.nan))


# range of the search, standard deviations of the tilt, and its step
_MAX_STDS = 4.0
_STEP_PX = 0.5
_NOISE_PX = 1.5  # noise of the floor's end at a bearing, by blur and the step between samples
_SIGNS = 8.0  # number of independent bearings, because errors of neighbours are correlated
# least number of bearings with a predicted wall and an end of the floor, and least ratio of inliers
MIN_BEARINGS = 20
_MIN_SUPPORT = 0.25
_MIN_TURN_PX = 1.0  # least change of tilt that is returned, as a shift of the picture


def tilt_by_walls(
    view: FloorView,
    edge_px: FloatArray,
    walls: FloatArray,
    estimate: PoseEstimate,
    camera: PinholeCamera,
) -> float | None:
    """Return the camera's tilt at which the floor ends at the walls (W, 4), radians; None if it would not change.

    `view` and `camera` have the present tilt; `edge_px` (K,) is the floor's end at each bearing, as `radius_px`,
    NaN where none is seen.
    """
    pose, (std_x, std_y, _) = estimate.pose, estimate.std
    predicted = wall_px(walls, pose, view)
    past = edge_px - predicted
    known = np.isfinite(past)
    if np.count_nonzero(known) < MIN_BEARINGS:
        return None
    sway, _ = camera.sway_std_rad
    sway_px = sway * camera.focal_px[1]
    reach = _MAX_STDS * sway_px
    if reach < _STEP_PX:
        return None
    shifts = np.arange(-reach, reach + _STEP_PX, _STEP_PX)
    agree = np.exp(-0.5 * ((past[known] - shifts[:, None]) / _NOISE_PX) ** 2).mean(axis=1)
    # 2 % of the bearings agree by chance
    score = _SIGNS * np.log(agree + 0.02) - 0.5 * (shifts / sway_px) ** 2
    best = int(np.argmax(score))
    if agree[best] < _MIN_SUPPORT:
        return None
    # an error of the pose towards the walls also moves their feet
    c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
    step_m = math.hypot(c * std_x, s * std_y)
    moved = wall_px(walls, Pose2(pose.x_m + step_m * c, pose.y_m + step_m * s, pose.theta_rad), view)
    by_pose = np.abs(moved - predicted)[known]
    pose_px = float(np.nanmedian(by_pose)) if np.isfinite(by_pose).any() else math.inf
    shift_px = float(shifts[best]) * sway_px**2 / (sway_px**2 + pose_px**2)
    if abs(shift_px) < _MIN_TURN_PX:
        return None
    return (camera.tilt_rad or 0.0) - shift_px / camera.focal_px[1]
