"""All field lines drawn together, against rendered pictures of a goal far off."""

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.localization.goal.arc import turned
from robocup_vision.localization.goal.drawing import LineDrawing, line_pen
from robocup_vision.localization.goal.geometry import HEADING
from robocup_vision.localization.goal.goal_lines import along_lines
from robocup_vision.localization.goal.search import GoalSearch
from robocup_vision.localization.lines.line_map import LineMap
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, paper_places, sample_goal

FIELD = load_field("four_legged_2007")
CONDITION = GOAL_CONDITIONS["mild_glare_208x160"]
POINTS = along_lines(LineMap(FIELD))[0]
PEN = line_pen(POINTS, FIELD.line_width_m)


@pytest.fixture(scope="module")
def far():
    sample = next(sample_goal(FIELD, CONDITION, 7, 66, places=paper_places(FIELD), indices=[61], supersample=3))
    search = GoalSearch(FIELD, CONDITION.camera)
    pose, camera = sample.pose, sample.camera
    truth = np.array([*pose.array, camera.tilt_rad, camera.roll_rad, camera.height_m, 0.0, 0.0])
    return sample.frame, search, truth


def test_lines_are_likeliest_where_they_are(far):
    frame, search, truth = far
    drawing = LineDrawing(frame, PEN)
    here = drawing.likelihood(search.colored_model, truth)
    assert here > 20
    for turn in (-0.2, -0.05, 0.05, 0.2):
        assert drawing.likelihood(search.colored_model, turned(search.colored_model, truth, turn)) < here - 5


@pytest.mark.parametrize("turn_rad", [0.03, -0.03])
def test_a_drawing_settles_where_the_camera_stands(far, turn_rad):
    frame, search, truth = far
    candidate = search.candidates(search.picture(frame))[0][0]
    drawing = LineDrawing(frame, PEN)
    start = turned(candidate.model, truth, turn_rad)
    drawn = drawing.settle(candidate.model, candidate.fit.samples.for_fit, start, 0.06)
    assert drawn is not None
    # the value told pays for what the samples give up there
    assert drawn.likelihood <= drawing.likelihood(candidate.model, drawn.unknowns)
    off = (drawn.unknowns - truth)[:3]
    assert np.hypot(off[0], off[1]) < 0.1
    assert abs(off[HEADING]) < np.radians(1.0)
    assert np.all(np.linalg.eigvalsh(drawn.covariance[:3, :3]) > 0)


def test_without_carpet_nothing_is_estimated(far):
    _, search, truth = far
    black = np.zeros((160, 208, 3), np.uint8)
    drawing = LineDrawing(black, PEN)
    assert drawing.likelihood(search.colored_model, truth) == 0.0
    assert (
        drawing.settle(
            search.colored_model, search.candidates(search.picture(far[0]))[0][0].fit.samples.for_fit, truth, 0.05
        )
        is None
    )
