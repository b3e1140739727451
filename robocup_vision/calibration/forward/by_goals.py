"""Estimates a pinhole camera's focal length, height and tilt from pictures of a goal and the lines around it.

Each picture is fitted with a focal length and a height of its own under wide priors, together with its pose
(`GoalPoseEstimator`). The pictures' information on these two common numbers is added up, without the priors and each
picture's own unknowns: one Gauss-Newton step of the joint fit. The pictures are fitted again about the result. Those
that contradict the rest are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.forward.result import ONLY_ONE, ForwardCalibration, ForwardFrame, too_uncertain
from robocup_vision.calibration.least_squares import FrameEquations
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.camera_estimate import CameraEstimate
from robocup_vision.localization.goal.fit import GoalModel, beside_lines, goal_model, system_at
from robocup_vision.localization.goal.geometry import (
    BLOOM,
    HEIGHT,
    LOG_FOCAL,
    ROLL,
    TILT,
    UNKNOWNS,
    GoalShape,
    IdealView,
    goal_shape,
)
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.progress import progress

_COMMON = (LOG_FOCAL, HEIGHT)
_SCALE_PX = 1.0  # of the loss
# median of chi-square with two degrees of freedom
_MEDIAN_CHI2 = 1.386


@dataclass(frozen=True, slots=True)
class GoalCalibrationSettings:
    """Settings of a calibration by goals."""

    #: standard deviations of a start, of the logarithm of the focal length and of the height: farther off, goals are
    #: not found
    focal_std: float = 0.05
    height_std_m: float = 0.03
    #: logarithms of the focal length that are tried about a start
    log_focals: tuple[float, ...] = tuple(0.04 * i for i in range(-4, 5))
    #: horizontal fields of view and heights that are tried without a start: common lenses, small and larger robots
    views_rad: tuple[float, ...] = tuple(
        math.radians(degrees) for degrees in (44, 46, 48.5, 51, 53.5, 56, 59, 62, 65, 68, 71, 75, 79, 83)
    )
    heights_m: tuple[float, ...] = (0.19, 0.45)
    #: pictures that starts are compared by; starts that are followed to the end; fits of all pictures, each about the
    #: result before: later ones change nothing
    start_frames: int = 5
    starts_tried: int = 3
    rounds: int = 3
    bloom_std_px: float = 1.0  #: standard deviation of how far bright paint bleeds over its edge
    #: the prior of a round is the result of the one before, with its standard deviations times this
    widening: float = 3.0
    #: lower bounds of those: a round that is too sure of itself would fix the next one
    min_focal_std: float = 0.01
    min_height_std_m: float = 0.01
    #: largest Mahalanobis distance (of two numbers) of a picture from the rest: one farther off is left out
    max_deviation: float = 3.5
    #: a camera whose tilt differs less than this between pictures is fixed on its robot
    max_tilt_spread_rad: float = math.radians(1.0)


@dataclass(frozen=True, eq=False)
class _Joint:
    """Log focal ratio and height (2,), their covariance (2, 2), and which estimates agree with them (N,) bool."""

    mean: FloatArray
    covariance: FloatArray
    agrees: FloatArray


def calibrate_by_goals(
    field: Field,
    frames: Mapping[int, np.ndarray],
    start: PinholeCamera | None,
    prior: Mapping[int, Pose2 | None],
    called: Sequence[str],
    notes: tuple[str, ...],
    trials: StartTrials,
    settings: GoalCalibrationSettings = GoalCalibrationSettings(),
) -> ForwardCalibration | NotCalibrated:
    """Calibrate a camera, which a neck may turn, by goals and the lines around them.

    Parameters
    ----------
    field : Field
        With goals of posts and a bar.
    frames : mapping of int to (H, W, 3) uint8
        BGR, by index.
    start : PinholeCamera or None
        Within some 18 % in focal length and 5 cm in height. Its distortion is kept; its image centre is trusted. None:
        several are tried, with the image's middle as centre and no distortion.
    prior : mapping of int to Pose2 or None
        Where the camera roughly was (0.4 m, 9 degrees), by index. With one, lines are enough, without a goal in view.

    Raises
    ------
    ArgumentError
        If the field has no goals of posts and a bar.
    """
    starts = _starts(next(iter(frames.values())), start, settings)
    cameras = _best_starts(field, frames, starts, settings, trials)
    if not cameras and start is not None and any(pose is not None for pose in prior.values()):
        # with a pose, lines may be enough
        cameras = [_loosened(start, settings)]
    result: ForwardCalibration | NotCalibrated = NotCalibrated(
        "no goal is found in any of the images, whatever the focal length may be", notes
    )
    for camera in cameras:
        result = _calibrated(field, camera, frames, prior, called, notes, settings)
        if result:
            break
    return result


def _calibrated(
    field: Field,
    camera: PinholeCamera,
    frames: Mapping[int, np.ndarray],
    prior: Mapping[int, Pose2 | None],
    called: Sequence[str],
    earlier_notes: tuple[str, ...],
    settings: GoalCalibrationSettings,
) -> ForwardCalibration | NotCalibrated:
    """Calibrate from one start, near enough for goals to be found."""
    notes = list(earlier_notes)
    joint, estimates = None, {}
    for _ in progress(range(settings.rounds), settings.rounds, "pinhole"):
        estimates = _camera_estimates(field, camera, frames, prior)
        if not estimates:
            return NotCalibrated("no goal is found in any of the images", tuple(notes))
        joint = _join(goal_shape(field), camera, list(estimates.values()), settings)
        if joint is None:
            break
        camera = _moved(camera, joint, settings)
    if joint is None:
        return NotCalibrated(
            "goals seen from the front, from afar and without lines do not separate the focal length from the "
            "distance: take pictures from the side and nearer",
            tuple(notes),
        )
    used = [index for index, agrees in zip(estimates, joint.agrees, strict=True) if agrees]
    focal_std, height_std_m = (float(s) for s in np.sqrt(np.diag(joint.covariance)))
    refusal = too_uncertain(len(used), focal_std, height_std_m)
    if refusal is not None:
        return NotCalibrated(refusal, tuple(notes))
    if len(used) < len(frames):
        notes.append(
            f"{len(frames) - len(used)} of {len(frames)} images show no goal, or contradict the rest: left out"
        )
    if len(used) == 1:
        notes.append(ONLY_ONE)
    return _result(camera, joint, {index: estimates[index] for index in used}, called, tuple(notes), settings)


def _result(
    camera: PinholeCamera,
    joint: _Joint,
    estimates: Mapping[int, CameraEstimate],
    called: Sequence[str],
    notes: tuple[str, ...],
    settings: GoalCalibrationSettings,
) -> ForwardCalibration:
    focal_std, height_std_m = np.sqrt(np.diag(joint.covariance))
    tilts, rolls = (np.array([s.unknowns[at] for s in estimates.values()]) for at in (TILT, ROLL))
    std = {"focal_px": float(focal_std * camera.focal_px[0]), "height_m": float(height_std_m)}
    own = np.array([s.covariance[TILT, TILT] for s in estimates.values()])
    is_fixed = len(tilts) > 1 and float(np.abs(tilts - np.median(tilts)).max()) < settings.max_tilt_spread_rad
    tilt, roll = (float(np.median(t)) if is_fixed else None for t in (tilts, rolls))
    if is_fixed:
        std["tilt_rad"] = max(float(np.sqrt(1.0 / np.sum(1.0 / own))), float(np.std(tilts)) / math.sqrt(len(tilts)))
    else:
        notes = (*notes, "the tilt differs between the images, or there is only one image: the tilt is left unknown")
    final = replace(
        camera,
        tilt_rad=tilt,
        roll_rad=roll,
        height_std_m=max(float(height_std_m), 1e-4),
        focal_std_px=std["focal_px"],
    )
    used = tuple(
        ForwardFrame(i, called[i], float(s.unknowns[TILT]), float(s.unknowns[ROLL]), s.lines is not None)
        for i, s in estimates.items()
    )
    correlation = float(joint.covariance[0, 1] / (focal_std * height_std_m))
    return ForwardCalibration(final, std, correlation, used, notes)


def _loosened(camera: PinholeCamera, settings: GoalCalibrationSettings) -> PinholeCamera:
    """Return a start with wide priors: tilt and roll unknown but upright."""
    return replace(
        camera,
        tilt_rad=None,
        roll_rad=None,
        pan_rad=None,
        height_std_m=settings.height_std_m,
        focal_std_px=settings.focal_std * camera.focal_px[0],
    )


def _best_starts(
    field: Field,
    frames: Mapping[int, np.ndarray],
    starts: Sequence[PinholeCamera],
    settings: GoalCalibrationSettings,
    trials: StartTrials,
) -> list[PinholeCamera]:
    """Return the starts that find most goals, best first."""
    some = dict(list(frames.items())[:: -(-len(frames) // settings.start_frames)])
    cameras = [_loosened(start, settings) for start in starts]
    ranks = trials.results(_RankStart(field, some, settings), cameras, "starts")
    ranked = [(rank, camera) for rank, camera in zip(ranks, cameras, strict=True) if rank[0]]
    ranked.sort(key=lambda entry: entry[0], reverse=True)
    return [camera for _, camera in ranked[: settings.starts_tried]]


def _starts(frame: np.ndarray, given: PinholeCamera | None, settings: GoalCalibrationSettings) -> list[PinholeCamera]:
    """Return a start with the focal lengths that are tried about its own; without one, common lenses and heights."""
    if given is not None:
        (fu, fv), scales = given.focal_px, [math.exp(log) for log in settings.log_focals]
        return [replace(given, focal_px=(fu * scale, fv * scale)) for scale in scales]
    height, width = frame.shape[:2]
    middle = (width - 1) / 2, (height - 1) / 2
    focals = [width / 2 / math.tan(view / 2) for view in settings.views_rad]
    return [PinholeCamera((width, height), (f, f), middle, up) for f in focals for up in settings.heights_m]


@dataclass(frozen=True, eq=False)
class _RankStart:
    field: Field
    frames: Mapping[int, np.ndarray]
    settings: GoalCalibrationSettings

    def __call__(self) -> Callable[[PinholeCamera], tuple[int, float]]:
        stds = self.settings.focal_std, self.settings.height_std_m

        def rank(camera: PinholeCamera) -> tuple[int, float]:
            """Return how many goals a start finds, and how good it is among those that find as many."""
            estimates = _camera_estimates(self.field, camera, self.frames, dict.fromkeys(self.frames))
            if not estimates:
                return 0, 0.0
            # of starts that find as many goals, the one that moves least under its priors is the best
            moved = np.array([s.unknowns[list(_COMMON)] for s in estimates.values()]) - (0.0, camera.height_m)
            return len(estimates), -float(np.median(np.abs(moved / stds).max(axis=1)))

        return rank


def _camera_estimates(
    field: Field, camera: PinholeCamera, frames: Mapping[int, np.ndarray], prior: Mapping[int, Pose2 | None]
) -> dict[int, CameraEstimate]:
    estimator = GoalPoseEstimator(field, camera)
    estimates = {index: estimator.locate_camera(frame, prior[index]) for index, frame in frames.items()}
    return {index: estimate for index, estimate in estimates.items() if not isinstance(estimate, NotLocated)}


def _join(
    shape: GoalShape, camera: PinholeCamera, estimates: Sequence[CameraEstimate], settings: GoalCalibrationSettings
) -> _Joint | None:
    """Add up the estimates' information on the common unknowns; None where it does not determine them."""
    of_each = [_common_information(shape, camera, estimate, settings) for estimate in estimates]
    information, weighted = np.array([i for i, _ in of_each]), np.array([w for _, w in of_each])
    stds = settings.focal_std, settings.height_std_m
    wide = np.diag([settings.focal_std**-2, settings.height_std_m**-2])
    agrees = np.ones(len(estimates), dtype=bool)
    scale = 1.0
    for _ in range(6):
        total = information[agrees].sum(axis=0)
        if np.linalg.eigvalsh(total * np.outer(stds, stds)).min() < 0.5:
            return None
        joint = np.linalg.inv(total)
        mean = joint @ weighted[agrees].sum(axis=0)
        off = weighted - information @ mean
        chi2 = np.einsum("ni,nij,nj->n", off, np.linalg.inv(information + wide), off)
        # the covariances of single pictures are too small: the spread between pictures corrects them
        scale = max(1.0, float(np.median(chi2)) / _MEDIAN_CHI2)
        now = chi2 <= scale * settings.max_deviation**2
        if (now == agrees).all():
            break
        agrees = now
    return _Joint(mean, scale * joint, agrees)


