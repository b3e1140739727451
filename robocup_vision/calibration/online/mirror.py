"""What a frame of a mirror camera tells of its centre, tilt and curve: floor's outline and lines against the field."""

from __future__ import annotations

import math

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.calibration.omni.fit import FieldShape, JointFit, Points
from robocup_vision.calibration.omni.model import CENTER, SCALE, TILT, CameraModel
from robocup_vision.calibration.online.evidence import (
    POSE_PRECISION,
    Evidence,
    NoiseSettings,
    Residuals,
    gauss_newton_step,
    has_support,
    known,
    marginal,
    normal_equations,
    spread_px,
    tukey_weights,
)
from robocup_vision.calibration.online.settings import OnlineSettings
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.perception.line_points import LineFinder
from robocup_vision.view import View

DESIGN_HEIGHT_PX = 220.0


class MirrorEvidence:
    """Makes evidence of frames of one mirror camera.

    The parameters: centre u, v (px), tilt about x, y (rad), and the logarithm of the curve's magnification.
    """

    slices = (CENTER, TILT, SCALE)
    tries_others = True

    def __init__(self, field: Field, camera: OmniCamera, mask: UInt8Array | None, settings: OnlineSettings) -> None:
        mirror = settings.mirror
        self._field, self._settings = field, mirror
        self._shape = FieldShape(field)
        self._finder = LineFinder(camera, field.line_width_m, mask)
        self._model = CameraModel(camera, "magnified")
        self._px = min(camera.size_px) / DESIGN_HEIGHT_PX
        self.start = self._model.vector(camera)
        self.std = np.empty(self._model.size)
        self.std[CENTER], self.std[TILT] = mirror.center_std_px * self._px, mirror.tilt_std_rad
        self.std[SCALE] = mirror.curve_std
        self.knock_std = self.std.copy()
        # a knock bends no mirror
        self.knock_std[SCALE] = 0.0
        self.reach = np.full(self._model.size, 6.0 * mirror.curve_std)
        self.reach[CENTER], self.reach[TILT] = settings.max_center_px, settings.max_tilt_rad
        self._own = np.array([POSE_PRECISION] * 3 + [mirror.sway_std_rad**-2] * 2)
        self._warm_up(camera)

    def vector(self, camera: OmniCamera) -> FloatArray:
        """Return the parameters (5,) of a camera."""
        return self._model.vector(camera)

    def camera(self, vector: FloatArray) -> OmniCamera:
        """Return the camera of parameters (5,)."""
        return self._model.camera(vector)

    def watch(self, view: View) -> None:
        """Take note of a view: nothing to do, as a mirror camera's picture is taken at once for all its parts."""

    def shift_px(self, camera: OmniCamera, other: OmniCamera) -> float:
        """Greatest distance between the images of the same floor through two cameras."""
        inner, outer = camera.usable_radius_px
        pixels = camera.polar_to_pixel(np.arange(0.0, math.tau, 0.5)[:, None], np.linspace(inner, 0.8 * outer, 4))
        moved = other.floor_to_pixel(camera.pixel_to_floor(pixels.reshape(-1, 2))) - pixels.reshape(-1, 2)
        return float(np.nanmax(np.hypot(moved[:, 0], moved[:, 1])))

    def of(
        self, frame: UInt8Array, view: View, mean: FloatArray, covariance: FloatArray, start: FloatArray
    ) -> Evidence | None:
        """Return what a frame tells: see `EvidenceMaker`."""
        points = self._points(frame, view)
        if points is None:
            return None
        assert isinstance(view.pose, PoseEstimate)
        settings, size = self._settings, self._model.size
        joint = JointFit(self._shape, points)
        group = self._groups(points, mean)
        vector, pose = start.copy(), view.pose.pose.array.copy()
        before: FloatArray = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
        free = np.ones(size, dtype=bool)
        # a body leans about its foot: seen from there as a tilt and a shift, and the pose takes up the shift
        own, pull, lean = self._own, np.zeros(len(self._own)), np.zeros(2)
        for gate in (*settings.gates_px, 0.0):
            residual, by_camera, by_pose, is_known = joint.linearise(self._model, vector, pose[None], free)
            by_frame = np.hstack([by_pose, by_camera[:, TILT]])
            residual = residual + by_camera[:, TILT] @ lean
            rows = known(is_known, Residuals(residual, by_camera, by_frame, group))
            spread = spread_px(rows.residual_px[np.abs(rows.residual_px) < settings.gates_px[-1] * self._px], 0.0)
            alone_px = max(spread, settings.alone_px * self._px)
            weight = tukey_weights(rows.residual_px, gate * self._px or 4.0 * alone_px)
            noise = NoiseSettings(alone_px, settings.shared_px * self._px)
            information, gradient = normal_equations(rows, weight, noise)
            if gate == 0.0:
                break
            step = gauss_newton_step(information, gradient, (before, before @ (mean - vector)), (own, pull))
            vector += step[:size]
            pose += step[size : size + 3]
            lean += step[size + 3 :]
            pull[3:] = -own[3:] * lean
        agreeing = int(np.count_nonzero(weight))
        if not has_support(agreeing, len(points.pixels), settings.min_points, settings.min_agreeing_ratio):
            return None
        return Evidence(vector, *marginal(information, gradient, size, own, pull))

    def _points(self, frame: UInt8Array, view: View) -> Points | None:
        most = self._settings.max_points
        boundary = view.boundary_px if self._field.is_bounded else np.empty((0, 2))
        boundary = _thinned(boundary[np.isfinite(boundary).all(axis=1)], most)
        lines = _thinned(self._finder.find(frame).pixels, most)
        count = len(boundary) + len(lines)
        if count < self._settings.min_points:
            return None
        pixels = np.vstack([boundary, lines])
        return Points(pixels, np.zeros(count, dtype=np.int64), np.arange(count) >= len(boundary), np.ones(count))

    def _groups(self, points: Points, vector: FloatArray) -> Int64Array:
        sectors = self._settings.sectors
        offset = points.pixels - vector[CENTER]
        turn = np.arctan2(offset[:, 1], offset[:, 0]) / math.tau + 0.5
        return np.floor(turn * sectors).astype(np.int64) + (sectors + 1) * points.is_line

    def _warm_up(self, camera: OmniCamera) -> None:
        """Compile, or load from the disk's cache, what a frame needs, so that no frame pays for it."""
        width, height = camera.size_px
        self._finder.find(np.zeros((height, width, 3), dtype=np.uint8))
        pixels = camera.polar_to_pixel([0.0, 1.0], camera.usable_radius_px[0])
        points = Points(pixels, np.zeros(2, dtype=np.int64), np.ones(2, dtype=bool), np.ones(2))
        JointFit(self._shape, points).residuals(camera, np.zeros((1, 3)))


def _thinned(pixels: FloatArray, max_points: int) -> FloatArray:
    return pixels[:: max(1, -(-len(pixels) // max_points))]
