"""Follows a pinhole camera from frame to frame by all edges that the field file lets it expect.

Model-based edge tracking after Harris (RAPiD, 1990): predict, search along normals, fit. Additions are several
candidates for a sample, modes chosen by random hypotheses, and tilt, roll and height as unknowns of every frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.compiling.loops import plain
from robocup_vision.estimates import EdgePoints, NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.bands import MAX_WIDTHS, LineLook, line_points
from robocup_vision.kernels.model_edges.carpet import CARPET, LIT_CARPET, carpet_look
from robocup_vision.kernels.model_edges.follow import MODES, brightness, follow, prepare
from robocup_vision.kernels.model_edges.posterior import frame_alone
from robocup_vision.kernels.model_edges.prediction import horizon_row
from robocup_vision.kernels.model_edges.tables import (
    FOUND,
    HEIGHT,
    ROLL,
    TILT,
    UNKNOWNS,
    UNSEEN,
    EdgeScene,
    FieldEdges,
    Fit,
    Prior,
    empty_buffers,
)
from robocup_vision.localization.model_edges.evidence import MIN_INLIERS, Evidence, weigh
from robocup_vision.localization.model_edges.field_edges import field_edges, telling_features
from robocup_vision.localization.model_edges.settings import MIN_RATIO, EdgeSettings

_MAX_SAMPLES = 600
_MAX_POINTS = 400
# stride of the rows and columns that are read for lines, on a field without lines
_NEVER = 1_000_000
# greatest standard deviation of a measurement in any direction, m and rad
_OPEN_STD = 1.0
_HYPOTHESES = 50  # number of random hypotheses by which the mode is chosen
# white paint's step from the carpet, relative to the nominal one, is learnt from lines whose middle is not blurred:
# least width of such a line, and least number of points
_MIN_PAINT_PX, _MIN_PAINT_POINTS = 3.0, 8
ODDS_MEMORY_S = 0.5  # time constant of a frame's odds in those after it
_MIN_SUPPORTING_LOG_ODDS = 0.1  # a frame with less does not support the pose
# greatest speed and turn rate of a robot with its head: a prior farther from the last answer does not continue it
_MAX_SPEED_MPS, _MAX_TURN_RADPS = 4.0, 10.0
# time constant with which deviations of tilt, roll and height decay: a walking step takes about half a second
_SWAY_MEMORY_S = 0.12


@dataclass(frozen=True, slots=True, eq=False)
class PoseLikelihood:
    """Likelihood of a pose by one frame alone, as a Gaussian in information form."""

    reference: Pose2  #: pose at which it was linearised
    information: FloatArray  #: (3, 3) float64: information about x_m, y_m, theta_rad; may be singular
    gradient: FloatArray  #: (3,) float64: gradient of the log-likelihood at `reference`


@dataclass(frozen=True, slots=True, eq=False)
class FollowedCamera:
    """The result of following a frame: the camera's pose by the frame and the prior together."""

    estimate: PoseEstimate  #: the camera's pose
    likelihood: PoseLikelihood  #: likelihood of the camera's pose, without the prior
    file_camera: PinholeCamera
    #: tilt and roll (rad), height (m) and logarithm of the focal length's scale in this frame
    camera_unknowns: tuple[float, float, float, float]
    camera_covariance: FloatArray  #: (4, 4) float64: covariance of `camera_unknowns`
    evidence: Evidence  #: the basis of the verdict
    others: tuple[Pose2, ...] = ()  #: further candidates, the likeliest first
    tells_half: bool = False  #: whether edges were found that the field's other half lacks

    @property
    def measurement(self) -> PoseEstimate:
        """Estimate of the camera's pose by the frame alone.

        In directions whose standard deviation would exceed `_OPEN_STD` it is the fit, with that standard deviation.
        """
        pose, covariance = self._by_frame_alone()
        ratio, rms = self.estimate.inlier_ratio, self.estimate.residual_px
        return PoseEstimate(pose, covariance, ratio, rms, (pose, *self.others))

    @property
    def measured_pose(self) -> Pose2:
        """The pose of `measurement`, faster."""
        return self._by_frame_alone()[0]

    def _by_frame_alone(self) -> tuple[Pose2, FloatArray]:
        covariance, reference, known = np.empty((3, 3)), self.likelihood.reference, self.likelihood
        x, y, turn = frame_alone(known.information, known.gradient, _OPEN_STD, covariance)
        return Pose2(reference.x_m + x, reference.y_m + y, reference.theta_rad + turn), covariance

    def without_prior(self) -> FollowedCamera:
        """Return the answer with the estimate by the frame alone instead of that with the prior."""
        return replace(self, estimate=self.measurement)

    def with_candidates(self, others: tuple[Pose2, ...]) -> FollowedCamera:
        """Return the answer as the likeliest of several candidates."""
        estimate = replace(self.estimate, candidates=(self.estimate.pose, *others))
        return replace(self, others=others, estimate=estimate)

    def as_fitted(self, camera: PinholeCamera) -> PinholeCamera:
        """Return the robot's camera with the orientation, height and focus fitted to this frame."""
        tilt_rad, roll_rad, height_m, log_focal = self.camera_unknowns
        (fu, fv), scale = self.file_camera.focal_px, math.exp(log_focal)
        return camera.as_fitted(tilt_rad, roll_rad, height_m, (fu * scale, fv * scale))


