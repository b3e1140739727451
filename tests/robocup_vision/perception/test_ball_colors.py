"""How much a frame looks like a ball's floor: carpet near the robot, greener than grey and than white."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.perception.balls.colored import MAX_FLOOR, floor_evidence, green_evidence
from robocup_vision.perception.color_table import Colors
from robocup_vision.perception.floor_color import LEVELS, FloorColor, PaintColor

ORANGE = PaintColor(2.0, 0.3)
ratios = st.floats(0.05, 5.0)
nats = st.floats(-4.0, 4.0)


def colors(red, blue, white=(1.0, 1.0)):
    floor = FloorColor(100.0, 1.0, np.full(len(LEVELS), red), np.full(len(LEVELS), blue), np.array([0.05, 0.05]))
    return Colors(floor, PaintColor(*white), ORANGE, ORANGE, ORANGE)


def evidence(frame_colors, near_floor_nats):
    return floor_evidence(near_floor_nats, green_evidence(frame_colors))


@given(ratios, ratios, ratios, ratios, nats)
def test_no_frame_looks_more_like_a_field_than_green_carpet_all_around(red, blue, white_red, white_blue, near):
    assert evidence(colors(red, blue, (white_red, white_blue)), near) <= MAX_FLOOR


@given(ratios, ratios, nats, nats, st.floats(1.0, 3.0))
def test_less_carpet_and_less_green_are_never_better(red, blue, near, other, factor):
    here = evidence(colors(red, blue), max(near, other))
    assert evidence(colors(red, blue), min(near, other)) <= here
    assert evidence(colors(factor * red, blue), max(near, other)) <= here
    assert evidence(colors(red, factor * blue), max(near, other)) <= here


def test_carpet_of_the_usual_green_is_believed():
    assert evidence(colors(0.6, 0.75), 3.9) == pytest.approx(MAX_FLOOR, abs=0.01)


def test_greyish_carpet_under_warm_light_is_doubted_a_little():
    assert -0.5 < evidence(colors(0.92, 0.96, (1.4, 1.05)), 3.9) < MAX_FLOOR


@pytest.mark.parametrize(("red", "blue"), [(1.15, 0.65), (1.0, 1.2)])
def test_skin_wood_and_blue_cloth_are_no_carpet(red, blue):
    assert evidence(colors(red, blue), 3.9) < -8.0


def test_a_floor_as_green_as_the_white_beside_it_is_doubted():
    # all is green under such a light
    assert evidence(colors(0.7, 0.6, (0.7, 0.6)), 3.9) < 0.0


def test_ground_that_is_mostly_no_carpet_shows_no_ball_s_floor():
    assert evidence(colors(0.6, 0.75), -0.5) < -8.0
