"""What makes a fit an answer: each limit refuses with its reason, and what is left in doubt is said."""

import dataclasses

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.calibration.omni.choice import Trust
from robocup_vision.calibration.omni.fit import FieldShape, Fit, Points
from robocup_vision.calibration.omni.model import CameraModel
from robocup_vision.calibration.omni.settings import OmniCalibrationSettings
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


def problem(seen, covariance_scale=1e-8, *, started=False, **changed):
    fit, points = seen
    trust = Trust(FieldShape(FIELD), started, 1.0, MAX_CHANGE, OmniCalibrationSettings(**changed))
    return trust.problem(fit, covariance_scale * np.eye(len(fit.vector)), points)


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
