"""Evidence of a frame about a mirror camera's centre, tilt and curve, from the floor's outline and lines."""

from __future__ import annotations

import math

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.least_squares import POSE_PRECISION, FrameEquations, Residuals
from robocup_vision.calibration.omni.fit import FieldShape, JointFit, Points
from robocup_vision.calibration.omni.model import CENTER, SCALE, TILT, CameraModel
from robocup_vision.calibration.online.evidence import Belief, fit_frame
from robocup_vision.calibration.online.settings import OnlineSettings
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.estimates import PoseEstimate
from robocup_vision.perception.line_points import LineFinder
from robocup_vision.view import View

# height of the image to which the pixels of the settings refer
_DESIGN_HEIGHT_PX = 220.0


class MirrorEvidence:
    """Computes evidence from frames of one mirror camera.

    The parameters: centre u, v (px), tilt about x, y (rad), and the logarithm of the curve's magnification.
    """

    slices = (CENTER, TILT, SCALE)
    tries_others = True

    def __init__(self, field: Field, camera: OmniCamera, mask: UInt8Array | None, settings: OnlineSettings) -> None:
        prepare("mirror_field")
        mirror = settings.mirror
        self._field, self._settings = field, mirror
        self._shape = FieldShape(field)
        self._finder = LineFinder(camera, field.line_width_m, mask)
        self._model = CameraModel(camera, "magnified")
        self._px = min(camera.size_px) / _DESIGN_HEIGHT_PX
        self.start = self._model.vector(camera)
        self.std = np.empty(self._model.size)
        self.std[CENTER], self.std[TILT] = mirror.center_std_px * self._px, mirror.tilt_std_rad
        self.std[SCALE] = mirror.curve_std
        self.knock_std = self.std.copy()
        # a knock does not change the mirror
        self.knock_std[SCALE] = 0.0
        self.reach = np.full(self._model.size, 6.0 * mirror.curve_std)
        self.reach[CENTER], self.reach[TILT] = settings.max_center_px, settings.max_tilt_rad
        self._own = np.array([POSE_PRECISION] * 3 + [mirror.sway_std_rad**-2] * 2)
        self._robust = mirror.robust.scaled(self._px, self._px)

    def vector(self, camera: OmniCamera) -> FloatArray:
        """Return the parameters (5,) of a camera."""
        return self._model.vector(camera)

    def camera(self, vector: FloatArray) -> OmniCamera:
        """Return the camera of parameters (5,)."""
        return self._model.camera(vector)

    def watch(self, view: View) -> None:
        """Do nothing: all parts of a mirror camera's picture are assumed to be taken at the same time."""

    def shift_px(self, camera: OmniCamera, other: OmniCamera) -> float:
        """Greatest distance between the images of the same floor in two cameras."""
        inner, outer = camera.usable_radius_px
        pixels = camera.polar_to_pixel(np.arange(0.0, math.tau, 0.5)[:, None], np.linspace(inner, 0.8 * outer, 4))
        moved = other.floor_to_pixel(camera.pixel_to_floor(pixels.reshape(-1, 2))) - pixels.reshape(-1, 2)
        return float(np.nanmax(np.hypot(moved[:, 0], moved[:, 1])))

    def of(self, frame: UInt8Array, view: View, belief: Belief) -> FrameEquations | None:
        """Return a frame's evidence, see `EvidenceMaker`."""
        points = self._points(frame, view)
        if points is None:
            return None
        assert isinstance(view.pose, PoseEstimate)
        joint, size = JointFit(self._shape, points), self._model.size
        pose, free = view.pose.pose.array, np.ones(size, dtype=bool)

        def points_at(step: FloatArray) -> Residuals:
            # a body rotates about its foot, which appears as a tilt and a shift; the pose absorbs the shift
            of_camera, of_pose, lean = np.split(step, (size, size + 3))
            seen = joint.linearise(self._model, belief.start + of_camera, (pose + of_pose)[None], free)
            by_lean = seen.by_camera[:, TILT]
            # errors of the floor's edge and of lines in one sector are independent
            group = 2 * seen.group + points.is_line
            return Residuals(
                seen.residual_px + by_lean @ lean, seen.by_camera, np.hstack([seen.by_frame, by_lean]), group
            )

        return fit_frame(points_at, belief, self._own, np.zeros(len(self._own)), self._robust)

    def _points(self, frame: UInt8Array, view: View) -> Points | None:
        most = self._settings.max_points
        boundary = view.boundary_px if self._field.is_bounded else np.empty((0, 2))
        boundary = _thinned(boundary[np.isfinite(boundary).all(axis=1)], most)
        lines = _thinned(self._finder.find(frame).pixels, most)
        count = len(boundary) + len(lines)
        if count < self._robust.min_points:
            return None
        pixels = np.vstack([boundary, lines])
        return Points(pixels, np.zeros(count, dtype=np.int64), np.arange(count) >= len(boundary), np.ones(count))


def _thinned(pixels: FloatArray, max_points: int) -> FloatArray:
    return pixels[:: max(1, -(-len(pixels) // max_points))]
