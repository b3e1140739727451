"""A pinhole camera's tilt in one frame by the feet of walls or boards, where the pose is known.

Half a degree of tilt moves a board 3 m from a low camera by a seventh. Lines near the robot say little of it. The floor
ends where the walls stand: the tilt that puts most of the seen ends there is the frame's. Robots and balls hide some of
the feet, and those bearings agree on nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.wall_ranges import wall_px
from robocup_vision.perception.floor_view import FloorView


@dataclass(frozen=True, slots=True)
class WallTiltSettings:
    """Settings of `tilt_by_walls`."""

    sway_std_rad: float = 0.01  #: of the tilt, where the camera file gives no `roll_std_rad`
    #: so far the tilt is searched, standard deviations, in steps of so many pixels
    max_stds: float = 4.0
    step_px: float = 0.5
    noise_px: float = 1.5  #: of where the floor ends in one bearing: blur, and the step between samples
    signs: float = 8.0  #: independent bearings: neighbours err together
    #: bearings in which a wall is predicted and floor ends, and the ratio of those that must agree on a tilt
    min_bearings: int = 20
    min_support: float = 0.25
    min_turn_px: float = 1.0  #: less is not worth another look at the floor


def tilt_by_walls(
    view: FloorView,
    edge_px: FloatArray,
    walls: FloatArray,
    estimate: PoseEstimate,
    camera: PinholeCamera,
    settings: WallTiltSettings = WallTiltSettings(),
) -> float | None:
    """Return the camera's tilt by which the floor ends at the walls, radians; None where that tells nothing new.

    Parameters
    ----------
    view : FloorView
        Of the camera as held so far.
    edge_px : (K,) float64
        Where the floor ends at each bearing, as `radius_px`; NaN where none is seen.
    camera : PinholeCamera
        As held so far.
    """
    pose, (std_x, std_y, _) = estimate.pose, estimate.std
    predicted = wall_px(walls, pose, view)
    past = edge_px - predicted
    known = np.isfinite(past)
    if np.count_nonzero(known) < settings.min_bearings:
        return None
    sway, _ = camera.sway_std_rad(settings.sway_std_rad)
    sway_px = sway * camera.focal_px[1]
    reach = settings.max_stds * sway_px
    if reach < settings.step_px:
        return None
    shifts = np.arange(-reach, reach + settings.step_px, settings.step_px)
    agree = np.exp(-0.5 * ((past[known] - shifts[:, None]) / settings.noise_px) ** 2).mean(axis=1)
    # a fiftieth agrees by chance
    score = settings.signs * np.log(agree + 0.02) - 0.5 * (shifts / sway_px) ** 2
    best = int(np.argmax(score))
    if agree[best] < settings.min_support:
        return None
    # what the pose may be off towards the walls moves their feet, too
    c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
    step_m = math.hypot(c * std_x, s * std_y)
    moved = wall_px(walls, Pose2(pose.x_m + step_m * c, pose.y_m + step_m * s, pose.theta_rad), view)
    by_pose = np.abs(moved - predicted)[known]
    pose_px = float(np.nanmedian(by_pose)) if np.isfinite(by_pose).any() else math.inf
    shift_px = float(shifts[best]) * sway_px**2 / (sway_px**2 + pose_px**2)
    if abs(shift_px) < settings.min_turn_px:
        return None
    return (camera.tilt_rad or 0.0) - shift_px / camera.focal_px[1]
