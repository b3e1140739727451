"""Lines around a white goal: which starts are tried."""

from dataclasses import replace

import pytest

from field_models import load_field
from robocup_vision.localization.goal.geometry import HEADING
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.localization.goal.search import GoalSearch
from robocup_vision.localization.goal.white_lines import WhiteGoalLines, WhiteLineSettings, loosened
from robocup_vision.localization.lines.line_map import LineMap
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, sample_goal

FIELD = load_field("spl_2020")
CONDITION = GOAL_CONDITIONS["white_640x480"]


@pytest.fixture(scope="module")
def seen():
    """Frame, model and camera of a goal that is located with its lines."""
    estimator = GoalPoseEstimator(FIELD, CONDITION.camera)
    for sample in sample_goal(FIELD, CONDITION, 1234, 60, supersample=2):
        located = estimator.locate_camera(sample.frame)
        if located and located.lines is not None:
            return sample.frame, loosened(GoalSearch(FIELD, CONDITION.camera).white_model), located.unknowns
    raise AssertionError("no goal is located with its lines")


def fit_from(seen, first, others, clear_ratio):
    """Fit from a start and others; returns the fit, and how many of the others were asked for."""
    frame, model, unknowns = seen
    settings = replace(WhiteLineSettings(), clear_ratio=clear_ratio)
    lines = WhiteGoalLines(LineMap(FIELD), CONDITION.camera, settings)
    asked = []
    fitted = lines.fit_points(
        model, first, None, lines.points(frame, unknowns), (asked.append(one) or one for one in others)
    )
    return fitted, len(asked)


def test_no_other_start_is_tried_where_lines_lie_on_lines(seen):
    _, _, unknowns = seen
    turned = unknowns.copy()
    turned[HEADING] += 0.6
    clear, asked = fit_from(seen, unknowns, [turned], 0.5)
    assert asked == 0
    assert clear.line_ratio > 0.5
    unclear, asked = fit_from(seen, unknowns, [turned], 1.1)
    assert asked == 1
    assert unclear.unknowns.tolist() == clear.unknowns.tolist()
    best, asked = fit_from(seen, turned, [unknowns], 1.1)
    assert asked == 1
    assert best.line_ratio >= clear.line_ratio