@dataclass(frozen=True, slots=True, eq=False)
class FollowerState:
    """The state that is carried from frame to frame."""

    #: (2, 4) float64: deviations of tilt, roll, height and focal length from those at rest, and their variances
    sway: FloatArray
    last_pose: Pose2 | None  #: last pose of the camera
    log_odds: float  #: log odds that the last pose is right


def _edge_points(pixels: FloatArray, status: Int64Array) -> EdgePoints:
    return EdgePoints(pixels, status.astype(np.uint8))


class EdgeFollower:
    """Follows one camera on one field.

    Parameters
    ----------
    camera : PinholeCamera
        Camera of the frames in full size.
    reduction : int
        Frames are followed in copies this many times smaller, in which a blur is shorter by the same factor.
    """

    def __init__(
        self, field: Field, camera: PinholeCamera, settings: EdgeSettings | None = None, reduction: int = 1
    ) -> None:
        self.field, self.file_camera, self.reduction = field, camera, reduction
        width, height = camera.size_px
        #: camera of the copies
        self.camera = camera = camera.in_size((width // reduction, height // reduction))
        self.settings = settings or EdgeSettings()
        self.edges = field_edges(field, self.settings.lines_end_m)
        self._telling = telling_features(self.edges) if field.shows_half else None
        self.lens = lens_table(camera)
        self.numbers = self.settings.for_width(camera.size_px[0], field.line_width_m)
        if not field.has_lines:
            self.numbers = self.numbers._replace(point_stride=_NEVER)
        # for a search's proposal, and a prior that earlier frames support, the search is not widened: edges farther
        # away belong to another pose, or to clutter
        near = self.numbers._replace(bent_ratio=0.0)
        self._wide_numbers, self._near_numbers = plain((self.numbers, near))
        draws = np.random.default_rng(20261122).random((_HYPOTHESES, 6))
        self._scene = EdgeScene(self.edges, self.lens, draws)
        self._buffers = empty_buffers(_MAX_SAMPLES, _MAX_POINTS)
        self._fit = Fit(
            np.zeros(UNKNOWNS),
            np.zeros((UNKNOWNS, UNKNOWNS)),
            np.zeros((3, 3)),
            np.zeros(3),
            np.zeros(LIT_CARPET if self.settings.in_sun_and_shade else CARPET),
            np.zeros(15),
        )
        focal_std = camera.focal_std_px / math.sqrt(camera.focal_px[0] * camera.focal_px[1])
        self._camera_prior = np.zeros((2, 4))
        self._camera_prior[1, 3] = focal_std
        self._sway = np.zeros((2, 4))
        self.hold(camera)
        self._prior = Prior(np.zeros(UNKNOWNS), np.zeros((UNKNOWNS, UNKNOWNS)))
        # compiled calls take plain tuples faster, see `plain`
        self._plain = plain((self._scene, self._prior, self._buffers, self._fit))
        # views of the fit's results other than the pose
        self._fitted_camera, self._fitted_variances = self._fit.unknowns[3:], self._fit.covariance.diagonal()[3:]
        self._keep, self._dt_s = np.zeros(4), -1.0
        self._last_pose: Pose2 | None = None
        self._log_odds = self._log_ratio = 0.0
        self._paint_ratio, self._knows_paint = 1.0, False
        self.forget()

    def with_camera(self, camera: PinholeCamera) -> EdgeFollower:
        """Return a follower with another calibration of the camera, which continues from this one's state."""
        other = EdgeFollower(self.field, camera, self.settings, self.reduction)
        other.state = self.state
        if self._knows_paint:
            other._show_paint(self._paint_ratio)
        # the carried state is the body's deviation from its rest
        other._sway[0] += self._camera_prior[0] - other._camera_prior[0]
        other._sway[0, 3] = 0.0
        other._sway[1, 3] = other._camera_prior[1, 3] ** 2
        return other

    def hold(self, camera: PinholeCamera) -> None:
        """Take tilt, roll and height of `camera`, and their standard deviations, as those at rest.

        The deviation carried from frame to frame is at most as uncertain as these.
        """
        self.file_camera = self.file_camera.held_as(camera)
        self.camera = camera = self.camera.held_as(camera)
        self.sway_std_rad = tilt_std, roll_std = camera.sway_std_rad
        self._camera_prior[0, :3] = camera.tilt_rad or 0.0, camera.roll_rad or 0.0, camera.height_m
        at_rest = self._sway[1, :3] >= self._camera_prior[1, :3] ** 2
        self._camera_prior[1, :3] = tilt_std, roll_std, camera.height_std_m
        known, carried = self._camera_prior[1, :3] ** 2, self._sway[1, :3]
        self._sway[1, :3] = np.where(at_rest, known, np.minimum(carried, known))

    @property
    def painted_edges(self) -> FieldEdges:
        """The field's edges, with white paint as bright as in the last pictures."""
        return self._scene.field

    @property
    def tilt_roll_rad(self) -> tuple[float, float]:
        """The camera's tilt and roll by the last fit, whether it was accepted or not."""
        tilt, roll = self._fit.unknowns[3:5].tolist()
        return tilt, roll

    def likelihood_under(self, std: FloatArray) -> PoseLikelihood:
        """Return the last fit's likelihood of the pose under another prior of the camera, centred at the fitted values.

        `std` (4,) are its standard deviations of tilt, roll, height and logarithm of the focal length.
        """
        root, open_ = self._prior.root, np.diag(self._prior.root) > 0.0
        inverse = np.linalg.inv(root[np.ix_(open_, open_)])
        information = np.zeros((UNKNOWNS, UNKNOWNS))
        information[np.ix_(open_, open_)] = inverse.T @ self._buffers.information[np.ix_(open_, open_)] @ inverse
        rest = information[3:, 3:] + np.diag(std**-2.0)
        cross = information[:3, 3:]
        marginal = information[:3, :3] - cross @ np.linalg.solve(rest, cross.T)
        return PoseLikelihood(self.pose, (marginal + marginal.T) / 2, np.zeros(3))

    @property
    def evidence(self) -> Evidence:
        """The evidence of the last fit, whether it was accepted or not."""
        return Evidence(*self._fit.figures.tolist())

    @property
    def confirms_prior(self) -> bool:
        """Whether the last frame that was followed is likelier if its prior is right than if it is wrong."""
        return self._log_ratio > 0.0

    @property
    def pose(self) -> Pose2:
        """The camera's pose by the last fit, whether it was accepted or not."""
        return Pose2(*self._fit.unknowns[:3].tolist())

    @property
    def state(self) -> FollowerState:
        """The state after the frames so far; may be set to that of another follower of this camera."""
        return FollowerState(self._sway.copy(), self._last_pose, self._log_odds)

    @state.setter
    def state(self, state: FollowerState) -> None:
        self._sway[:], self._last_pose, self._log_odds = state.sway, state.last_pose, state.log_odds

    def edge_points(self) -> EdgePoints:
        """Return the edges that the last fit predicts, in pixels of the full-size frame, with their status."""
        return self.edge_points_when_asked()()

    def edge_points_when_asked(self) -> Callable[[], EdgePoints]:
        """Return a function that returns `edge_points` of this fit, also after other frames."""
        count, camera = int(self._fit.figures[0]), self.camera
        pixels, status = self._buffers.samples.uv[:count].copy(), self._buffers.found.status[:count].copy()
        if self.reduction > 1:
            pixels = (pixels + 0.5) * np.divide(self.file_camera.size_px, camera.size_px) - 0.5
        return partial(_edge_points, pixels, status)

    def copy_of(self, frame: UInt8Array) -> UInt8Array:
        """Return the copy of a frame that is followed; the frame itself if it has the copy's size."""
        if frame.shape[1::-1] == self.camera.size_px:
            return frame
        return np.asarray(cv2.resize(frame, self.camera.size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def find_line_points(self, frame: UInt8Array, tilt_rad: float, roll_rad: float, points: FloatArray) -> int:
        """Find points on lines without a pose, and learn the brightness of white paint from them.

        Writes `points` (P, 3) as `kernels.model_edges.bands.line_points` does, and returns their number.
        """
        camera, numbers, carpet, unknowns = self.camera, self.numbers, np.zeros(CARPET), np.zeros(UNKNOWNS)
        carpet_look(frame, int(horizon_row(self.lens, tilt_rad, roll_rad)), carpet)
        unknowns[TILT], unknowns[ROLL], unknowns[HEIGHT] = tilt_rad, roll_rad, camera.height_m
        usual = float(self.edges.channels[0, 3]) * brightness(carpet)
        step = max(0.5 * numbers.min_ratio * usual, 5 * float(carpet[3]))
        look = LineLook(step, numbers.line_width_m, MAX_WIDTHS, max(numbers.point_stride // 2, 2))
        count = int(line_points(frame, self.lens, unknowns, carpet, look, points))
        wide = points[:count][self._widths_px(points[:count], tilt_rad, roll_rad) >= _MIN_PAINT_PX]
        if len(wide) >= _MIN_PAINT_POINTS:
            columns, rows = np.rint(wide[:, :2].T).astype(np.intp)
            blue, _, red = frame[rows, columns].astype(np.float64).T
            self._show_paint((float(np.median(blue + red)) - float(carpet[0] + carpet[2])) / usual)
        return count

    def _widths_px(self, points: FloatArray, tilt_rad: float, roll_rad: float) -> FloatArray:
        """Return a line's width (N,) in pixels at points (N, 3) of `line_points`, along the row or column read."""
        camera = self.camera.with_orientation(0.0, tilt_rad, roll_rad)
        half_px = 0.5 * np.where(points[:, 2:] > 0.0, (1.0, 0.0), (0.0, 1.0))
        across_m = np.subtract(*camera.pixel_to_floor(points[:, :2] + np.stack([half_px, -half_px])))
        return np.asarray(np.nan_to_num(self.numbers.line_width_m / np.sqrt((across_m**2).sum(axis=1))))

    def _show_paint(self, ratio: float) -> None:
        """Set the expected step from carpet to white paint, relative to that of the nominal colours."""
        # fainter lines are not found
        ratio = min(max(ratio, 0.5 * MIN_RATIO), 1.0)
        self._knows_paint, self._paint_ratio = True, ratio
        channels = self.edges.channels.copy()
        channels[channels[:, 7] > 0.0] *= (1.0, 1.0, 1.0, ratio, 1.0, 1.0, 1.0, ratio)
        channels.flags.writeable = False
        self._scene = self._scene._replace(field=self.edges._replace(channels=channels))
        self._plain = plain((self._scene, self._prior, self._buffers, self._fit))

    def forget_paint(self) -> None:
        """Forget the brightness of white paint."""
        self._show_paint(1.0)
        self._knows_paint = False

    def forget(self) -> None:
        """Forget the last frame: the camera's pose, its orientation, and the odds of both."""
        self._sway[0], self._sway[1] = 0.0, self._camera_prior[1] ** 2
        self._last_pose, self._log_odds = None, 0.0

    def resume(self, answer: FollowedCamera) -> None:
        """Continue from an answer: take its pose and orientation of the camera."""
        self._sway[0] = np.array(answer.camera_unknowns) - self._camera_prior[0]
        self._last_pose = answer.estimate.pose
        self._log_odds = min(answer.evidence.log_odds, self.numbers.sure_log_odds)

    def _prior_log_odds(self, prior: PoseEstimate, dt_s: float) -> float:
        """Return the log odds that a prior is right: the last answer's, decayed, if it may continue it, else 0."""
        if self._last_pose is None:
            return 0.0
        away_m, turned_rad = prior.pose.error_to(self._last_pose)
        (xx, _, _), (_, yy, _), (_, _, tt) = prior.covariance.tolist()
        std_m, std_rad = math.sqrt(xx + yy), math.sqrt(tt)
        if away_m > _MAX_SPEED_MPS * dt_s + 3 * std_m or turned_rad > _MAX_TURN_RADPS * dt_s + 3 * std_rad:
            return 0.0
        log_odds = self._log_odds * math.exp(-dt_s / ODDS_MEMORY_S)
        return log_odds if log_odds >= _MIN_SUPPORTING_LOG_ODDS else 0.0

    def _pass_time(self, dt_s: float) -> None:
        self._dt_s = dt_s
        self._keep = np.exp(-dt_s / np.array([*[_SWAY_MEMORY_S] * 3, math.inf]))

    def follow(
        self,
        frame: UInt8Array,
        prior: PoseEstimate,
        dt_s: float = 1 / 30,
        *,
        modes: int = MODES,
        is_proposal: bool = False,
        is_same_frame: bool = False,
    ) -> FollowedCamera | NotLocated:
        """Locate the camera by a frame and a prior.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR, of the camera's size; or its copy, see `copy_of`.
        modes : int
            Greatest number of modes near the prior that are examined.
        is_proposal : bool
            Whether the prior is a search's proposal, whose fit is compared with others.
        is_same_frame : bool
            Whether the last call had the same frame and tilt at rest; then the carpet's colour is not estimated again.
        """
        frame = self.copy_of(frame)
        if dt_s != self._dt_s:
            self._pass_time(dt_s)
        if not self._knows_paint:
            self.find_line_points(frame, self._camera_prior[0, 0], self._camera_prior[0, 1], self._buffers.points)
            self._knows_paint = True
        pose, fit = prior.pose, self._fit
        at = np.array((pose.x_m, pose.y_m, pose.theta_rad))
        if not prepare(at, prior.covariance, self._camera_prior, self._keep, self._sway, self._prior):
            raise ArgumentError(f"the prior's covariance is not positive definite: {prior.covariance.tolist()}")
        prior_log_odds = self._prior_log_odds(prior, dt_s)
        numbers = self._near_numbers if is_proposal or prior_log_odds > 0.0 else self._wide_numbers
        scene, unknowns, buffers, result = self._plain
        if not follow(
            frame,
            scene,
            unknowns,
            numbers,
            buffers,
            result,
            modes,
            is_same_frame,
        ):
            self._log_ratio = 0.0
            place = f"({pose.x_m:.2f}, {pose.y_m:.2f}) m, {math.degrees(pose.theta_rad):.0f} degrees"
            return NotLocated(f"no edge of the field is in view from where the camera is looked for, {place}")
        evidence = self.evidence
        if is_proposal:
            # a search compares its proposals, and judges them by the comparison
            reason, log_ratio = None, evidence.log_odds
        else:
            reason, log_ratio = weigh(evidence, prior_log_odds)
        self._log_ratio = log_ratio
        if reason is not None:
            # the next prior may continue this one without a measurement
            known = self._last_pose is not None and prior_log_odds > 0.0
            self._last_pose = prior.pose if known else None
            self._log_odds = max(prior_log_odds + log_ratio, 0.0)
            return NotLocated(reason)
        self._log_odds = min(prior_log_odds + log_ratio, self.numbers.sure_log_odds)
        p = fit.unknowns.tolist()
        self._last_pose = pose = Pose2(p[0], p[1], p[2])
        np.subtract(self._fitted_camera, self._camera_prior[0], out=self._sway[0])
        self._sway[1] = self._fitted_variances
        residual_px = self.reduction * evidence.rms_px
        estimate = PoseEstimate(pose, fit.covariance[:3, :3], evidence.found_ratio, residual_px)
        likelihood = PoseLikelihood(pose, fit.information.copy(), fit.gradient.copy())
        camera_unknowns, covariance = (p[3], p[4], p[5], p[6]), fit.covariance[3:, 3:].copy()
        return FollowedCamera(
            estimate, likelihood, self.file_camera, camera_unknowns, covariance, evidence, tells_half=self._shows_half()
        )

    def _shows_half(self) -> bool:
        """Whether the last fit found enough edges that the other half lacks, and at least half of those not unseen."""
        if self._telling is None:
            return False
        count = int(self._fit.figures[0])
        status = self._buffers.found.status[:count][self._telling[self._buffers.samples.feature[:count]]]
        found = int(np.count_nonzero(status == FOUND))
        return found >= MIN_INLIERS and 2 * found > int(np.count_nonzero(status != UNSEEN))
