"""Evidence of swapped red and blue over frames: one thing decides nothing, balls in several places do."""

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.pipeline.channel_order import ChannelOrder, ChannelOrderSettings

SURE = 15.0
HERE = PoseEstimate(Pose2(0.0, 0.0, 0.0), 1e-4 * np.eye(3), 1.0, 0.0)


def ball(x_m, y_m, nats=SURE):
    return Ball(x_m, y_m, 1e-4 * np.eye(2), 0.0, 0.0, nats)


def judge(order, own=(), swapped=(), pose=HERE, goals=0.0):
    order.judge(lambda: own, lambda: swapped, pose, lambda: goals)


@pytest.fixture
def order():
    return ChannelOrder(load_field("four_legged_2007"))


PLACES = [(0.5, 0.0), (-0.9, 0.9), (1.5, -1.3), (0.2, 1.4)]


def test_blue_balls_in_several_places_are_told(order):
    sums = []
    for place in PLACES:
        judge(order, swapped=[ball(*place)])
        sums.append(order.nats)
    assert sums == sorted(sums)
    assert not sums[0] >= order.settings.report_nats
    assert "ball looks as with red and blue swapped" in order.reason
    order.forget()
    assert order.nats == 0.0
    assert not order.reason


def test_a_blue_thing_that_stays_decides_nothing_but_raises_a_suspicion(order):
    for frame in range(200):
        judge(order, swapped=[ball(0.5 + 0.001 * (frame % 7), 0.0)])
    assert order.nats == order.settings.max_nats
    assert order.is_suspected
    assert not order.reason


def test_half_a_turn_makes_no_other_place(order):
    judge(order, swapped=[ball(0.5, 0.3)])
    judge(order, swapped=[ball(-0.5, -0.3)])
    assert order.nats == order.settings.max_nats


def test_orange_balls_outweigh_blue_ones(order):
    for place in PLACES:
        judge(order, own=[ball(*place)], swapped=[ball(place[1], place[0])])
    assert order.nats < 0
    assert not order.reason


@pytest.mark.parametrize(
    ("found", "why"),
    [
        (ball(2.9, 1.5), "before the field's end, but the way to it passes no coloured thing"),
        (ball(0.5, 0.0, ChannelOrderSettings().clutter_nats), "as likely as clutter"),
        (ball(4.0, 0.0), "beside the field"),
        (ball(2.6, 0.2), "at a goal that is cyan"),
        (ball(1.3, 1.9), "at a beacon with cyan"),
    ],
)
def test_what_tells_nothing_of_the_order(order, found, why):
    judge(order, swapped=[found])
    assert (order.nats == 0.0) == (not why.startswith("before"))


def test_without_a_pose_balls_tell_nothing(order):
    judge(order, swapped=[ball(0.5, 0.0)], pose=NotLocated("too dark"))
    assert order.nats == 0.0


def test_goals_that_fit_swapped_colors_decide_nothing_in_their_frame(order):
    judge(order, goals=math.log(4.0))
    assert "goals look as with red and blue swapped" in order.reason
    judge(order, goals=-math.log(4.0))
    assert not order.reason


def test_later_frames_are_looked_at_now_and_then(order):
    asked = []
    for frame in range(64):
        order.judge(tuple, lambda frame=frame: asked.append(frame) or (), HERE, lambda: 0.0)
    assert asked[:8] == list(range(8))
    assert 0 < len(asked[8:]) <= 4
