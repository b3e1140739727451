"""Estimates the robot's motion from successive views of a mirror camera, without odometry or in addition to it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.checks import require_positive
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.errors import OdometryNoise
from robocup_vision.mapping.ego_motion import EgoMotion, Motion
from robocup_vision.view import View


@dataclass(frozen=True, slots=True)
class ViewMotionSettings:
    """Settings of `ViewMotion`.

    Parameters
    ----------
    edge_std_px : float
        Standard deviation of the floor's edge in the image, as measured against the truth in rendered images.
    max_range_m : float
        Greatest range of an edge; farther away a pixel is wider than a robot.
    velocity_change_mps, turn_change_rps : float
        Standard deviations of the change of velocity and turn rate from one frame to the next, used without odometry.

    Raises
    ------
    ArgumentError
        A value is not positive or not finite.
    """

    edge_std_px: float = 0.16
    max_range_m: float = 20.0
    velocity_change_mps: float = 0.3
    turn_change_rps: float = 1.0

    def __post_init__(self) -> None:
        require_positive(self, "edge_std_px", "max_range_m", "velocity_change_mps", "turn_change_rps")


class ViewMotion:
    """Turns successive views into motions with covariances; one object for each robot.

    Parameters
    ----------
    ego_motion : EgoMotion, optional
        Compares the floor's edge with that of earlier frames. It must have as many bearings as the views' polar samples
        (`view.polar.bearings`). By default it is made at the first view.
    odometry : OdometryNoise, optional
        Errors of the odometry.
    settings : ViewMotionSettings, optional
        Settings of the views.
    """

    def __init__(
        self,
        ego_motion: EgoMotion | None = None,
        odometry: OdometryNoise | None = None,
        settings: ViewMotionSettings | None = None,
    ) -> None:
        self.ego_motion = ego_motion
        self.odometry = odometry or OdometryNoise()
        self.settings = settings or ViewMotionSettings()
        self.forget()

    def forget(self) -> None:
        """Forget all views: the next one is the first."""
        if self.ego_motion is not None:
            self.ego_motion.forget()
        self._t_s: float | None = None
        self._velocity = np.zeros(3)

    def update(self, view: View, odometry: Pose2 | None = None) -> Motion:
        """Return the robot's motion since the view before.

        Parameters
        ----------
        view : View
            View of a mirror camera, with the time of its frame.
        odometry : Pose2, optional
            The motion since the view before as the wheels measure it, in the robot frame then. By default constant
            velocity is expected.

        Returns
        -------
        Motion
            Motion in the robot's frame at the view before; for the first view, the expected one.

        Raises
        ------
        ArgumentError
            If the camera is no mirror camera, the view has no time, its number of bearings differs from those before,
            or the time does not increase.
        """
        camera, t_s = view.camera, view.t_s
        if not isinstance(camera, OmniCamera):
            raise ArgumentError("motion from views needs a mirror camera, whose view is all around")
        if t_s is None:
            raise ArgumentError("motion from views needs the time of a frame: hand t_s to look")
        seconds = 1.0 if self._t_s is None else t_s - self._t_s
        if not seconds > 0.0:
            raise ArgumentError(
                f"t_s must be later than that of the view before, got {t_s!r} after {self._t_s!r}: forget() begins anew"
            )
        expected, covariance = self._expected(odometry, seconds)
        inverse, std = self._profile(view, camera)
        if self.ego_motion is None:
            self.ego_motion = EgoMotion(len(inverse))
        # the ranges of profiles are measured from the camera's axis
        camera_in_robot = camera.camera_in_robot
        by_robot = _shift_of_arm(expected, camera_in_robot)
        to_camera = np.linalg.inv(by_robot)
        found = self.ego_motion.update(
            inverse,
            std,
            camera_in_robot.inverse().compose(expected).compose(camera_in_robot),
            to_camera @ covariance @ to_camera.T,
            t_s,
        )
        motion = camera_in_robot.compose(found.motion).compose(camera_in_robot.inverse())
        if self._t_s is not None:
            self._velocity = motion.array / seconds
        self._t_s = t_s
        by_robot = _shift_of_arm(motion, camera_in_robot)
        pose = camera_in_robot.compose(found.pose).compose(camera_in_robot.inverse())
        return Motion(motion, by_robot @ found.covariance @ by_robot.T, found.profiles, found.agreement, pose)

    def _expected(self, odometry: Pose2 | None, seconds: float) -> tuple[Pose2, FloatArray]:
        """Return the motion that is expected before the comparison of views, and its covariance (3, 3)."""
        if odometry is not None:
            slip = self.odometry.slip(odometry)
            tiny = 1e-12 * np.eye(3)
            return odometry, np.asarray(slip @ slip.T + self.odometry.push(seconds) + tiny)
        settings = self.settings
        std = seconds * np.array([settings.velocity_change_mps, settings.velocity_change_mps, settings.turn_change_rps])
        moved = self._velocity * seconds if self._t_s is not None else np.zeros(3)
        return Pose2(*moved.tolist()), np.diag(std**2)

    def _profile(self, view: View, camera: OmniCamera) -> tuple[FloatArray, FloatArray]:
        """Return inverse ranges (K,) of the floor's edge from the camera's axis, NaN for none, and their errors."""
        bearing = view.polar.bearing_rad if view.polar is not None else np.empty(0)
        offset = np.array(camera.offset_m)

        def inverse(radius_px: FloatArray) -> FloatArray:
            floor = camera.pixel_to_floor(camera.polar_to_pixel(bearing, radius_px)) - offset
            return np.asarray(1.0 / np.hypot(floor[:, 0], floor[:, 1]))

        radius = np.asarray(view.boundary_radius_px)
        with np.errstate(invalid="ignore"):
            value = inverse(radius)
            std = np.abs(inverse(radius + 0.5) - inverse(radius - 0.5)) * self.settings.edge_std_px
            known = (value > 1.0 / self.settings.max_range_m) & np.isfinite(std) & (std > 0.0)
        return np.where(known, value, np.nan), np.where(known, std, 1.0)


def _shift_of_arm(motion: Pose2, camera_in_robot: Pose2) -> FloatArray:
    """Return the derivative (3, 3) of the robot's motion by the camera's, for a camera beside the robot's centre."""
    c, s = math.cos(motion.theta_rad), math.sin(motion.theta_rad)
    x, y = camera_in_robot.x_m, camera_in_robot.y_m
    return np.array([[1.0, 0.0, s * x + c * y], [0.0, 1.0, -c * x + s * y], [0.0, 0.0, 1.0]])