def _max_prior_information() -> FloatArray:
    """Greatest information (2,) that `beside_lines` leaves to priors on the common unknowns."""
    view = IdealView((1.0, 1.0), (0.0, 0.0))
    model = GoalModel(GoalShape(1.0, 1.0, 1.0, 0.1), view, np.zeros(UNKNOWNS), np.full(UNKNOWNS, np.inf))
    return np.asarray(beside_lines(model).weight[list(_COMMON)])


def _common_information(
    shape: GoalShape, camera: PinholeCamera, estimate: CameraEstimate, settings: GoalCalibrationSettings
) -> tuple[FloatArray, FloatArray]:
    """Return one picture's information (2, 2) on the common unknowns, and its product with their best values (2,)."""
    common, own = list(_COMMON), [i for i in range(UNKNOWNS) if i not in _COMMON]
    p = estimate.unknowns
    if estimate.lines is not None:
        posterior = np.linalg.inv(estimate.covariance[np.ix_(common, common)])
        # without the priors of its fit, which with lines weigh no more than `beside_lines` lets them
        weight = np.array([(camera.focal_px[0] / camera.focal_std_px) ** 2, camera.height_std_m**-2])
        of_prior = np.diag(np.minimum(weight, _max_prior_information()))
        weighted = posterior @ p[common] - of_prior @ [0.0, camera.height_m]
        return np.asarray(posterior - of_prior, np.float64), np.asarray(weighted, np.float64)
    model = goal_model(shape, camera, settings.bloom_std_px)
    weight = np.zeros(UNKNOWNS)
    weight[[ROLL, BLOOM]] = model.weight[[ROLL, BLOOM]]
    normal, pull = system_at(replace(model, weight=weight), estimate.fit.samples, p, _SCALE_PX)
    order, none = np.array(common + own), np.zeros(len(own))
    information, gradient = FrameEquations(normal[np.ix_(order, order)], pull[order], none, none).reduced()
    return information, np.asarray(information @ p[common] + gradient, np.float64)


def _moved(camera: PinholeCamera, joint: _Joint, settings: GoalCalibrationSettings) -> PinholeCamera:
    # a step no longer than the priors allow: the picture is fitted again from there
    log_focal = float(np.clip(joint.mean[0], -2 * settings.focal_std, 2 * settings.focal_std))
    height_m = float(np.clip(joint.mean[1], camera.height_m / 2, camera.height_m * 2))
    focal = camera.focal_px[0] * math.exp(log_focal), camera.focal_px[1] * math.exp(log_focal)
    focal_std, height_std_m = settings.widening * np.sqrt(np.diag(joint.covariance))
    return replace(
        camera,
        focal_px=focal,
        height_m=height_m,
        focal_std_px=float(np.clip(focal_std, settings.min_focal_std, settings.focal_std)) * focal[0],
        height_std_m=float(np.clip(height_std_m, settings.min_height_std_m, settings.height_std_m)),
    )
