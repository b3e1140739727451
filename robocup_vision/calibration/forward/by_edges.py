"""Estimates a forward camera's lens and how it is mounted by all edges of the field in view, on any field.

Pictures are located with the camera as it is thought to be, loosely at first, and then camera and poses are fitted
together (`joint_fit`). The pictures are located again with the result: more of them, and by farther lines. Which starts
are followed so far is told by how many pictures they locate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.forward.joint_fit import JointFit, JointFitSettings, JointFitter, Sighting
from robocup_vision.calibration.forward_parameters import HEIGHT, LENS, LOG_FOCAL, TILT, ForwardParameters
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.localization.model_edges.evidence import CandidateSettings, log_weight
from robocup_vision.localization.model_edges.finder import EdgeFinder, FinderSettings
from robocup_vision.localization.model_edges.follower import EdgeFollower
from robocup_vision.localization.model_edges.settings import EdgeSettings
from robocup_vision.progress import progress

# chi-square with two degrees of freedom, 99.9 %
_BENDS_CHI2 = 13.8


@dataclass(frozen=True, slots=True)
class EdgeCalibrationSettings:
    """Settings of a calibration by edges."""

    #: pictures that starts are compared by; one that has located none of the first half of them is given up
    start_frames: int = 6
    #: starts that all pictures are located by; how often they are located with the best, each time with the result
    #: before: the second time more of them are located, the third time nothing changes
    starts_followed: int = 4
    rounds: int = 3
    #: standard deviations while starts are compared: of the tilt, of the height and of the focal length, the latter two
    #: by themselves. The poses found serve to begin a fit.
    angle_std_rad: float = 0.05
    height_ratio: float = 0.1
    focal_std: float = 0.06
    #: how far lines may be away that a start, and that a result, proposes poses by
    start_range_m: float = 6.0
    range_m: float = 10.0
    #: what a picture alone must show of its pose. That is less than one that is to be located: the pictures together
    #: decide, as one camera must fit them all.
    candidates: CandidateSettings = CandidateSettings(min_probability=0.1, max_candidates=1)
    max_std_m: float = 0.3
    fit: JointFitSettings = JointFitSettings()  #: of the joint fit


@dataclass(frozen=True, eq=False)
class EdgeCalibration:
    """A camera by edges."""

    camera: PinholeCamera  #: the result
    parameters: ForwardParameters  #: what the vector of the fit means
    fit: JointFit  #: the last fit

    @property
    def covariance(self) -> FloatArray:
        """(G, G) float64: of tilt, roll (rad), height (m), logarithm of the focal length, centre u, v (px), ..."""
        return self.fit.covariance

    @property
    def rms_px(self) -> float:
        """Root mean square of the residuals of all samples that count."""
        return math.sqrt(float(np.mean(np.concatenate(list(self.fit.residual_px.values())) ** 2)))


def calibrate_by_edges(
    field: Field,
    frames: Mapping[int, UInt8Array],
    starts: Sequence[PinholeCamera],
    prior: Mapping[int, Pose2 | None],
    trials: StartTrials,
    settings: EdgeCalibrationSettings = EdgeCalibrationSettings(),
) -> EdgeCalibration | NotCalibrated:
    """Calibrate a camera by all edges in view.

    Parameters
    ----------
    frames : mapping of int to (H, W, 3) uint8
        BGR, by index.
    starts : sequence of PinholeCamera
        One of them is about right: focal length within 10 %, height within 15 %, tilt, the same in all pictures,
        within 3 degrees.
    """
    some = dict(list(frames.items())[:: -(-len(frames) // settings.start_frames)])
    ranks = trials.results(_RankStart(field, some, prior, settings), starts, "starts")
    order = sorted(range(len(starts)), key=lambda place: ranks[place], reverse=True)
    likely = [starts[place] for place in order[: settings.starts_followed] if ranks[place] > 0.0]
    if not likely:
        return NotCalibrated("neither lines, goals nor walls place the camera in any of the images")
    followed = [
        _fitted(field, start, frames, prior, settings, 2) for start in progress(likely, len(likely), "likeliest starts")
    ]
    fits = [fit for fit in followed if fit is not None]
    if not fits:
        return NotCalibrated("too little of lines, goals and walls is in view in the images")
    best = max(fits, key=lambda fit: (len(fit.fit.unknowns), -fit.rms_px))
    for _ in progress(range(2, settings.rounds), settings.rounds - 2, "by edges"):
        best = _again(field, best, frames, prior, settings) or best
    if not best.parameters.coefficients and not isinstance(best.camera, FisheyeCamera):
        return _bent(field, best, frames, prior, settings)
    return best


@dataclass(frozen=True, eq=False)
class _RankStart:
    field: Field
    frames: Mapping[int, UInt8Array]
    prior: Mapping[int, Pose2 | None]
    settings: EdgeCalibrationSettings

    def __call__(self) -> Callable[[PinholeCamera], float]:
        def rank(camera: PinholeCamera) -> float:
            """Return how many pictures a camera locates."""
            finder = _start_finder(self.field, camera, self.settings)
            total = 0.0
            for number, (index, frame) in enumerate(self.frames.items()):
                if 2 * number >= len(self.frames) and total < 0.5:
                    break
                answer = _find(finder, frame, self.prior[index])
                if answer is not None:
                    total += answer[0]
            return total

        return rank


def _start_finder(field: Field, camera: PinholeCamera, settings: EdgeCalibrationSettings) -> EdgeFinder:
    loose = replace(
        camera,
        offset_m=(0.0, 0.0),
        pan_rad=0.0,
        roll_rad=camera.roll_rad or 0.0,
        tilt_std_rad=settings.angle_std_rad,
        roll_std_rad=settings.angle_std_rad,
        height_std_m=settings.height_ratio * camera.height_m,
        focal_std_px=settings.focal_std * camera.focal_px[0],
    )
    return _finder(field, loose, settings.start_range_m, settings)


def _finder(field: Field, camera: PinholeCamera, range_m: float, settings: EdgeCalibrationSettings) -> EdgeFinder:
    how = FinderSettings(max_range_m=range_m, nods=(), candidates=settings.candidates, max_std_m=settings.max_std_m)
    return EdgeFinder(EdgeFollower(field, camera, EdgeSettings().for_unconfirmed_frames()), how)


def _find(finder: EdgeFinder, frame: UInt8Array, near: Pose2 | None) -> tuple[float, Sighting] | None:
    """Locate the camera by a picture alone: how probably it is right, and where it was."""
    follower = finder.follower
    follower.forget()
    follower.forget_paint()
    answer = finder.find(frame, near)
    if not answer:
        return None
    tilt, roll, height, _ = answer.camera_unknowns
    pose = answer.estimate.pose
    # one picture determines the focal length by the camera's height; the joint fit uses all of them
    held = np.array([pose.x_m, pose.y_m, pose.theta_rad, tilt, roll, height, 0.0])
    probability = 1.0 / (1.0 + math.exp(-log_weight(answer.evidence, finder.settings.candidates)))
    return probability, Sighting(frame, held, follower.painted_edges)


def _located(
    finder: EdgeFinder, frames: Mapping[int, UInt8Array], prior: Mapping[int, Pose2 | None]
) -> dict[int, Sighting]:
    found = {index: _find(finder, frame, prior[index]) for index, frame in frames.items()}
    return {index: one[1] for index, one in found.items() if one is not None}


def _fitted(
    field: Field,
    start: PinholeCamera,
    frames: Mapping[int, UInt8Array],
    prior: Mapping[int, Pose2 | None],
    settings: EdgeCalibrationSettings,
    rounds: int,
) -> EdgeCalibration | None:
    """Locate pictures with a start, and fit; then again with what was fitted."""
    upright = start.with_orientation(0.0, start.tilt_rad, start.roll_rad or 0.0)
    parameters = ForwardParameters(upright, bends=isinstance(start, FisheyeCamera) or start.is_bent)
    sightings = _located(_start_finder(field, upright, settings), frames, prior)
    fit = fit_jointly(field, parameters, sightings, parameters.vector(parameters.start), settings)
    for _ in range(1, rounds):
        fit = None if fit is None else _again(field, fit, frames, prior, settings)
    return fit


def _again(
    field: Field,
    fit: EdgeCalibration,
    frames: Mapping[int, UInt8Array],
    prior: Mapping[int, Pose2 | None],
    settings: EdgeCalibrationSettings,
) -> EdgeCalibration | None:
    """Locate pictures with a camera that was fitted, each alone, and fit it again."""
    std, own = np.sqrt(np.diag(fit.covariance)), settings.fit
    sway = own.sway_std_rad if fit.camera.roll_std_rad is None else fit.camera.roll_std_rad
    tilt_std = math.hypot(sway, float(std[TILT]))
    camera = replace(
        fit.camera,
        tilt_std_rad=tilt_std,
        roll_std_rad=tilt_std,
        height_std_m=math.hypot(own.sway_std_m, float(std[HEIGHT])),
        focal_std_px=float(std[LOG_FOCAL]) * fit.camera.focal_px[0],
    )
    finder = _finder(field, camera, settings.range_m, settings)
    return fit_jointly(field, fit.parameters, _located(finder, frames, prior), fit.fit.vector, settings)


def fit_jointly(
    field: Field,
    parameters: ForwardParameters,
    sightings: Mapping[int, Sighting],
    vector: FloatArray,
    settings: EdgeCalibrationSettings,
) -> EdgeCalibration | None:
    """Fit camera and poses from where pictures were located; None where no picture agrees."""
    fit = JointFitter(field, parameters, settings.fit).fit(sightings, vector)
    return None if fit is None else EdgeCalibration(parameters.camera(fit.vector), parameters, fit)


def _bent(
    field: Field,
    straight: EdgeCalibration,
    frames: Mapping[int, UInt8Array],
    prior: Mapping[int, Pose2 | None],
    settings: EdgeCalibrationSettings,
) -> EdgeCalibration:
    """Return the fit by a lens that bends lines, where it clearly does."""
    parameters = ForwardParameters(straight.parameters.start)
    vector = parameters.vector(straight.camera)
    vector[:LENS] = straight.fit.vector[:LENS]
    finder = _finder(field, straight.camera, settings.range_m, settings)
    bent = fit_jointly(field, parameters, _located(finder, frames, prior), vector, settings)
    if bent is None:
        return straight
    lens, covariance = bent.fit.vector[LENS:], bent.covariance[LENS:, LENS:]
    if lens @ np.linalg.solve(covariance, lens) < _BENDS_CHI2:
        return straight
    return _again(field, bent, frames, prior, settings) or bent
