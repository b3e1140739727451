"""One verdict on a mirror camera's pose: what agrees raises its odds, and what contradicts lowers them."""

import math
from pathlib import Path

import numpy as np
import pytest
from wrong_files import problem_of

from robocup_vision import Vision
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor.free_floor import FLOOR, LINE
from robocup_vision.localization import evidence as module
from robocup_vision.localization.evidence import (
    Likelihoods,
    LineEvidence,
    OutlineEvidence,
    load_evidence,
    odds_text,
)
from robocup_vision.localization.line_map import LineMap
from robocup_vision.perception.polar_view import PolarView

PACKAGED = Path(module.__file__).with_name("evidence.toml")


@pytest.fixture(scope="module")
def weigh(paper_camera):
    view = PolarView(paper_camera)
    outline = OutlineEvidence(view, 1.0, load_evidence().outline)
    foot = np.full(view.bearings, 80.0)
    at_foot = int(np.searchsorted(view.radius_px, 80.0))

    def weigh(agree, hidden=0, beyond=0, bare=0):
        """Weigh an outline of so many bearings that agree, are hidden, show floor beyond the wall, or no floor."""
        residual, column = np.zeros(view.bearings), np.full(view.bearings, at_foot)
        order = np.random.default_rng(0).permutation(view.bearings)
        assert agree + hidden + beyond + bare == view.bearings
        residual[order[agree : agree + hidden]] = -20.0
        residual[order[agree + hidden : agree + hidden + beyond]] = 10.0
        column[order[view.bearings - bare :]] = -1
        return outline.weigh_walls(residual, foot, column)

    return weigh


def test_an_outline_raises_or_lowers_the_odds_by_what_it_shows(weigh):
    all_agree = weigh(160)
    assert all_agree.counts.tolist() == [160, 0, 0, 0, 0, 0]
    assert all_agree.log_odds > load_evidence().sure_log_odds
    # a hidden half says little, floor beyond the walls and missing floor much
    assert weigh(80, hidden=80).log_odds > load_evidence().min_log_odds
    assert weigh(80, beyond=80).log_odds < -1.0
    assert weigh(80, bare=80).log_odds < weigh(80, hidden=80).log_odds
    assert weigh(0, hidden=160).log_odds < 0.0


def test_bearings_under_a_mask_say_nothing(paper_camera):
    width, height = paper_camera.size_px
    mask = np.zeros((height, width), dtype=np.uint8)
    mask[:, : width // 2] = 255
    view = PolarView(paper_camera, mask=mask)
    outline = OutlineEvidence(view, 1.0, load_evidence().outline)
    nothing = np.full(view.bearings, -1)
    tally = outline.weigh_walls(np.zeros(view.bearings), np.full(view.bearings, 80.0), nothing)
    assert tally.counts.sum() == pytest.approx(view.bearings / 2, abs=4)


def test_a_refusal_names_what_was_missing(weigh):
    tally = weigh(12, hidden=120, beyond=28)
    assert tally.reason(math.log(1 / 30)) == "12 of 40 visible bearings agree with walls, odds 1:30"


@pytest.mark.parametrize(
    ("log_odds", "text"), [(math.log(3.0), "3:1"), (-math.log(30.0), "1:30"), (-50.0, "below 1:1000")]
)
def test_odds_are_written_as_a_ratio(log_odds, text):
    assert odds_text(log_odds) == text


def test_lines_where_the_pose_has_them_favour_it(ssl_field, paper_camera, nominal_samples):
    vision = Vision(ssl_field, paper_camera)
    lines = LineEvidence(LineMap(ssl_field), vision.polar, load_evidence().lines)
    seen = [vision.look(one.frame) for one in nominal_samples[:4]]
    views = [view for view in seen if view.pose and np.count_nonzero(view.marks == LINE) > 50]
    assert views
    for view in views:
        pose = view.pose.pose
        assert lines.log_odds(pose, view.marks) > lines.log_odds(pose.compose(Pose2(0.15, 0.2, 0.5)), view.marks)
        assert lines.log_odds(pose, np.full_like(view.marks, FLOOR)) < 0.0
        assert lines.log_odds(pose, np.zeros_like(view.marks)) == pytest.approx(0.0)


def test_the_likeliest_condition_of_each_side_counts():
    likelihoods = Likelihoods.of(np.array([[0.9, 0.1], [0.5, 0.5]]), np.array([[0.1, 0.9], [0.2, 0.8]]), 2.0)
    assert likelihoods.log_odds(np.array([10, 0])) == pytest.approx(5.0 * math.log(0.9 / 0.2))
    assert likelihoods.log_odds(np.array([0, 10])) == pytest.approx(5.0 * math.log(0.5 / 0.9))


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("format = 1", "format = 2", "format"),
        ("min_log_odds = ", "min_log_odds = -", "min_log_odds"),
        ("correlation = ", "correlation = 0.5  # ", "outline.correlation"),
        ('"agrees"', '"disagrees"', "outline.states"),
        ("right = [[", "right = [[2", "outline.right"),
        ("wrong = [[", "wrong = [[0.5, 0.5], [", "outline.wrong"),
    ],
)
def test_a_wrong_file_is_refused_by_its_key(tmp_path, old, new, key):
    text = PACKAGED.read_text(encoding="utf-8")
    assert problem_of(load_evidence, tmp_path / "evidence.toml", text, old, new).startswith(f"key '{key}")
