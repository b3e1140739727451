"""The whole picture's verdict on a goal: lines, clutter, drawn lines, paint, and how unsure a camera is."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.localization.goal.arc import turned
from robocup_vision.localization.goal.camera_estimate import CameraEstimate
from robocup_vision.localization.goal.drawing import LineDrawing, line_pen
from robocup_vision.localization.goal.geometry import HEADING
from robocup_vision.localization.goal.goal_lines import CLUTTER_RATIO, Marks, along_lines
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.localization.goal.search import GoalSearch
from robocup_vision.localization.goal.verdict import with_spread
from robocup_vision.localization.line_map import LineMap
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, NEGATIVE_VIEWS, paper_places, sample_goal

FIELD = load_field("four_legged_2007")


def placed(x_m, y_m, std_m):
    """Place a camera, as certain of everything as said."""
    unknowns = np.zeros(8)
    unknowns[:2] = x_m, y_m
    return CameraEstimate(unknowns, np.eye(8) * std_m**2, (1,), None, None)


@given(offset_m=st.floats(0.0, 0.19), std_m=st.floats(0.001, 0.05), behind_nats=st.floats(0.0, 100.0))
def test_a_camera_is_as_uncertain_as_its_neighbours_differ(offset_m, std_m, behind_nats):
    best, other = placed(0.0, 0.0, std_m), placed(offset_m, 0.0, std_m)
    doubted = with_spread(best, [(300.0, best), (300.0 - behind_nats, other)], 0.2, 15.0)
    share = math.exp(-behind_nats / 15.0)
    expected = std_m**2 + offset_m**2 * share / (1.0 + share)
    assert doubted.covariance[0, 0] == pytest.approx(expected)
    assert doubted.covariance[1, 1] == pytest.approx(std_m**2)
    assert doubted.unknowns is best.unknowns


def test_a_camera_elsewhere_is_another_answer():
    best, other = placed(0.0, 0.0, 0.01), placed(0.5, 0.0, 0.01)
    assert with_spread(best, [(300.0, best), (299.0, other)], 0.2, 15.0).covariance == pytest.approx(best.covariance)


@pytest.mark.parametrize(("name", "index"), [("mild_glare_208x160", 5), ("streaks_416x320", 0)])
def test_boxes_before_lines_are_no_goal(name, index):
    condition = GOAL_CONDITIONS[name]
    sample = next(sample_goal(FIELD, condition, 778, 25, views=NEGATIVE_VIEWS, indices=[index], supersample=2))
    answer = GoalPoseEstimator(FIELD, condition.camera).locate(sample.frame)
    assert not answer
    assert re.search(r"reaches a log-likelihood ratio \d+ of the 260 that are needed", answer.reason)


def test_what_clutter_shows_speaks_for_no_camera_on_the_whole():
    off = np.linspace(-8.0, 8.0, 8001)
    none = np.empty((1, 2))

    def nats(residual_px, is_seen):
        return Marks(none, none, none, 8.0, np.array([is_seen])).nats(np.array([residual_px]))

    seen, missing = [nats(one, True) for one in off], nats(np.nan, False)
    # odds by clutter's own chances: a ridge anywhere within reach, or none
    mean = CLUTTER_RATIO * np.mean(np.exp(seen)) + (1 - CLUTTER_RATIO) * np.exp(missing)
    assert mean == pytest.approx(1.0, abs=2e-3)
    assert seen[len(off) // 2] > 0 > missing


CLEAN = GOAL_CONDITIONS["clean_416x320"]


@pytest.fixture(scope="module")
def sample():
    return next(sample_goal(FIELD, CLEAN, 11, 1, supersample=2))


def test_parts_are_made_once_and_reduced_as_the_search_says(sample):
    picture = GoalSearch(FIELD, CLEAN.camera).picture(sample.frame)
    assert picture.factor == 2
    assert picture.small.shape == (160, 208, 3)
    assert picture.masks is picture.masks
    assert set(picture.masks.paint) == {"cyan", "yellow"}
    assert picture.evidence("cyan") is picture.evidence("cyan")


def test_only_a_bent_lens_is_straightened(sample):
    plain = GoalSearch(FIELD, CLEAN.camera).picture(sample.frame)
    assert plain.straight is sample.frame
    assert plain.straight_masks is plain.masks
    bent = GoalSearch(FIELD, replace(CLEAN.camera, distortion=(-0.2, 0.0, 0.0, 0.0))).picture(sample.frame)
    assert not np.array_equal(bent.straight, sample.frame)


def test_the_whole_picture_speaks_for_the_true_camera_alone(sample):
    search = GoalSearch(FIELD, CLEAN.camera)
    picture = search.picture(sample.frame)
    found = search.candidates(picture)[0][0]
    true = search.nats(picture, found, found.fit.unknowns)
    for at, off in ((0, 0.3), (1, 0.3), (2, 0.1), (3, 0.1)):
        other = found.fit.unknowns.copy()
        other[at] += off
        assert search.nats(picture, found, other) < true - 50.0
    behind = found.fit.unknowns.copy()
    behind[2] += np.pi
    assert search.nats(picture, found, behind) == -np.inf


def test_paint_may_be_washed_white_but_has_no_more_of_another_colour(sample):
    search = GoalSearch(FIELD, CLEAN.camera)
    frame = np.full((320, 416, 3), (40, 120, 40), np.uint8)
    shades = {"cyan": (200, 160, 20), "white": (250, 250, 250), "orange": (20, 120, 240), "dark": (20, 20, 20)}
    for k, bgr in enumerate(shades.values()):
        frame[20:60, 100 * k + 10 : 100 * k + 90] = bgr
    mask = search.picture(frame).washable("cyan")
    assert [bool(mask[20, 50 * k + 25]) for k in range(4)] == [True, True, False, False]
    found = search.candidates(search.picture(sample.frame))[0][0]
    assert search.washable(search.picture(sample.frame), found.sides, found.fit.unknowns).min() > 0.9


CONDITION = GOAL_CONDITIONS["mild_glare_208x160"]
POINTS, _, STARTS = along_lines(LineMap(FIELD))
PEN = line_pen(POINTS, STARTS, FIELD.line_width_m)


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
