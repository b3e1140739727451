"""Calibration of a forward camera that a neck may turn, from pictures of a goal and its surroundings on the field.

A goal determines the camera's place, tilt and roll in each picture. From these, camera and poses are fitted together to
all visible edges (`joint_fit`), with tilt and roll free in each picture.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.forward.calibrator import Calibrator, Locate
from robocup_vision.calibration.forward.joint_fit import JointFit, Sighting
from robocup_vision.calibration.forward.starts import KnownOfCamera, starts_of
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges import tables
from robocup_vision.localization.forward import GoalLocalizer
from robocup_vision.localization.localizer import frame_alone
from robocup_vision.localization.model_edges.field_edges import field_edges

# standard deviations of a start: logarithm of the focal length, and height; goals are not found with larger errors
_FOCAL_STD, _HEIGHT_STD_M = 0.05, 0.03
# standard deviation of the tilt of a camera on a neck or a walking body
_NECK_STD_RAD = 0.5
# greatest difference of the tilt between pictures of a camera that is fixed on its robot
_MAX_TILT_SPREAD_RAD = math.radians(1.0)


def calibrate_by_goals(
    field: Field,
    frames: Mapping[int, UInt8Array],
    start: PinholeCamera | KnownOfCamera,
    prior: Mapping[int, Pose2],
    trials: StartTrials,
) -> JointFit | NotCalibrated:
    """Calibrate a camera, which a neck may turn, from goals and the edges around them.

    Parameters
    ----------
    field : Field
        A field with goals of posts and a bar.
    frames : mapping of int to (H, W, 3) uint8
        BGR, by index.
    prior : mapping of int to Pose2
        Approximate camera poses (0.4 m, 9 degrees), by index, as far as known. A picture with one needs
        only lines, and no goal.

    Raises
    ------
    ArgumentError
        If the field has no goals of posts and a bar.
    """
    prepare("pinhole_goal")
    height, width = next(iter(frames.values())).shape[:2]
    starts = starts_of((width, height), replace(start, tilt_rad=0.0))
    fixed = Calibrator(field, frames, prior, _GoalLocator(field))
    found = replace(fixed, sway_std_rad=_NECK_STD_RAD).best(starts, trials)
    if not found:
        return found
    tilts = np.array([held[tables.TILT] for held in found.unknowns.values()])
    if len(tilts) > 1 and float(np.abs(tilts - np.median(tilts)).max()) < _MAX_TILT_SPREAD_RAD:
        return fixed.again(found) or found
    return replace(found, camera=replace(found.camera, tilt_rad=None, roll_rad=None))


@dataclass(frozen=True, eq=False)
class _GoalLocator:
    """Locates cameras of unknown tilt by goals and the lines around them."""

    field: Field
    nothing: str = "no goal is found in any of the images, whatever the focal length may be"

    def of_start(self, camera: PinholeCamera) -> Locate:
        """Return a function that locates a start camera."""
        loose = replace(
            camera,
            tilt_rad=None,
            roll_rad=None,
            pan_rad=0.0,
            offset_m=(0.0, 0.0),
            height_std_m=_HEIGHT_STD_M,
            focal_std_px=_FOCAL_STD * camera.focal_px[0],
        )
        localizer, edges = GoalLocalizer(self.field, loose), field_edges(self.field)

        def locate(frame: UInt8Array, near: Pose2 | None) -> tuple[float, Sighting] | None:
            found = localizer.locate(frame_alone(frame, loose), near)
            held = found.camera
            if isinstance(found.pose, NotLocated) or not isinstance(held, PinholeCamera):
                return None
            # among starts that find equally many goals, the one with the least deviation from its prior is best
            longer = math.log(held.focal_px[0] / camera.focal_px[0])
            moved = max(abs(longer) / _FOCAL_STD, abs(held.height_m - camera.height_m) / _HEIGHT_STD_M)
            unknowns = np.array([*found.pose.pose.array, held.tilt_rad, held.roll_rad, held.height_m, 0.0])
            return math.exp(-0.5 * moved**2), Sighting(frame, unknowns, edges)

        return locate

    def of_fit(self, fit: JointFit) -> Locate:
        """Return a function that locates a fitted camera."""
        return self.of_start(fit.camera)
