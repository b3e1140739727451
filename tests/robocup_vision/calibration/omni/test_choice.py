"""What makes a fit an answer: limits refuse with their reasons, points are held out, and frames confirm the camera."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.calibration.omni.choice import Trust, confirmed, halves
from robocup_vision.calibration.omni.fit import FieldShape, Fit, Points
from robocup_vision.calibration.omni.model import SCALE, CameraModel
from robocup_vision.calibration.omni.settings import OmniCalibrationSettings
from robocup_vision.calibration.omni.starts import Observer
from robocup_vision.geometry import Pose2
from sim2d.rendering.cameras import sekimori_camera

FIELD = load_field("msl_6x4")
POSE = Pose2(0.3, -0.2, 0.4)
MAX_CHANGE = (22.0, 0.7, 0.4)


@pytest.fixture(scope="module")
def seen():
    """Return a fit that is right, and the points of the field's lines within 2.5 m that it explains."""
    camera = dataclasses.replace(sekimori_camera(), viewpoint_height_m=None)
    model = CameraModel(camera, "hyperboloid")
    lines = POSE.inverse().transform(FIELD.line_points(0.05))
    pixels = camera.floor_to_pixel(lines[np.hypot(*lines.T) < 2.5])
    count = len(pixels)
    points = Points(pixels, np.zeros(count, dtype=np.int64), np.ones(count, dtype=bool), np.ones(count))
    return Fit(model, model.vector(camera), POSE.array[None], 0.0, np.zeros(count)), points


def problem(seen, *, started=False, max_change=MAX_CHANGE, **changed):
    fit, points = seen
    trust = Trust(FieldShape(FIELD), started, 1.0, max_change, OmniCalibrationSettings(**changed))
    return trust.problem(fit, 1e-8 * np.eye(len(fit.vector)), points)


def lines_told_apart(seen):
    """Return the largest number of lines that a single image may be asked for."""
    return max(number for number in range(1, 30) if problem(seen, min_single_features=number) == "")


def test_a_sure_fit_of_many_lines_is_an_answer(seen):
    assert problem(seen) == ""
    assert problem(seen, started=True) == ""


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"min_inlier_ratio": 1.1}, "100% of the points found lie on"),
        ({"min_features": 30}, "look alike at any size"),
        ({"min_single_features": 30}, "one image of so few lines"),
        ({"max_range_std": 1e-9}, "floor's range"),
        ({"max_center_std_ratio": 1e-9}, "the centre"),
        ({"max_curve_std": 1e-9}, "the mirror's curve"),
        ({"max_change": (0.0, 0.7, 0.4)}, "the centre reached its limit, 0 px from the start's"),
        ({"max_change": (22.0, 0.7, 0.0), "started": True}, "the curve reached the limit that the start sets"),
    ],
)
def test_what_is_short_of_a_limit_is_refused(seen, changed, reason):
    assert reason in problem(seen, **changed)


def test_a_start_asks_for_its_own_number_of_lines(seen):
    assert problem(seen, started=True, min_single_features=30) == ""
    few = problem(seen, started=True, min_started_features=30)
    assert "one image of so few lines" in few
    lines = lines_told_apart(seen)
    # with no more lines than those the range must be known as well as without a start
    narrow = {"started": True, "max_range_std": 1e-9, "max_started_range_std": 1.0}
    assert problem(seen, min_started_features=lines - 1, **narrow) == ""
    assert "floor's range" in problem(seen, min_started_features=lines, **narrow)


def test_several_frames_may_show_few_lines(seen):
    fit, points = seen
    twice = Points(
        np.vstack([points.pixels] * 2),
        np.repeat([0, 1], len(points.pixels)),
        np.tile(points.is_line, 2),
        np.tile(points.weight, 2),
    )
    both = dataclasses.replace(fit, poses=np.vstack([fit.poses] * 2), residual_px=np.tile(fit.residual_px, 2))
    assert problem((both, twice), min_single_features=30) == ""


def test_few_lines_show_no_mirror_that_is_higher_than_robots(seen):
    low = {"max_height_radii": 0.5}
    assert seen[0].camera.height_m > 0.5 * FIELD.robot_radius_m
    lines = lines_told_apart(seen)
    assert problem(seen, min_started_features=lines - 1, **low) == ""
    few = {**low, "min_started_features": lines}
    assert "more than robots are: is field 'msl_6x4' that of the image?" in problem(seen, **few)
    assert problem(seen, started=True, **few) == ""


def test_how_well_the_range_is_known_is_said_near_and_far(seen):
    fit, _ = seen
    covariance = np.zeros((len(fit.vector), len(fit.vector)))
    covariance[4, 4] = 0.01**2
    trust = Trust(FieldShape(FIELD), False, 1.0, MAX_CHANGE)
    note = trust.range_note(fit, covariance)
    assert note == "its standard deviation is 1.0 % at 0.75 m, 1.0 % at 1.5 m, 1.0 % at 2.5 m"
    vector = fit.vector.copy()
    vector[4] -= np.log(1.05)
    with_other = trust.range_note(fit, covariance, [fit.model.camera(vector)])
    assert with_other.startswith(note + " by this curve; 3.7 % at 0.75 m")
    assert with_other.endswith("with others that explain as much")


@given(st.lists(st.lists(st.integers(0, 31), min_size=2, max_size=20), min_size=1, max_size=4))
def test_every_frame_has_points_in_both_halves(sectors):
    frame = np.concatenate([np.full(len(own), index) for index, own in enumerate(sectors)])
    sector = np.concatenate(sectors)
    half = halves(sector, frame)
    for index, own in enumerate(sectors):
        assert set(half[frame == index].tolist()) == {0, 1}
        if len({one % 2 for one in own}) == 2:
            np.testing.assert_array_equal(half[frame == index], np.array(own) % 2)


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


@pytest.mark.parametrize("poses", [POSES, [pose.half_turn() for pose in POSES]], ids=["true", "half a turn"])
def test_the_true_camera_is_confirmed_at_poses_that_look_alike(fitted, poses):
    frames, fit, sightings = fitted
    fit = dataclasses.replace(fit, poses=np.array([pose.array for pose in poses]))
    kept, notes = confirmed(FIELD, frames, fit, sightings)
    assert [sighting.index for sighting in kept] == [0, 1]
    assert [sighting.pose for sighting in kept] == list(poses)
    assert not notes


def test_a_frame_fitted_elsewhere_is_left_out(fitted):
    frames, fit, sightings = fitted
    away = fit.poses + np.array([[0.0, 0.0, 0.0], [0.0, 0.4, 0.0]])
    kept, notes = confirmed(FIELD, frames, dataclasses.replace(fit, poses=away), sightings)
    assert [sighting.index for sighting in kept] == [0]
    assert list(notes) == [1]
    assert "somewhere else" in notes[1]


def test_by_a_wrong_curve_no_frame_is_confirmed(fitted):
    frames, fit, sightings = fitted
    wrong = fit.vector.copy()
    wrong[SCALE] += 0.4
    kept, notes = confirmed(FIELD, frames, dataclasses.replace(fit, vector=wrong), sightings)
    assert not kept
    assert list(notes) == [0, 1]
