"""Evidence of a frame on a pinhole camera's lens and mounting: the field's edges in view against their predictions.

The samples are those of the follower (`kernels.model_edges`): predicted by the frame's pose, searched for along their
normals. Tilt, roll and height at rest are separated from the body's sway in one frame by the sway's standard deviation.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
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
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.kernels.model_edges.carpet import carpet_look
from robocup_vision.kernels.model_edges.follow import brightness
from robocup_vision.kernels.model_edges.prediction import predict
from robocup_vision.kernels.model_edges.search import search
from robocup_vision.kernels.model_edges.tables import HEIGHT, LOG_FOCAL, ROLL, TILT, UNKNOWNS, empty_buffers
from robocup_vision.localization.model_edges.field_edges import field_edges
from robocup_vision.localization.model_edges.settings import DESIGN_WIDTH_PX, EdgeSettings
from robocup_vision.view import View

# edge samples of one frame, at most
_MAX_SAMPLES = 600
# places of the parameters: tilt, roll, height, logarithm of the focal length's scale, centre
_SCALE, _CENTER, _ANGLES = 3, slice(4, 6), slice(0, 2)
_HEIGHT = 2


class FrameTerms(NamedTuple):
    """Information of a frame on the camera's parameters and on its own unknowns, before these are marginalised."""

    #: (12, 12), (12,) float64: of the six parameters, then the camera's pose on the field, and the body's sway in tilt,
    #: roll and height
    information: FloatArray
    gradient: FloatArray
    #: (6,), (6,) float64: precision of the frame's own unknowns under their prior, and its gradient where the points
    #: were linearised
    own: FloatArray
    slope: FloatArray


