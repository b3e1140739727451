"""Which half of the field a mirror's frame shows, by the goals' colours, under any light."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import numbers

from field_models import load_field
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.field_half import GoalSide
from robocup_vision.localization.swapped_channels import swapped_nats
from robocup_vision.perception.color_table import colors_for
from robocup_vision.perception.floor_color import LEVELS, FloorColor, PaintColor
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.scene import Scene

TRUTH = Pose2(0.7, 0.1, 0.4)
FLOOR = FloorColor(90.0, 1.0, np.full(len(LEVELS), 0.35), np.full(len(LEVELS), 0.38), np.array([0.05, 0.05]))


def both(pose):
    return PoseEstimate(pose, np.diag([1e-4, 1e-4, 1e-4]), 0.9, 0.3, (pose, pose.half_turn()))


@pytest.fixture(scope="module")
def frame(ssl_field, paper_camera):
    return np.clip(MirrorRenderer(paper_camera, 2).render(Scene(ssl_field), TRUTH), 0, 255).astype(np.uint8)


def colors(field, white=PaintColor(1.0, 1.0)):
    return colors_for(field, FLOOR, white)


@pytest.mark.parametrize("guess", [TRUTH, TRUTH.half_turn()])
def test_the_goals_decide_whatever_was_first(ssl_field, paper_camera, frame, guess):
    side = GoalSide(ssl_field, paper_camera)
    for prior in (None, TRUTH.half_turn()):
        chosen = side.choose(frame, both(guess), colors(ssl_field), prior)
        assert sum(chosen.pose.error_to(TRUTH)) < 1e-9
        assert chosen.candidates == (chosen.pose,)
        assert (chosen.inlier_ratio, chosen.residual_px) == (0.9, 0.3)


@pytest.mark.parametrize("cast", [(0.8, 0.95, 1.25), (1.25, 0.95, 0.8), (0.5, 0.5, 0.5)])
def test_the_goals_decide_under_any_light(ssl_field, paper_camera, frame, cast):
    lit = np.clip(frame * np.array(cast), 0, 255).astype(np.uint8)
    white = PaintColor(cast[2] / cast[1], cast[0] / cast[1])
    chosen = GoalSide(ssl_field, paper_camera).choose(lit, both(TRUTH.half_turn()), colors(ssl_field, white))
    assert sum(chosen.pose.error_to(TRUTH)) < 1e-9


def test_hidden_goals_leave_both(ssl_field, paper_camera, frame):
    everything = np.full((220, 256), 255, dtype=np.uint8)
    side = GoalSide(ssl_field, paper_camera, everything)
    left = side.choose(frame, both(TRUTH), colors(ssl_field))
    assert left.candidates == (TRUTH, TRUTH.half_turn())
    turned = side.choose(frame, both(TRUTH), colors(ssl_field), TRUTH.half_turn())
    assert turned.pose == TRUTH.half_turn()
    assert len(turned.candidates) == 2


def test_white_walls_in_place_of_goals_decide_nothing(ssl_field, paper_camera):
    white = np.full((220, 256, 3), 220, dtype=np.uint8)
    assert len(GoalSide(ssl_field, paper_camera).choose(white, both(TRUTH), colors(ssl_field)).candidates) == 2


def test_who_is_able(ssl_field, paper_camera):
    assert GoalSide(ssl_field, paper_camera).is_able
    flat = dataclasses.replace(paper_camera, floor_range=dataclasses.replace(paper_camera.floor_range, A_px_per_m=1.0))
    assert flat.height_m is None
    assert not GoalSide(ssl_field, flat).is_able
    assert not GoalSide(load_field("ssl_division_b"), paper_camera).is_able  # both white
    assert not GoalSide(load_field("msl_6x4"), paper_camera).is_able  # no goals
    assert not GoalSide(load_field("spl_2020"), paper_camera).is_able  # posts


def test_colours_that_hardly_differ_decide_nothing(ssl_field, paper_camera, frame):
    alike = dataclasses.replace(
        colors(ssl_field), goal_positive_x=PaintColor(1.0, 0.9), goal_negative_x=PaintColor(1, 1)
    )
    assert len(GoalSide(ssl_field, paper_camera).choose(frame, both(TRUTH), alike).candidates) == 2


# log R/G and B/G of yellow, blue, both with red and blue swapped, and white
PALETTE = np.array([[0.09, -1.77], [-0.83, 0.86], [-1.77, 0.09], [0.86, -0.83], [0.0, 0.0]])


@given(
    st.integers(0, 2**32 - 1),
    numbers(-0.25, 0.25),
    numbers(-0.25, 0.25),
    st.booleans(),
    st.sampled_from([(1, 1), (1, 0)]),
)
def test_goals_under_a_light_that_white_tells_badly(seed, red, blue, half_turn, in_view):
    rng = np.random.default_rng(seed)
    is_positive = np.repeat([True, False], 24)[: 24 * sum(in_view)]
    for first in (0, 2):
        row = first + (is_positive == half_turn)
        points = PALETTE[row] + (red, blue) + rng.normal(0.0, 0.1, (len(row), 2))
        # a third is something grey before the goal
        points[::3] = rng.normal(0.0, 0.1, points[::3].shape)
        assert (swapped_nats(points, is_positive, PALETTE) > 0.0) == (first == 2)


@pytest.mark.parametrize("count", [0, 5])
def test_nothing_but_white_shows_no_swap(count):
    assert swapped_nats(np.zeros((count, 2)), np.ones(count, dtype=bool), PALETTE) <= 0.0
