"""Estimates a pinhole camera's focal length, height, tilt and roll by all edges of the field in view, on any field.

Pictures are located with the camera as it is thought to be, and what each of them tells of the camera is added up with
its own pose left out, as while a robot plays (`calibration.online`). The pictures are located again with the result. A
start that is some percent off locates little: focal lengths about it are tried first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.online.evidence import Evidence
from robocup_vision.calibration.online.pinhole import PinholeEvidence
from robocup_vision.calibration.online.settings import OnlineSettings
from robocup_vision.calibration.starts import JsonForm, StartTrials
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.progress import progress
from robocup_vision.view import View
from robocup_vision.vision import Vision


@dataclass(frozen=True, slots=True)
class EdgeCalibrationSettings:
    """Settings of a calibration by edges.

    Parameters
    ----------
    start_frames, rounds : int
        Pictures that starts are compared by; fits of all pictures, each about the result before.
    focal_std, height_std_m, angle_std_rad, center_std_px : float
        Standard deviations of a start, of the logarithm of the focal length, the height, tilt and roll, and the centre
        in pictures 208 wide. A centre is hardly told from a tilt: its file is trusted.
    """

    start_frames: int = 5
    rounds: int = 4
    focal_std: float = 0.1
    height_std_m: float = 0.1
    angle_std_rad: float = math.radians(3.0)
    center_std_px: float = 1.0


@dataclass(frozen=True, eq=False)
class EdgeCalibration:
    """A camera by edges.

    Parameters
    ----------
    camera : PinholeCamera
        The result.
    covariance : (6, 6) float64
        Of tilt, roll (rad), height (m), logarithm of the focal length, centre u, v (px).
    views : mapping of int to View
        The pictures that were used, by index, as the result before the last round shows them.
    """

    camera: PinholeCamera
    covariance: FloatArray
    views: Mapping[int, View]

    @property
    def held(self) -> dict[int, PinholeCamera]:
        """The camera as each picture shows it to be held."""
        return {index: _held(view) for index, view in self.views.items()}


def calibrate_by_edges(
    field: Field,
    frames: Mapping[int, np.ndarray],
    starts: Sequence[PinholeCamera],
    prior: Mapping[int, Pose2 | None],
    trials: StartTrials,
    settings: EdgeCalibrationSettings = EdgeCalibrationSettings(),
) -> EdgeCalibration | NotCalibrated:
    """Calibrate a camera by all edges in view.

    Parameters
    ----------
    field : Field
        The pitch.
    frames : mapping of int to (H, W, 3) uint8
        BGR, by index.
    starts : sequence of PinholeCamera
        Of one of which focal length and height are known to some percent. Where the tilt is unknown, it must be the
        same in all pictures, and goals must be posts.
    prior : mapping of int to Pose2 or None
        Where the camera roughly was, by index.
    trials : StartTrials
        Tries focal lengths about the starts.
    settings : EdgeCalibrationSettings, optional
        Of starts and fit.
    """
    some = dict(list(frames.items())[:: -(-len(frames) // settings.start_frames)])
    cameras = list(starts)
    ranks = trials.results(_RankStart(field, some, prior), cameras, "focal lengths", JsonForm(tuple, tuple))
    best = max(range(len(cameras)), key=lambda place: ranks[place])
    if not ranks[best][0]:
        return NotCalibrated("neither lines, goals nor walls place the camera in any of the images")
    start = cameras[best]
    if not start.known_orientation:
        held = [_held(view) for view in _located(field, start, some, prior).values()]
        tilts = np.array([one.tilt_rad or 0.0 for one in held])
        tilt, roll = float(np.median(tilts)), float(np.median([one.roll_rad or 0.0 for one in held]))
        if np.abs(tilts - tilt).max() > settings.angle_std_rad:
            return NotCalibrated("the tilt differs between the images")
        start = start.with_orientation(start.pan_rad, tilt, roll)
    camera, result = start, None
    for _ in progress(range(settings.rounds), settings.rounds, "by edges"):
        maker = PinholeEvidence(field, camera, None, OnlineSettings())
        told = _told(maker, _located(field, camera, frames, prior), frames, camera, settings)
        if not told:
            return NotCalibrated("too little of lines, goals and walls is in view in the images")
        result = _joined(maker, start, camera, told, settings)
        camera = result.camera
    assert result is not None
    return result


def _held(view: View) -> PinholeCamera:
    assert isinstance(view.camera, PinholeCamera)
    return view.camera


@dataclass(frozen=True, eq=False)
class _RankStart:
    field: Field
    frames: Mapping[int, np.ndarray]
    prior: Mapping[int, Pose2 | None]

    def __call__(self) -> Callable[[PinholeCamera], tuple[int, float]]:
        def rank(camera: PinholeCamera) -> tuple[int, float]:
            """Return how many pictures a camera locates, and how well its edges agree in them."""
            views = _located(self.field, camera, self.frames, self.prior).values()
            residuals_px = [view.pose.residual_px for view in views if view.pose]
            return len(residuals_px), -float(np.median(residuals_px)) if residuals_px else 0.0

        return rank


def _located(
    field: Field, camera: PinholeCamera, frames: Mapping[int, np.ndarray], prior: Mapping[int, Pose2 | None]
) -> dict[int, View]:
    vision = Vision(field, camera)
    views = {}
    for index, frame in frames.items():
        vision.forget()
        near = prior[index]
        view = vision.look(frame, prior=None if near is None else near.compose(camera.camera_in_robot.inverse()))
        if view.pose:
            views[index] = view
    return views


@dataclass(frozen=True, eq=False)
class _Told:
    """What one picture tells, and how it was seen."""

    evidence: Evidence
    view: View


def _told(
    maker: PinholeEvidence,
    views: Mapping[int, View],
    frames: Mapping[int, np.ndarray],
    camera: PinholeCamera,
    settings: EdgeCalibrationSettings,
) -> dict[int, _Told]:
    about, covariance = maker.vector(camera), np.diag(_std(camera, settings) ** 2)
    evidence = {index: maker.of(frames[index], view, about, covariance, about) for index, view in views.items()}
    return {index: _Told(one, views[index]) for index, one in evidence.items() if one is not None}


def _std(camera: PinholeCamera, settings: EdgeCalibrationSettings) -> FloatArray:
    """(6,) float64: standard deviations of a start."""
    angle, center = settings.angle_std_rad, settings.center_std_px * camera.size_px[0] / 208.0
    return np.array([angle, angle, settings.height_std_m, settings.focal_std, center, center])


def _joined(
    maker: PinholeEvidence,
    start: PinholeCamera,
    camera: PinholeCamera,
    told: Mapping[int, _Told],
    settings: EdgeCalibrationSettings,
) -> EdgeCalibration:
    """Add up what pictures tell about a camera, with what is believed of the start."""
    about = maker.vector(camera)
    precision = np.diag(_std(camera, settings) ** -2.0)
    before = precision @ (maker.vector(start) - about)
    information = np.array([one.evidence.information for one in told.values()])
    gradient = np.array([one.evidence.gradient for one in told.values()])
    total, pull = precision + information.sum(axis=0), before + gradient.sum(axis=0)
    covariance = np.linalg.inv(total)
    step = covariance @ pull
    count = len(told)
    if count > 1:
        # pictures differ by more than their samples' noise: by what each of them moves the result
        without = np.array(
            [np.linalg.solve(total - own, pull - pulls) for own, pulls in zip(information, gradient, strict=True)]
        )
        off = without - without.mean(axis=0)
        covariance = covariance + (count - 1) / count * off.T @ off
    return EdgeCalibration(maker.camera(about + step), covariance, {index: one.view for index, one in told.items()})