class PinholeEvidence:
    """Makes evidence of frames of one pinhole camera.

    The parameters: tilt, roll (rad) and height (m) at rest, logarithm of the focal length's scale, centre u, v (px).

    Parameters
    ----------
    camera : PinholeCamera
        As in its file, its tilt known.
    """

    slices = (_CENTER, _ANGLES, _SCALE)
    # without a prior a pinhole camera locates the robot even if it is only about right
    tries_others = False

    def __init__(self, field: Field, camera: PinholeCamera, mask: UInt8Array | None, settings: OnlineSettings) -> None:
        own = settings.pinhole
        self._settings, self._file = own, camera
        px = camera.size_px[0] / DESIGN_WIDTH_PX
        focal_px = math.sqrt(camera.focal_px[0] * camera.focal_px[1])
        focal_std = camera.focal_std_px / focal_px if camera.focal_std_px else own.focal_std
        self.start = self.vector(camera)
        angle, center = own.tilt_std_rad, own.center_std_px * px
        self.std = np.array([angle, angle, own.height_std_m, focal_std, center, center])
        # a knock does not change the lens
        self.knock_std = np.array([angle, angle, own.height_std_m, 0.0, center, center])
        self.reach = 6.0 * self.std
        self.reach[_CENTER], self.reach[_ANGLES] = settings.max_center_px * px, settings.max_tilt_rad
        sway = own.sway_std_rad if camera.roll_std_rad is None else max(camera.roll_std_rad, own.sway_std_rad)
        self._own = np.array([POSE_PRECISION] * 3 + [sway**-2, sway**-2, own.sway_std_m**-2])
        follow = EdgeSettings().for_width(camera.size_px[0], field.line_width_m)
        self._numbers, self._edges = follow, field_edges(field)
        self._workspace = empty_buffers(_MAX_SAMPLES, 0)
        self._workspace.reach_px[:] = own.reach_px * px
        # time of the last view (s), and the camera's heading, tilt and roll in it
        self._held: tuple[float, tuple[float, float, float]] | None = None
        self._turn_radps = 0.0
        self._lens, self._lens_of = lens_table(camera), self.start.copy()
        self._mask = mask
        # compiles, or loads from the disk's cache, the loops that a frame needs: no frame waits for it
        width, height = camera.size_px
        self._search(np.zeros((height, width, 3), dtype=np.uint8), np.zeros(UNKNOWNS), self.start)

    def vector(self, camera: PinholeCamera) -> FloatArray:
        """Return the parameters (6,) of a camera."""
        log_focal = math.log(camera.focal_px[0] / self._file.focal_px[0])
        tilt, roll = camera.tilt_rad or 0.0, camera.roll_rad or 0.0
        return np.array([tilt, roll, camera.height_m, log_focal, *camera.center_px])

    def camera(self, vector: FloatArray) -> PinholeCamera:
        """Return the camera of parameters (6,)."""
        tilt, roll, height, log_focal, u, v = vector.tolist()
        scale = math.exp(log_focal)
        return replace(
            self._file,
            focal_px=(self._file.focal_px[0] * scale, self._file.focal_px[1] * scale),
            center_px=(u, v),
            height_m=height,
            tilt_rad=tilt,
            roll_rad=roll,
        )

    def shift_px(self, camera: PinholeCamera, other: PinholeCamera) -> float:
        """Largest distance, pixels, between the images of one place in two cameras: on the floor, and far away."""
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
        """Measure how fast the camera turns from view to view."""
        held = view.camera
        if not view.pose or not isinstance(held, PinholeCamera) or view.t_s is None:
            self._held = None
            return
        angles = (view.pose.pose.theta_rad + (held.pan_rad or 0.0), held.tilt_rad or 0.0, held.roll_rad or 0.0)
        self._turn_radps = 0.0
        if self._held is not None and view.t_s > self._held[0]:
            heading, *others = (wrap_angle(now - before) for now, before in zip(angles, self._held[1], strict=True))
            # frames of a camera file with a readout time have been straightened, up to this fraction
            left = self._settings.straightened_to if self._file.readout_s else 1.0
            self._turn_radps = math.hypot(left * heading, *others) / (view.t_s - self._held[0])
        self._held = (view.t_s, angles)

    def of(
        self, frame: UInt8Array, view: View, mean: FloatArray, covariance: FloatArray, start: FloatArray
    ) -> Evidence | None:
        """Return the evidence of a frame: see `EvidenceMaker`."""
        held = view.camera
        assert isinstance(held, PinholeCamera)
        assert view.pose
        pose = view.pose.pose.compose(held.camera_in_robot)
        terms = self.terms(frame, held, pose, (mean, covariance, start))
        if terms is None:
            return None
        return Evidence(start.copy(), *marginal(terms.information, terms.gradient, len(mean), terms.own, terms.slope))

    def terms(
        self, frame: UInt8Array, held: PinholeCamera, pose: Pose2, belief: tuple[FloatArray, FloatArray, FloatArray]
    ) -> FrameTerms | None:
        """Return the information of a frame on the parameters and on its own unknowns; None where `of` returns it.

        Parameters
        ----------
        held : PinholeCamera
            As the camera was held in it.
        pose : Pose2
            Of the camera on the field.
        belief : (6,), (6, 6), (6,) float64
            `mean`, `covariance` and `start` of `of`.
        """
        mean, covariance, start = belief
        settings, size = self._settings, len(mean)
        tilt, roll = held.tilt_rad or 0.0, held.roll_rad or 0.0
        unknowns = np.array([pose.x_m, pose.y_m, pose.theta_rad, tilt, roll, held.height_m, 0.0])
        count = self._search(frame, unknowns, start)
        found, samples = self._workspace.found, self._workspace.samples
        is_seen = (found.candidates[:count] > 0) & ~self._is_masked(samples.uv[:count])
        if np.count_nonzero(is_seen) < settings.min_points:
            return None
        jacobian, normal = samples.jacobian[:count][is_seen], samples.normal[:count][is_seen]
        by_camera = np.column_stack([jacobian[:, [TILT, ROLL, HEIGHT, LOG_FOCAL]], normal])
        by_frame = jacobian[:, :LOG_FOCAL]
        offsets, candidates = found.offset_px[:count][is_seen], found.candidates[:count][is_seen]
        offsets = np.where(np.arange(offsets.shape[1]) < candidates[:, None], offsets, np.inf)
        group = samples.feature[:count][is_seen]
        sway = unknowns[TILT : HEIGHT + 1] - start[: _HEIGHT + 1]
        slope = -self._own * np.concatenate([np.zeros(3), sway])
        before: FloatArray = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
        rows = np.hstack([by_camera, by_frame])
        # standard deviation of the shift of rows that are evenly spread over the readout
        skew_px = self._lens[0] * self._turn_radps * (self._file.readout_s or settings.readout_s) / math.sqrt(12.0)
        step: FloatArray = np.zeros(size + len(self._own))
        for gate in (*settings.gates_px, 0.0):
            expected: FloatArray = rows @ step
            nearest = np.argmin(np.abs(offsets - expected[:, None]), axis=1)
            measured = offsets[np.arange(len(offsets)), nearest]
            residual = expected - measured
            spread = spread_px(residual[np.abs(residual) < settings.gates_px[-1]], settings.alone_px)
            weight = tukey_weights(residual, gate or settings.last_gate * spread)
            # where points agree worse than their noise lets expect, their common error is taken to be larger, too
            shared_px = math.hypot(settings.shared_px * spread / settings.alone_px, skew_px)
            noise = NoiseSettings(spread, shared_px)
            points = Residuals(-measured, by_camera, by_frame, group)
            is_used = weight > 0
            information, gradient = normal_equations(known(is_used, points), weight[is_used], noise)
            if gate == 0.0:
                break
            step = gauss_newton_step(information, gradient, (before, before @ (mean - start)), (self._own, slope))
        agreeing = int(np.count_nonzero(is_used))
        if not has_support(agreeing, len(offsets), settings.min_points, settings.min_agreeing_ratio):
            return None
        return FrameTerms(information, gradient, self._own, slope)

    def _is_masked(self, pixels: FloatArray) -> npt.NDArray[np.bool_]:
        if self._mask is None:
            return np.zeros(len(pixels), dtype=bool)
        u, v = np.rint(pixels).astype(np.int64).T
        return np.asarray(self._mask[v, u] > 0)

    def _search(self, frame: UInt8Array, unknowns: FloatArray, start: FloatArray) -> int:
        """Predict the field's edges and search for them; return the number of samples."""
        if not np.array_equal(self._lens_of, start):
            self._lens, self._lens_of = lens_table(self.camera(start)), start.copy()
        carpet = np.zeros(5)
        carpet_look(frame, int(self._lens[3] + self._lens[1] * math.tan(unknowns[TILT])), carpet)
        count = int(predict(self._edges, self._lens, unknowns, self._numbers.spacing_px, self._workspace.samples))
        light = brightness(carpet)
        search(frame, self._edges.channels, carpet, light, self._numbers, self._workspace, count)
        return count
