"""What a page gets of a moment: every layer, the pose, the map, as plain JSON with a JPEG and a PNG."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from robocup_vision.estimates import EdgePoints, EdgeState, NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.live.handover.moment import RobotPlan, TrueRobot, TrueWorld
from robocup_vision.live.page.picture import PictureMaker, split_picture

EDGES = {"found", "hidden", "missing"}
LAYERS = {"edge", "lines", "free", "field", "goals", "obstacles", "ball", "truth", "markings"} | EDGES


def test_a_moment_becomes_json_and_jpeg(setup, moment, frames):
    robots = (TrueRobot("robot 0", 1, Pose2(0.1, 0.2, 0.3)), TrueRobot("robot 1", -1, Pose2(1.0, 0.0, 3.0)))
    plan = RobotPlan((0.1, -0.2, 0.3), ((1.0, 0.5),), ("why",))
    shown = replace(moment(1.25), plan=plan, rate_hz=30.0, world=TrueWorld(robots, (0.5, -0.5)))
    picture = PictureMaker(setup, 85).make(shown, 4)
    told, jpeg, png = split_picture(picture.data)
    assert (picture.robot, picture.number, picture.t_s, png) == ("robot", 1, 1.25, b"")
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == frames[0].shape
    assert np.abs(image.astype(int) - frames[0]).mean() < 12
    assert set(told["layers"]) == LAYERS
    assert told["layers"]["edge"]
    assert told["layers"]["free"]
    assert told["layers"]["field"]
    assert told["pose"]["pose"] == pytest.approx(shown.view.pose.pose.array, abs=1e-4)
    assert told["command"] == [0.1, -0.2, 0.3]
    assert (told["way"], told["reasons"], told["dropped"]) == ([[1.0, 0.5]], ["why"], 4)
    assert [name for name, _ in told["colors"]] == ["floor", "line", "ball", "goal_positive_x", "goal_negative_x"]
    assert "total" in told["timings_ms"]
    assert told["world"]["robots"] == [["robot 0", 1, 0.1, 0.2, 0.3], ["robot 1", -1, 1.0, 0.0, 3.0]]
    assert told["world"]["ball"] == [0.5, -0.5]
    assert told["size_px"] == [frames[0].shape[1], frames[0].shape[0]]


def test_layers_lie_in_the_image(setup, moment):
    told, _, _ = split_picture(PictureMaker(setup, 85).make(moment(), 0).data)
    width, height = told["size_px"]
    for path in (told["layers"]["edge"], *told["layers"]["field"]):
        points = np.reshape(path, (-1, 2))
        assert np.isfinite(points).all()
        assert (points > -0.1 * width).all()
        assert (points < [1.1 * width, 1.1 * height]).all()


def test_markings_are_found_where_they_are_wanted(setup, moment):
    maker, shown = PictureMaker(setup, 85), moment()
    assert split_picture(maker.make(shown, 0).data)[0]["layers"]["markings"] == []
    told = split_picture(maker.make(shown, 0, with_markings=True).data)[0]
    found = [np.reshape(path, (-1, 2)) for path in told["layers"]["markings"]]
    assert len(found) >= len(shown.view.markings.segments) > 0
    for path in found:
        assert (path > -0.1 * told["size_px"][0]).all()


def test_a_belief_brings_hypotheses_ellipse_and_map(setup, remembered):
    told, _, png = split_picture(PictureMaker(setup, 85).make(remembered, 0).data)
    assert told["from_memory"]
    assert sum(item[3] for item in told["hypotheses"]) == pytest.approx(1.0, abs=0.05)
    long, short, _ = told["pose"]["ellipse"]
    assert long >= short > 0
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert image.shape == (*remembered.view.belief.free_map.state.shape, 4)
    assert told["map"]["size_m"][0] > 1.0
    assert told["truth"] == [0.1, 0.2, 0.3]


def test_a_frame_that_was_not_located_says_why(setup, moment):
    lost = moment()
    lost = replace(lost, view=replace(lost.view, pose=NotLocated("too dark")))
    told, _, _ = split_picture(PictureMaker(setup, 85).make(lost, 0).data)
    assert told["pose"] == {"located": False, "reason": "too dark"}
    assert told["layers"]["field"] == []
    assert told["layers"]["edge"]


def test_a_frame_that_nobody_looked_at_is_shown_all_the_same(setup, moment):
    told, jpeg, _ = split_picture(
        PictureMaker(setup, 85).make(replace(moment(), view=None, problem="too small"), 0).data
    )
    assert told["problem"] == "too small"
    assert "layers" not in told
    assert jpeg.startswith(b"\xff\xd8")


def test_edges_are_told_by_what_the_frame_shows_there(setup, moment):
    pixels = np.array([[10.0, 20.0], [30.5, 40.5], [50.0, 60.0], [70.0, 80.0], [90.0, 100.0]])
    states = [EdgeState.FOUND, EdgeState.HIDDEN, EdgeState.MISSING, EdgeState.UNSEEN, EdgeState.FOUND]
    shown = moment()
    shown = replace(shown, view=replace(shown.view, edge_points=EdgePoints(pixels, np.array(states))))
    layers = split_picture(PictureMaker(setup, 85).make(shown, 0).data)[0]["layers"]
    assert layers["found"] == [10.0, 20.0, 90.0, 100.0]
    assert layers["hidden"] == [30.5, 40.5]
    assert layers["missing"] == [50.0, 60.0]


def test_the_error_of_a_frame_is_that_of_the_nearest_candidate(setup, moment):
    plain = moment()
    pose, covariance = Pose2(1.0, 0.5, 0.3), np.eye(3) * 1e-4
    both = PoseEstimate(pose, covariance, 1.0, 0.2, (pose, pose.half_turn()))
    maker = PictureMaker(setup, 85)

    def error(estimate, truth):
        shown = replace(plain, view=replace(plain.view, pose=estimate), truth=truth)
        return split_picture(maker.make(shown, 0).data)[0]["error"]

    truth = Pose2(-1.0, -0.53, 0.4 - math.pi)
    assert error(both, truth) == pytest.approx([0.03, 0.1], abs=1e-4)
    # who is sure of the wrong half is wrong
    sure = PoseEstimate(pose, covariance, 1.0, 0.2)
    assert error(sure, truth)[0] == pytest.approx(math.hypot(2.0, 1.03), abs=1e-4)
    assert error(both, None) is None
    assert error(NotLocated("too dark"), truth) is None


def test_an_improbable_hypothesis_makes_no_error_smaller(setup, remembered):
    view, maker = remembered.view, PictureMaker(setup, 85)
    first = view.belief.hypotheses[0]
    truth = Pose2(first.pose.x_m - 0.5, first.pose.y_m, first.pose.theta_rad)
    for probability, error_m in ((0.3, 0.5), (0.5, 0.0)):
        likely = replace(first, probability=1.0 - probability)
        hypotheses = (likely, replace(first, pose=truth, probability=probability))
        shown = replace(remembered, view=replace(view, belief=replace(view.belief, hypotheses=hypotheses)), truth=truth)
        told = split_picture(maker.make(shown, 0).data)[0]
        assert told["error"] == pytest.approx([error_m, 0.0], abs=0.01)


def test_the_truth_is_drawn_in_the_image_where_the_field_is_seen_from_there(setup, moment):
    shown = moment()
    told, _, _ = split_picture(PictureMaker(setup, 85).make(replace(shown, truth=shown.view.pose.pose), 0).data)
    assert told["layers"]["truth"] == told["layers"]["field"]
