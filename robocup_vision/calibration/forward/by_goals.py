"""Estimates a forward camera that a neck may turn, from pictures of a goal and what else of the field is around it.

A goal tells where the camera was, and its tilt and roll, in each picture. From there camera and poses are fitted
together by all edges in view (`joint_fit`), with tilt and roll free in each picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.forward.by_edges import EdgeCalibration, EdgeCalibrationSettings, fit_jointly
from robocup_vision.calibration.forward.joint_fit import Sighting
from robocup_vision.calibration.forward.starts import KnownOfCamera, starts_about, starts_of
from robocup_vision.calibration.forward_parameters import HEIGHT, LOG_FOCAL, ForwardParameters
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges import tables
from robocup_vision.localization.goal import geometry
from robocup_vision.localization.goal.camera_estimate import CameraEstimate
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.localization.model_edges.field_edges import field_edges
from robocup_vision.progress import progress

# standard deviations of a start, of the logarithm of the focal length and of the height: farther off, goals are not
# found
_FOCAL_STD, _HEIGHT_STD_M = 0.05, 0.03
# how far a neck turns a camera up or down, and a body that walks leans
_NECK_STD_RAD = 0.5
# a camera whose tilt differs less than this between pictures is fixed on its robot
_MAX_TILT_SPREAD_RAD = math.radians(1.0)


def calibrate_by_goals(
    field: Field,
    frames: Mapping[int, UInt8Array],
    start: PinholeCamera | KnownOfCamera,
    prior: Mapping[int, Pose2 | None],
    trials: StartTrials,
    settings: EdgeCalibrationSettings = EdgeCalibrationSettings(),
) -> EdgeCalibration | NotCalibrated:
    """Calibrate a camera, which a neck may turn, by goals and the edges around them.

    Parameters
    ----------
    field : Field
        With goals of posts and a bar.
    frames : mapping of int to (H, W, 3) uint8
        BGR, by index.
    start : PinholeCamera or KnownOfCamera
        Of a camera the distortion is kept; one that is only roughly known has none.
    prior : mapping of int to Pose2 or None
        Where the camera roughly was (0.4 m, 9 degrees), by index. With one, lines are enough, without a goal in view.

    Raises
    ------
    ArgumentError
        If the field has no goals of posts and a bar.
    """
    height, width = next(iter(frames.values())).shape[:2]
    level = replace(start, tilt_rad=0.0)
    starts = starts_about(level) if isinstance(level, PinholeCamera) else starts_of((width, height), level)
    cameras = _best_starts(field, frames, starts, settings, trials)
    if not cameras and isinstance(start, PinholeCamera) and any(pose is not None for pose in prior.values()):
        # with a pose, lines may be enough
        cameras = [start]
    if not cameras:
        return NotCalibrated("no goal is found in any of the images, whatever the focal length may be")
    fits = [_fitted(field, camera, frames, prior, settings) for camera in progress(cameras, len(cameras), "by goals")]
    good = [fit for fit in fits if fit is not None]
    if not good:
        return NotCalibrated("no goal is found in any of the images")
    return max(good, key=lambda fit: (len(fit.fit.unknowns), -fit.rms_px))


def _fitted(
    field: Field,
    camera: PinholeCamera,
    frames: Mapping[int, UInt8Array],
    prior: Mapping[int, Pose2 | None],
    settings: EdgeCalibrationSettings,
) -> EdgeCalibration | None:
    """Locate pictures with a start, and fit; then again with what was fitted."""
    parameters = ForwardParameters(camera.with_orientation(0.0, 0.0, 0.0), bends=False)
    by_neck = replace(settings, fit=replace(settings.fit, sway_std_rad=_NECK_STD_RAD))
    edges, fit = field_edges(field), None
    for _ in range(settings.rounds):
        estimates = _camera_estimates(field, camera, frames, prior)
        if not estimates:
            return fit
        sightings = {
            index: Sighting(frames[index], _unknowns(one, prior[index]), edges) for index, one in estimates.items()
        }
        vector = parameters.vector(camera)
        vector[LOG_FOCAL] += float(np.median([one.unknowns[geometry.LOG_FOCAL] for one in estimates.values()]))
        vector[HEIGHT] = float(np.median([one.unknowns[geometry.HEIGHT] for one in estimates.values()]))
        again = fit_jointly(field, parameters, sightings, vector, by_neck)
        if again is None:
            return fit
        fit, camera = again, again.camera
    if fit is None:
        return None
    sightings = {index: replace(sightings[index], unknowns=held) for index, held in fit.fit.unknowns.items()}
    tilts = np.array([held[tables.TILT] for held in fit.fit.unknowns.values()])
    if len(tilts) > 1 and float(np.abs(tilts - np.median(tilts)).max()) < _MAX_TILT_SPREAD_RAD:
        return fit_jointly(field, parameters, sightings, fit.fit.vector, settings) or fit
    return replace(fit, camera=replace(fit.camera, tilt_rad=None, roll_rad=None))


def _unknowns(estimate: CameraEstimate, prior: Pose2 | None) -> np.ndarray:
    pose, held = estimate.estimate(prior).pose, estimate.unknowns
    return np.array([*pose.array, *held[[geometry.TILT, geometry.ROLL, geometry.HEIGHT]], 0.0])


def _loosened(camera: PinholeCamera) -> PinholeCamera:
    """Return a camera with wide priors: tilt and roll unknown but upright."""
    return replace(
        camera,
        tilt_rad=None,
        roll_rad=None,
        pan_rad=None,
        height_std_m=_HEIGHT_STD_M,
        focal_std_px=_FOCAL_STD * camera.focal_px[0],
    )


def _best_starts(
    field: Field,
    frames: Mapping[int, UInt8Array],
    starts: Sequence[PinholeCamera],
    settings: EdgeCalibrationSettings,
    trials: StartTrials,
) -> list[PinholeCamera]:
    """Return the starts that find most goals, best first."""
    some = dict(list(frames.items())[:: -(-len(frames) // settings.start_frames)])
    ranks = trials.results(_RankStart(field, some), starts, "starts")
    ranked = [(rank, camera) for rank, camera in zip(ranks, starts, strict=True) if rank[0]]
    ranked.sort(key=lambda entry: entry[0], reverse=True)
    return [camera for _, camera in ranked[: settings.starts_followed]]


@dataclass(frozen=True, eq=False)
class _RankStart:
    field: Field
    frames: Mapping[int, UInt8Array]

    def __call__(self) -> Callable[[PinholeCamera], tuple[int, float]]:
        def rank(camera: PinholeCamera) -> tuple[int, float]:
            """Return how many goals a start finds, and how good it is among those that find as many."""
            estimates = _camera_estimates(self.field, camera, self.frames, dict.fromkeys(self.frames))
            if not estimates:
                return 0, 0.0
            # of starts that find as many goals, the one that moves least under its priors is the best
            common = [s.unknowns[[geometry.LOG_FOCAL, geometry.HEIGHT]] for s in estimates.values()]
            moved = (np.array(common) - (0.0, camera.height_m)) / (_FOCAL_STD, _HEIGHT_STD_M)
            return len(estimates), -float(np.median(np.abs(moved).max(axis=1)))

        return rank


def _camera_estimates(
    field: Field, camera: PinholeCamera, frames: Mapping[int, UInt8Array], prior: Mapping[int, Pose2 | None]
) -> dict[int, CameraEstimate]:
    estimator = GoalPoseEstimator(field, _loosened(camera))
    estimates = {index: estimator.locate_camera(frame, prior[index]) for index, frame in frames.items()}
    return {index: estimate for index, estimate in estimates.items() if not isinstance(estimate, NotLocated)}
