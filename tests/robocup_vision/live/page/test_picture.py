"""What a page gets of a moment: every layer, the pose, the map, as plain JSON with a JPEG and a PNG."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from robocup_vision.estimates import NotLocated
from robocup_vision.live.handover.moment import RobotPlan
from robocup_vision.live.page.picture import PictureMaker, split_picture

LAYERS = {"edge", "lines", "free", "field", "goals", "obstacles", "ball"}


def test_a_moment_becomes_json_and_jpeg(setup, moment, frames):
    shown = replace(moment(1.25), plan=RobotPlan((0.1, -0.2, 0.3), ((1.0, 0.5),), ("why",)), rate_hz=30.0)
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
    assert told["size_px"] == [frames[0].shape[1], frames[0].shape[0]]


def test_layers_lie_in_the_image(setup, moment):
    told, _, _ = split_picture(PictureMaker(setup, 85).make(moment(), 0).data)
    width, height = told["size_px"]
    for path in (told["layers"]["edge"], *told["layers"]["field"]):
        points = np.reshape(path, (-1, 2))
        assert np.isfinite(points).all()
        assert (points > -0.1 * width).all()
        assert (points < [1.1 * width, 1.1 * height]).all()


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


def test_the_values_are_json_a_browser_reads(setup, remembered):
    picture = PictureMaker(setup, 85).make(remembered, 0)
    json_bytes = int.from_bytes(picture.data[:4], "little")

    def refuse(text):
        raise AssertionError(f"{text} is no JSON")

    assert json.loads(picture.data[12 : 12 + json_bytes], parse_constant=refuse)["type"] == "moment"
