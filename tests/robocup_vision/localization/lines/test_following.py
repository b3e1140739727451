"""Lines followed from frame to frame, and the map of a field's lines."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision import Pose2, Vision
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.pose_estimator import LinePoseEstimator
from sim2d.match.setups import camera_for
from sim2d.robot_link import RobotLimits
from sim2d.sensors.match_camera import MatchCamera
from sim2d.world.state import RobotState, WorldState

FIELD = load_field("msl_18x12")
CAMERA = camera_for(FIELD)
TRUTH = Pose2(5.5, -2.0, 0.7)


@pytest.fixture(scope="module")
def frame():
    """Return what a robot of the middle size league sees near a penalty area."""
    state = WorldState(0.0, (RobotState(0, 1, 0, TRUTH, (0.0, 0.0), 0.0),), None, (0, 0), "play", 1, ())
    return MatchCamera(FIELD, CAMERA, RobotLimits(), np.random.default_rng(3)).render(state, 0)


@pytest.fixture(scope="module")
def lines():
    return LinePoseEstimator(FIELD, CAMERA)


def test_the_followed_pose_is_the_searched_one(frame, lines):
    points = lines.finder.find(frame)
    searched = lines.locate(points)
    followed = lines.follow(points, Pose2(5.4, -2.1, 0.75))
    assert followed.pose.error_to(TRUTH)[0] < 0.05
    # of the two poses of a symmetric field the one that is expected comes first
    assert min(pose.error_to(followed.pose)[0] for pose in searched.candidates) < 0.005
    assert len(followed.candidates) == 2


@pytest.mark.parametrize("start", [Pose2(4.5, -1.0, 0.7), Pose2(5.5, -2.0, 0.7 + math.radians(60))])
def test_a_wrong_start_is_refused(frame, lines, start):
    assert not lines.follow(frame, start)


def test_what_leads_away_is_refused_with_how_far(frame, lines):
    followed = lines.follow(frame, Pose2(5.2, -1.75, 0.7))
    assert followed.reason.startswith("the lines lead 0.")
    assert followed.reason.endswith("degrees away")


def test_too_few_lines_are_not_followed(frame, lines):
    few = lines.finder.find(frame).take(np.arange(5))
    assert lines.follow(few, TRUTH).reason == "too little of the field's lines in view (5 line points)"


def test_the_field_is_searched_now_and_then(frame, monkeypatch):
    searches = []
    search = LinePoseEstimator.locate
    monkeypatch.setattr(
        LinePoseEstimator, "locate", lambda self, *given: searches.append(given) or search(self, *given)
    )
    vision = Vision(FIELD, CAMERA)
    searches.clear()  # it has looked at an empty picture
    for step in range(4):
        assert vision.look(frame, 0.1 * step, prior=TRUTH).pose.pose.error_to(TRUTH)[0] < 0.05
    assert len(searches) == 1
    vision.look(frame, 1.1, prior=TRUTH)
    assert len(searches) == 2
    # without a time nobody knows how long ago that was
    vision.look(frame, prior=TRUTH)
    assert len(searches) == 3
    # a pose that the frame contradicts is not followed, and every frame is searched
    for step in range(2):
        view = vision.look(frame, 2.2 + 0.1 * step, prior=Pose2(4.5, -1.0, 0.7))
        assert min(pose.error_to(TRUTH)[0] for pose in view.pose.candidates) < 0.05
    assert len(searches) == 5


MAP = LineMap(load_field("msl_6x4"))
coordinates = st.tuples(st.floats(-5, 5), st.floats(-4, 4))


@given(coordinates)
def test_stepping_back_along_the_normal_reaches_the_line(point):
    near = MAP.nearest(point)
    foot = np.array(point) - near.distance_m[:, None] * near.normal
    assert MAP.nearest(foot).distance_m[0] < 1e-8
    np.testing.assert_allclose(np.linalg.norm(near.normal), 1.0)


@pytest.mark.parametrize("name", ["msl_6x4", "msl_18x12", "spl_2020", "ssl_2001"])
def test_built_in_fields_are_point_symmetric(name):
    assert LineMap(load_field(name)).is_point_symmetric


def test_a_field_with_one_goal_area_is_not():
    field = load_field("ssl_2001")
    lopsided = dataclasses.replace(field, lines=np.vstack([field.lines, [1.0, -0.3, 1.0, 0.3]]))
    assert not LineMap(lopsided).is_point_symmetric


def test_robots_may_stand_wherever_the_floor_surely_reaches():
    np.testing.assert_allclose(MAP.extent_m, [[-3.3, -2.3], [3.3, 2.3]])
