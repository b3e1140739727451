"""Calibration of a forward camera's lens and mounting from all visible edges of any field."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.forward.calibrator import Calibrator, Locate
from robocup_vision.calibration.forward.joint_fit import SWAY_STD_M, JointFit, Sighting
from robocup_vision.calibration.forward_parameters import HEIGHT, LENS, LOG_FOCAL, TILT, ForwardParameters
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.geometry import Pose2
from robocup_vision.localization.model_edges.evidence import CandidateSettings
from robocup_vision.localization.model_edges.finder import EdgeFinder, FinderSettings
from robocup_vision.localization.model_edges.follower import EdgeFollower
from robocup_vision.localization.model_edges.settings import EdgeSettings
from robocup_vision.localization.model_edges.weights import packaged_edge_weights

# chi-square with two degrees of freedom, 99.9 %
_BENDS_CHI2 = 13.8
# standard deviations while starts are compared: of tilt and roll, and of height and focal length, relative; the poses
# only have to start a fit
_ANGLE_STD_RAD, _HEIGHT_RATIO, _FOCAL_STD = 0.05, 0.1, 0.06
# greatest ranges of lines by which poses are proposed, with a start and with a result
_START_RANGE_M, _RANGE_M = 6.0, 10.0
# limits for the pose of a single picture, weaker than those of localisation, because one camera has to fit all pictures
_CANDIDATES, _MAX_STD_M = CandidateSettings(min_probability=0.1, max_candidates=1), 0.3


def calibrate_by_edges(
    field: Field,
    frames: Mapping[int, UInt8Array],
    starts: Sequence[PinholeCamera],
    prior: Mapping[int, Pose2],
    trials: StartTrials,
) -> JointFit | NotCalibrated:
    """Calibrate a camera from all visible edges.

    Parameters
    ----------
    frames : mapping of int to (H, W, 3) uint8
        BGR, by index.
    starts : sequence of PinholeCamera
        Cameras of which one is close to the true one: focal length within 10 %, height within 15 %, and tilt, the same
        in all pictures, within 3 degrees.
    prior : mapping of int to Pose2
        Approximate camera poses (0.4 m, 9 degrees), by index, as far as known.
    """
    prepare("pinhole_edges")
    calibrator = Calibrator(field, frames, prior, _EdgeLocator(field))
    best = calibrator.best(starts, trials)
    if not best or best.parameters.coefficients or isinstance(best.camera, FisheyeCamera):
        return best
    return _bent(calibrator, best)


@dataclass(frozen=True, eq=False)
class _EdgeLocator:
    """Locates cameras by edges of lines, goals and walls."""

    field: Field
    nothing: str = "neither lines, goals nor walls place the camera in any of the images"

    def of_start(self, camera: PinholeCamera) -> Locate:
        """Return a function that locates a start camera."""
        loose = replace(
            camera,
            offset_m=(0.0, 0.0),
            pan_rad=0.0,
            roll_rad=camera.roll_rad or 0.0,
            tilt_std_rad=_ANGLE_STD_RAD,
            roll_std_rad=_ANGLE_STD_RAD,
            height_std_m=_HEIGHT_RATIO * camera.height_m,
            focal_std_px=_FOCAL_STD * camera.focal_px[0],
        )
        return self._of(loose, _START_RANGE_M)

    def of_fit(self, fit: JointFit) -> Locate:
        """Return a function that locates a fitted camera."""
        std = np.sqrt(np.diag(fit.covariance))
        _, sway = fit.camera.sway_std_rad
        tilt_std = math.hypot(sway, float(std[TILT]))
        camera = replace(
            fit.camera,
            tilt_std_rad=tilt_std,
            roll_std_rad=tilt_std,
            height_std_m=math.hypot(SWAY_STD_M, float(std[HEIGHT])),
            focal_std_px=float(std[LOG_FOCAL]) * fit.camera.focal_px[0],
        )
        return self._of(camera, _RANGE_M)

    def _of(self, camera: PinholeCamera, range_m: float) -> Locate:
        """Return a function that locates a camera within its standard deviations, by lines up to a range."""
        how = FinderSettings(max_range_m=range_m, nods=(), candidates=_CANDIDATES, max_std_m=_MAX_STD_M)
        weights = packaged_edge_weights()
        finder = EdgeFinder(EdgeFollower(self.field, camera, EdgeSettings().for_unconfirmed_frames()), how)

        def locate(frame: UInt8Array, near: Pose2 | None) -> tuple[float, Sighting] | None:
            follower = finder.follower
            follower.forget()
            follower.forget_paint()
            answer = finder.find(frame, near)
            if not answer:
                return None
            # the focal length that a single picture gives depends on the assumed height; the joint fit uses all
            held = np.array([*answer.estimate.pose.array, *answer.camera_unknowns[:3], 0.0])
            probability = 1.0 / (1.0 + math.exp(-answer.evidence.log_odds_anywhere(weights)))
            return probability, Sighting(frame, held, follower.painted_edges)

        return locate


def _bent(calibrator: Calibrator, straight: JointFit) -> JointFit:
    """Return a fit with distortion if that is significant."""
    parameters = ForwardParameters(straight.parameters.start)
    vector = parameters.vector(straight.camera)
    vector[:LENS] = straight.vector[:LENS]
    bent = calibrator.fitted(parameters, calibrator.located(calibrator.locator.of_fit(straight)), vector)
    if bent is None:
        return straight
    lens, covariance = bent.vector[LENS:], bent.covariance[LENS:, LENS:]
    if lens @ np.linalg.solve(covariance, lens) < _BENDS_CHI2:
        return straight
    return calibrator.again(bent) or bent
