"""Evidence of a frame about a pinhole camera's lens and mounting, from the residuals of the field's edges.

The prior of the body's sway separates tilt, roll and height at rest from their deviations in one frame.
"""

from __future__ import annotations

import math

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.edge_points import EdgePointFinder
from robocup_vision.calibration.forward_parameters import CENTER, HEIGHT, LINE_WIDTH, LOG_FOCAL, ForwardParameters
from robocup_vision.calibration.least_squares import POSE_PRECISION, FrameEquations, Residuals
from robocup_vision.calibration.online.evidence import Belief, fit_frame
from robocup_vision.calibration.online.settings import OnlineSettings
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.camera.pinhole import SWAY_STD_RAD, PinholeCamera
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.model_edges.settings import DESIGN_WIDTH_PX
from robocup_vision.view import View

_ANGLES = slice(0, 2)


class PinholeEvidence:
    """Computes evidence from frames of one pinhole camera.

    The parameters: tilt, roll (rad) and height (m) at rest, logarithm of the focal length's scale, centre u, v (px).

    Parameters
    ----------
    camera : PinholeCamera
        The camera of its file, with a known tilt.
    """

    slices = (CENTER, _ANGLES, LOG_FOCAL)
    # even an inaccurate pinhole camera locates the robot
    tries_others = False

    def __init__(self, field: Field, camera: PinholeCamera, mask: UInt8Array | None, settings: OnlineSettings) -> None:
        own = settings.pinhole
        self._settings, self._file = own, camera
        self._parameters = ForwardParameters(camera, bends=False)
        px = camera.size_px[0] / DESIGN_WIDTH_PX
        focal_px = math.sqrt(camera.focal_px[0] * camera.focal_px[1])
        focal_std = camera.focal_std_px / focal_px if camera.focal_std_px else own.focal_std
        self.start = self.vector(camera)
        angle, center = own.tilt_std_rad, own.center_std_px * px
        self.std = np.array([angle, angle, own.height_std_m, focal_std, center, center])
        # a knock does not change the lens
        self.knock_std = np.array([angle, angle, own.height_std_m, 0.0, center, center])
        self.reach = 6.0 * self.std
        self.reach[CENTER], self.reach[_ANGLES] = settings.max_center_px * px, settings.max_tilt_rad
        sway = max(camera.sway_std_rad[1], SWAY_STD_RAD)
        self._own = np.array([POSE_PRECISION] * 3 + [sway**-2, sway**-2, own.sway_std_m**-2])
        self._finder = EdgePointFinder(field, camera.size_px[0], mask)
        self._reach_px = own.reach_px * px
        # time (s) of the last view, and the camera's heading, tilt and roll in it
        self._held: tuple[float, tuple[float, float, float]] | None = None
        self._turn_radps = 0.0
        self._lens, self._lens_of = lens_table(camera), self.start.copy()

    def vector(self, camera: PinholeCamera) -> FloatArray:
        """Return the parameters (6,) of a camera."""
        return self._parameters.vector(camera)[:LINE_WIDTH]

    def camera(self, vector: FloatArray) -> PinholeCamera:
        """Return the camera of parameters (6,)."""
        return self._parameters.camera(vector)

    def shift_px(self, camera: PinholeCamera, other: PinholeCamera) -> float:
        """Greatest distance, pixels, between the images of one place on the floor or far away in two cameras."""
        width, height = camera.size_px
        across, down = np.linspace(0.1, 0.9, 4) * width, np.linspace(0.1, 0.9, 4) * height
        pixels = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
        floor = camera.pixel_to_floor(pixels)
        moved = np.where(
            np.isfinite(floor).all(axis=1, keepdims=True),
            other.floor_to_pixel(np.where(np.isfinite(floor), floor, 1.0)),
            other.ray_to_pixel(camera.pixel_to_ray(pixels)),
        )
        return float(np.nanmax(np.hypot(*(moved - pixels).T)))

    def watch(self, view: View) -> None:
        """Update the camera's turning rate with a view."""
        held = view.camera
        if not view.pose or not isinstance(held, PinholeCamera) or view.t_s is None:
            self._held = None
            return
        angles = (view.pose.pose.theta_rad + (held.pan_rad or 0.0), held.tilt_rad or 0.0, held.roll_rad or 0.0)
        self._turn_radps = 0.0
        if self._held is not None and view.t_s > self._held[0]:
            heading, *others = (wrap_angle(now - before) for now, before in zip(angles, self._held[1], strict=True))
            # frames of a camera file with a readout time were straightened, up to this ratio
            left = self._settings.straightened_to if self._file.readout_s else 1.0
            self._turn_radps = math.hypot(left * heading, *others) / (view.t_s - self._held[0])
        self._held = (view.t_s, angles)

    def of(self, frame: UInt8Array, view: View, belief: Belief) -> FrameEquations | None:
        """Return a frame's evidence, see `EvidenceMaker`."""
        held = view.camera
        assert isinstance(held, PinholeCamera)
        assert view.pose
        return self.equations(frame, held, view.pose.pose.compose(held.camera_in_robot), belief)

    def equations(self, frame: UInt8Array, held: PinholeCamera, pose: Pose2, belief: Belief) -> FrameEquations | None:
        """Return a frame's equations about the belief's start and a camera's pose on the field; None as `of`.

        The nuisance parameters are the camera's pose, and the body's sway in tilt, roll and height.

        Parameters
        ----------
        held : PinholeCamera
            The camera in this frame.
        """
        mounting = np.array([held.tilt_rad or 0.0, held.roll_rad or 0.0, held.height_m])
        if not np.array_equal(self._lens_of, belief.start):
            self._lens, self._lens_of = lens_table(self.camera(belief.start)), belief.start.copy()
        unknowns = np.array([*pose.array, *mounting, 0.0])
        points = self._finder.find(frame, self._lens, unknowns, self._reach_px)
        if len(points.feature) < self._settings.robust.min_points:
            return None
        rows = np.hstack([points.by_camera, points.by_frame])

        def points_at(step: FloatArray) -> Residuals:
            return Residuals(points.residual(rows @ step), points.by_camera, points.by_frame, points.feature)

        sway = np.concatenate([np.zeros(3), mounting - belief.start[: HEIGHT + 1]])
        # standard deviation of the shift of image rows, which are uniformly distributed over the readout
        readout_s = self._file.readout_s or self._settings.readout_s
        skew_px = self._lens[0] * self._turn_radps * readout_s / math.sqrt(12.0)
        return fit_frame(points_at, belief, self._own, sway, self._settings.robust, skew_px)
