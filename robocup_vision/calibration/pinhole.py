"""A pinhole camera's focal length, height and tilt, from pictures of a goal and the lines around it.

Each picture is fitted with a focal length and a height of its own under wide priors, together with its pose
(`GoalPoseEstimator`). What the pictures determine of these two shared numbers is joined as one Gauss-Newton step of the
joint fit would join it: by their information, with the priors and each picture's own unknowns taken out of it. The
pictures are fitted again about the result, and those that contradict the rest are left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models.errors import FrameError
from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.goal.fit import FitLoss
from robocup_vision.localization.goal.fit import GoalModel, goal_model, system_at
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
from robocup_vision.localization.goal.pose_estimator import CameraEstimate, GoalPoseEstimator
from robocup_vision.localization.goal.white_lines import loosened
from robocup_vision.progress import progress

# a goal is found only where the focal length is roughly right: one standard deviation of its logarithm, of the height
FOCAL_STD, HEIGHT_STD_M = 0.05, 0.03
# so it is scanned: logarithms about a start; where nothing is known horizontal fields of view, with heights of small
# and of larger robots
SCAN = tuple(0.04 * i for i in range(-4, 5))
VIEWS_RAD = tuple(math.radians(degrees) for degrees in (44, 46, 48.5, 51, 53.5, 56, 59, 62, 65, 68, 71, 75, 79, 83))
HEIGHTS_M = (0.19, 0.45)
_START_FRAMES, _STARTS_TRIED, _ROUNDS = 5, 3, 3
_SHARED = (LOG_FOCAL, HEIGHT)
# how far bright paint bleeds over its edge
_BLOOM_STD_PX = 1.0
_LOSS = FitLoss(np.ones(1), np.ones(1), False)
# a round's result is the next one's prior, with so many times its standard deviation, but no less than this
_WIDEN, _MIN_FOCAL_STD, _MIN_HEIGHT_STD_M = 3.0, 0.01, 0.01
# pictures farther off the rest than this many standard deviations, in two numbers, are left out
_MAX_OFF = 3.5
# a result less sure than this is refused: relative focal length, height in metres
_MAX_FOCAL_STD, _MAX_HEIGHT_STD_M = 0.03, 0.03
# a camera whose tilt differs less than this between pictures is fixed on its robot
_FIXED_RAD = math.radians(1.0)
# median of chi-square with two degrees of freedom
_MEDIAN_CHI2 = 1.386


@dataclass(frozen=True)
class PinholeFrame:
    """One picture that was used: its place in the sequence, and its own tilt and roll (radians)."""

    index: int
    name: str
    tilt_rad: float
    roll_rad: float
    with_lines: bool


@dataclass(frozen=True)
class PinholeCalibration:
    """A camera that pictures determined.

    Parameters
    ----------
    camera : PinholeCamera
        With its standard deviations; tilt and roll where they were the same in all pictures, else None.
    std : mapping of str to float
        Standard deviations of ``focal_px``, ``height_m`` and, where it is fixed, ``tilt_rad``.
    correlation : float
        Between focal length and height.
    frames : tuple of PinholeFrame
        What was used.
    notes : tuple of str
        Lines the user should see.
    """

    camera: PinholeCamera
    std: Mapping[str, float]
    correlation: float
    frames: tuple[PinholeFrame, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Joint:
    """Log focal ratio and height (2,), their covariance (2, 2), and which estimates agree with them (N,) bool."""

    mean: FloatArray
    covariance: FloatArray
    agrees: FloatArray


def calibrate_pinhole(
    field: Field,
    images: Sequence[np.ndarray],
    start: PinholeCamera | None = None,
    *,
    names: Sequence[str] | None = None,
    poses: Mapping[str, Pose2] | None = None,
    max_frames: int = 24,
) -> PinholeCalibration | NotCalibrated:
    """Calibrate a pinhole camera by pictures of a goal, each from anywhere.

    Parameters
    ----------
    field : Field
        With goals of posts and a bar.
    images : sequence of (H, W, 3) uint8
        BGR, all of one size; read when they are asked for.
    start : PinholeCamera, optional
        Roughly right, some 18 % in focal length and 5 cm in height; its image centre and distortion are kept. Without
        it several are tried, with the image's middle as centre and no distortion.
    names : sequence of str, optional
        Of the images.
    poses : mapping of str to Pose2, optional
        Roughly where the camera was (0.4 m, 9 degrees), by image: lines alone then do, without a goal in view.
    max_frames : int
        At most so many pictures are used, evenly spread.

    Raises
    ------
    ArgumentError
        If the field has no goals of posts and a bar.
    """
    count = len(images)
    called = list(names) if names is not None else [str(index) for index in range(count)]
    chosen = [int(i) for i in np.unique(np.linspace(0, count - 1, min(count, max_frames)).round())]
    frames, notes = {}, []
    for index in chosen:
        try:
            frames[index] = images[index]
        except FrameError as error:
            notes.append(f"{error}: left out")
    if not frames:
        return NotCalibrated("none of the images can be read", tuple(notes))
    prior = {index: (poses or {}).get(called[index]) for index in frames}
    cameras = _best_starts(field, frames, start)
    if not cameras and start is not None and any(pose is not None for pose in prior.values()):
        # lines may do without a goal
        cameras = [_loosened(start)]
    results = []
    for camera in cameras:
        results.append(_calibrated(field, camera, frames, prior, called, tuple(notes)))
        if results[-1]:
            return results[-1]
    if results:
        return results[0]
    return NotCalibrated("no goal is found in any of the images, whatever the focal length may be", tuple(notes))


def _calibrated(
    field: Field,
    camera: PinholeCamera,
    frames: Mapping[int, np.ndarray],
    prior: Mapping[int, Pose2 | None],
    called: Sequence[str],
    earlier_notes: tuple[str, ...],
) -> PinholeCalibration | NotCalibrated:
    """Calibrate from one start, near enough for goals to be found."""
    notes = list(earlier_notes)
    joint, estimates = None, {}
    for _ in progress(range(_ROUNDS), _ROUNDS, "pinhole"):
        estimates = _camera_estimates(field, camera, frames, prior)
        if not estimates:
            return NotCalibrated("no goal is found in any of the images", tuple(notes))
        joint = _join(goal_shape(field), camera, list(estimates.values()))
        if joint is None:
            break
        camera = _moved(camera, joint)
    if joint is None:
        return NotCalibrated(
            "goals seen from the front, from afar and without lines do not separate the focal length from the "
            "distance: take pictures from the side and nearer",
            tuple(notes),
        )
    used = [index for index, agrees in zip(estimates, joint.agrees, strict=True) if agrees]
    focal_std, height_std_m = (float(s) for s in np.sqrt(np.diag(joint.covariance)))
    for what, std, most in (("focal length", focal_std, _MAX_FOCAL_STD), ("height", height_std_m, _MAX_HEIGHT_STD_M)):
        if std > most:
            size = f"{100 * std:.0f} %" if most is _MAX_FOCAL_STD and what == "focal length" else f"{std:.3f} m"
            return NotCalibrated(f"{len(used)} usable images leave the {what} uncertain by {size}", tuple(notes))
    if len(used) < len(frames):
        notes.append(
            f"{len(frames) - len(used)} of {len(frames)} images show no goal, or contradict the rest: left out"
        )
    if len(used) == 1:
        notes.append("one image cannot contradict itself: use several")
    return _result(camera, joint, {index: estimates[index] for index in used}, called, tuple(notes))


def _result(
    camera: PinholeCamera,
    joint: _Joint,
    estimates: Mapping[int, CameraEstimate],
    called: Sequence[str],
    notes: tuple[str, ...],
) -> PinholeCalibration:
    focal_std, height_std_m = np.sqrt(np.diag(joint.covariance))
    tilts, rolls = (np.array([s.unknowns[at] for s in estimates.values()]) for at in (TILT, ROLL))
    std = {"focal_px": float(focal_std * camera.focal_px[0]), "height_m": float(height_std_m)}
    own = np.array([s.covariance[TILT, TILT] for s in estimates.values()])
    is_fixed = len(tilts) > 1 and float(np.abs(tilts - np.median(tilts)).max()) < _FIXED_RAD
    tilt, roll = (float(np.median(t)) if is_fixed else None for t in (tilts, rolls))
    if is_fixed:
        std["tilt_rad"] = max(float(np.sqrt(1.0 / np.sum(1.0 / own))), float(np.std(tilts)) / math.sqrt(len(tilts)))
    else:
        notes = (*notes, "the tilt differs between the images, or there is but one: it is left unknown")
    final = replace(
        camera,
        tilt_rad=tilt,
        roll_rad=roll,
        height_std_m=max(float(height_std_m), 1e-4),
        focal_std_px=std["focal_px"],
    )
    used = tuple(
        PinholeFrame(i, called[i], float(s.unknowns[TILT]), float(s.unknowns[ROLL]), s.lines is not None)
        for i, s in estimates.items()
    )
    correlation = float(joint.covariance[0, 1] / (focal_std * height_std_m))
    return PinholeCalibration(final, std, correlation, used, notes)


def _loosened(camera: PinholeCamera) -> PinholeCamera:
    """Return a start with wide priors: tilt and roll unknown but upright."""
    focal_std_px = FOCAL_STD * camera.focal_px[0]
    return replace(
        camera, tilt_rad=None, roll_rad=None, pan_rad=None, height_std_m=HEIGHT_STD_M, focal_std_px=focal_std_px
    )


def _best_starts(field: Field, frames: Mapping[int, np.ndarray], given: PinholeCamera | None) -> list[PinholeCamera]:
    """Return the most promising starts, best first."""
    height, width = next(iter(frames.values())).shape[:2]
    some = dict(list(frames.items())[:: -(-len(frames) // _START_FRAMES)])
    middle = (width - 1) / 2, (height - 1) / 2
    if given is None:
        focals = [width / 2 / math.tan(view / 2) for view in VIEWS_RAD]
        starts = [PinholeCamera((width, height), (f, f), middle, up) for f in focals for up in HEIGHTS_M]
    else:
        (fu, fv), scales = given.focal_px, [math.exp(log) for log in SCAN]
        starts = [replace(given, focal_px=(fu * scale, fv * scale)) for scale in scales]
    ranked: list[tuple[int, float, PinholeCamera]] = []
    for camera in progress([_loosened(start) for start in starts], len(starts), "starts"):
        estimates = _camera_estimates(field, camera, some, dict.fromkeys(some))
        if not estimates:
            continue
        # among starts that see as many goals the one that must move least under its priors
        moved = np.array([s.unknowns[list(_SHARED)] for s in estimates.values()]) - (0.0, camera.height_m)
        deviation = float(np.median(np.abs(moved / (FOCAL_STD, HEIGHT_STD_M)).max(axis=1)))
        ranked.append((len(estimates), -deviation, camera))
    ranked.sort(key=lambda entry: entry[:2], reverse=True)
    return [camera for _, _, camera in ranked[:_STARTS_TRIED]]


def _camera_estimates(
    field: Field, camera: PinholeCamera, frames: Mapping[int, np.ndarray], prior: Mapping[int, Pose2 | None]
) -> dict[int, CameraEstimate]:
    estimator = GoalPoseEstimator(field, camera)
    estimates = {index: estimator.locate_camera(frame, prior[index]) for index, frame in frames.items()}
    return {index: estimate for index, estimate in estimates.items() if not isinstance(estimate, NotLocated)}


def _join(shape: GoalShape, camera: PinholeCamera, estimates: Sequence[CameraEstimate]) -> _Joint | None:
    """Join what the estimates say of the shared unknowns; None where that does not determine them."""
    of_each = [_shared_information(shape, camera, estimate) for estimate in estimates]
    information, weighted = np.array([i for i, _ in of_each]), np.array([w for _, w in of_each])
    wide = np.diag([FOCAL_STD**-2, HEIGHT_STD_M**-2])
    agrees = np.ones(len(estimates), dtype=bool)
    scale = 1.0
    for _ in range(6):
        total = information[agrees].sum(axis=0)
        if np.linalg.eigvalsh(total * np.outer((FOCAL_STD, HEIGHT_STD_M), (FOCAL_STD, HEIGHT_STD_M))).min() < 0.5:
            return None
        joint = np.linalg.inv(total)
        mean = joint @ weighted[agrees].sum(axis=0)
        off = weighted - information @ mean
        chi2 = np.einsum("ni,nij,nj->n", off, np.linalg.inv(information + wide), off)
        # fits of single pictures are surer of themselves than they should be: the spread between them tells
        scale = max(1.0, float(np.median(chi2)) / _MEDIAN_CHI2)
        now = chi2 <= scale * _MAX_OFF**2
        if (now == agrees).all():
            break
        agrees = now
    return _Joint(mean, scale * joint, agrees)


def _max_prior_information() -> FloatArray:
    """Greatest information (2,) that `loosened` leaves to priors on the shared unknowns."""
    view = IdealView((1.0, 1.0), (0.0, 0.0))
    model = GoalModel(GoalShape(1.0, 1.0, 1.0, 0.1), view, np.zeros(UNKNOWNS), np.full(UNKNOWNS, np.inf))
    return np.asarray(loosened(model).weight[list(_SHARED)])


def _shared_information(
    shape: GoalShape, camera: PinholeCamera, estimate: CameraEstimate
) -> tuple[FloatArray, FloatArray]:
    """Return what a picture alone says of the shared unknowns: information (2, 2), and it times the best ones (2,)."""
    shared, own = list(_SHARED), [i for i in range(UNKNOWNS) if i not in _SHARED]
    p = estimate.unknowns
    if estimate.lines is not None or estimate.fit is None:
        posterior = np.linalg.inv(estimate.covariance[np.ix_(shared, shared)])
        # without the priors that its fit has used, which with lines count no more than `loosened` lets them
        weight = np.array([(camera.focal_px[0] / camera.focal_std_px) ** 2, camera.height_std_m**-2])
        of_prior = np.diag(np.minimum(weight, _max_prior_information()))
        weighted = posterior @ p[shared] - of_prior @ [0.0, camera.height_m]
        return np.asarray(posterior - of_prior, np.float64), np.asarray(weighted, np.float64)
    model = goal_model(shape, camera, _BLOOM_STD_PX)
    weight = np.zeros(UNKNOWNS)
    weight[[ROLL, BLOOM]] = model.weight[[ROLL, BLOOM]]
    normal, pull = system_at(replace(model, weight=weight), estimate.fit.samples, p, _LOSS)
    across = np.linalg.solve(normal[np.ix_(own, own)], normal[np.ix_(own, shared)]).T
    information = normal[np.ix_(shared, shared)] - across @ normal[np.ix_(own, shared)]
    weighted = information @ p[shared] + (pull[shared] - across @ pull[own])
    return np.asarray(information, np.float64), np.asarray(weighted, np.float64)


def _moved(camera: PinholeCamera, joint: _Joint) -> PinholeCamera:
    # a step no longer than the priors allow: the picture is fitted again from there
    log_focal = float(np.clip(joint.mean[0], -2 * FOCAL_STD, 2 * FOCAL_STD))
    height_m = float(np.clip(joint.mean[1], camera.height_m / 2, camera.height_m * 2))
    focal = camera.focal_px[0] * math.exp(log_focal), camera.focal_px[1] * math.exp(log_focal)
    focal_std, height_std_m = _WIDEN * np.sqrt(np.diag(joint.covariance))
    return replace(
        camera,
        focal_px=focal,
        height_m=height_m,
        focal_std_px=float(np.clip(focal_std, _MIN_FOCAL_STD, FOCAL_STD)) * focal[0],
        height_std_m=float(np.clip(height_std_m, _MIN_HEIGHT_STD_M, HEIGHT_STD_M)),
    )
