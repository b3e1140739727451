"""A frame confirms a calibration only where a robot with the camera found sees itself at the pose fitted."""

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.calibration.omni.choice import confirmed
from robocup_vision.calibration.omni.fit import Fit
from robocup_vision.calibration.omni.model import SCALE, CameraModel
from robocup_vision.calibration.omni.starts import Observer
from robocup_vision.geometry import Pose2

FIELD = load_field("msl_6x4")
POSES = (Pose2(0.2, -0.1, 0.3), Pose2(-1.2, 0.6, 2.0))


@pytest.fixture(scope="module")
def fitted(mirror_camera, paint_field):
    rng = np.random.default_rng(5)
    frames = [paint_field(mirror_camera, FIELD, pose, noise=3.0, rng=rng) for pose in POSES]
    observer = Observer(FIELD, mirror_camera, None, locate=False)
    model = CameraModel(mirror_camera, "tangent")
    poses = np.array([pose.array for pose in POSES])
    fit = Fit(model, model.vector(mirror_camera), poses, 0.0, np.empty(0))
    return frames, fit, [observer.look(index, frame) for index, frame in enumerate(frames)]


def test_the_true_camera_at_the_true_poses_is_confirmed(fitted):
    frames, fit, sightings = fitted
    kept, notes = confirmed(FIELD, frames, fit, sightings)
    assert [sighting.index for sighting in kept] == [0, 1]
    assert [sighting.pose for sighting in kept] == list(POSES)
    assert not notes


def test_half_a_turn_about_the_centre_looks_alike(fitted):
    frames, fit, sightings = fitted
    turned = Fit(fit.model, fit.vector, np.array([pose.half_turn().array for pose in POSES]), 0.0, fit.residual_px)
    assert len(confirmed(FIELD, frames, turned, sightings)[0]) == 2


def test_a_frame_fitted_elsewhere_is_left_out(fitted):
    frames, fit, sightings = fitted
    away = fit.poses + np.array([[0.0, 0.0, 0.0], [0.0, 0.4, 0.0]])
    kept, notes = confirmed(FIELD, frames, Fit(fit.model, fit.vector, away, 0.0, fit.residual_px), sightings)
    assert [sighting.index for sighting in kept] == [0]
    assert list(notes) == [1]
    assert "somewhere else" in notes[1]


def test_by_a_wrong_curve_no_frame_is_confirmed(fitted):
    frames, fit, sightings = fitted
    wrong = fit.vector.copy()
    wrong[SCALE] += 0.4
    kept, notes = confirmed(FIELD, frames, Fit(fit.model, wrong, fit.poses, 0.0, fit.residual_px), sightings)
    assert not kept
    assert list(notes) == [0, 1]
