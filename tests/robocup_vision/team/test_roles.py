"""Roles: one robot fetches the ball and goes on while it is about as near; without messages each decides alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.geometry import Pose2
from robocup_vision.team.message import TeamMessage
from robocup_vision.team.roles import STALE_S, RoleChooser, time_to_ball_s

BALL = (0.0, 0.0)
PLACES = st.tuples(st.floats(-3.0, 3.0), st.floats(-2.0, 2.0))


def message(number, place, t_s=0.0, role="support", time_s=None):
    time_s = math.dist(place, BALL) if time_s is None else time_s
    return TeamMessage(number, t_s, role, time_s, Pose2(*place, 0.0), np.eye(3))


def choose(chooser, place, t_s=0.0, ball=BALL):
    return chooser.choose(t_s, place, ball, math.inf if ball is None else math.dist(place, ball))


@settings(max_examples=100)
@given(st.lists(PLACES, min_size=2, max_size=6))
def test_those_that_hear_each_other_have_one_that_fetches_and_places_of_their_own(places):
    team = [RoleChooser(number, False, 1.0) for number in range(len(places))]
    for chooser in team:
        for number, place in enumerate(places):
            chooser.update(message(number, place))
    chosen = [choose(chooser, place) for chooser, place in zip(team, places, strict=True)]
    fetching = [number for number, one in enumerate(chosen) if one.role == "fetch"]
    assert fetching == [min(range(len(places)), key=lambda n: (math.dist(places[n], BALL), n))]
    assert all(one.is_agreed for one in chosen)
    # next time all know who fetches; the others have a place each
    for chooser in team:
        for number, place in enumerate(places):
            chooser.update(message(number, place, 0.5, chosen[number].role))
    again = [choose(chooser, place, 0.5) for chooser, place in zip(team, places, strict=True)]
    assert [one.role for one in again] == [one.role for one in chosen]
    beside = sorted(one.place for one in again if one.role == "support")
    assert beside == list(range(len(places) - 1))
    assert {one.places for one in again if one.role == "support"} <= {len(places) - 1}


def test_who_fetches_goes_on_until_another_is_sooner_by_the_margin():
    chooser = RoleChooser(1, False, 1.0)
    chooser.update(message(2, (2.0, 0.0)))
    assert choose(chooser, (1.0, 0.0)).role == "fetch"
    chooser.update(message(2, (0.6, 0.0), 0.5))
    assert choose(chooser, (1.0, 0.0), 0.5).role == "fetch"
    chooser.update(message(2, (0.4, 0.0), 1.0))
    assert choose(chooser, (1.0, 0.0), 1.0).role == "support"
    # and back: now the other one has the margin
    chooser.update(message(2, (1.2, 0.0), 1.5, role="fetch"))
    assert choose(chooser, (1.0, 0.0), 1.5).role == "support"
    chooser.update(message(2, (1.6, 0.0), 2.0, role="fetch"))
    assert choose(chooser, (1.0, 0.0), 2.0).role == "fetch"


def test_without_messages_each_decides_alone():
    chooser = RoleChooser(1, False, 1.0)
    alone = choose(chooser, (1.0, 0.0))
    assert (alone.role, alone.is_agreed) == ("fetch", False)
    chooser.update(message(2, (0.2, 0.0), 1.0))
    assert choose(chooser, (1.0, 0.0), 1.5).role == "support"
    # the other one has fallen silent
    late = choose(chooser, (1.0, 0.0), 1.1 + STALE_S)
    assert (late.role, late.is_agreed) == ("fetch", False)


def test_a_keeper_keeps_and_is_not_counted_among_the_others():
    assert choose(RoleChooser(0, True, 1.0), (0.1, 0.0)).role == "keep"
    chooser = RoleChooser(1, False, 1.0)
    chooser.update(message(0, (0.1, 0.0), role="keep"))
    assert choose(chooser, (1.0, 0.0)).role == "fetch"
    assert not choose(chooser, (1.0, 0.0)).is_agreed


def test_a_claim_that_no_robot_can_keep_is_not_believed():
    chooser = RoleChooser(1, False, 1.0)
    chooser.update(message(2, (3.0, 0.0), time_s=0.0))
    assert choose(chooser, (1.0, 0.0)).role == "fetch"


def test_one_that_does_not_know_the_ball_searches_and_claims_nothing():
    chooser = RoleChooser(1, False, 1.0)
    assert choose(chooser, (1.0, 0.0), ball=None).role == "search"
    chooser.update(message(2, (0.1, 0.0), time_s=math.inf))
    assert choose(chooser, (1.0, 0.0)).role == "fetch"
    # nor does one that does not know where it is
    chooser.update(TeamMessage(3, 0.0, "support", 0.0))
    assert choose(chooser, (1.0, 0.0)).role == "fetch"


def test_its_own_and_older_messages_change_nothing():
    chooser = RoleChooser(1, False, 1.0)
    chooser.update(message(1, (0.0, 0.0), 1.0))
    chooser.update(message(2, (3.0, 0.0), 1.0))
    chooser.update(message(2, (0.1, 0.0), 0.5))
    assert choose(chooser, (1.0, 0.0), 1.0).role == "fetch"


def test_the_time_to_a_ball_is_that_of_the_way_and_half_the_turn():
    assert time_to_ball_s(Pose2(0.0, 0.0, 0.0), (2.0, 0.0), 0.5, 6.0) == pytest.approx(4.0)
    assert time_to_ball_s(Pose2(0.0, 0.0, math.pi / 2), (2.0, 0.0), 0.5, math.pi) == pytest.approx(4.25)
