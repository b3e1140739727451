"""Zones that the rules forbid: what is in them is let out, what is outside stays there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace
from sim2d.players.keep_out import Area, Capsule, allowed_target, block_zones, ranges_to_segments

PLACES = st.tuples(st.floats(-4, 4), st.floats(-3, 3))
ZONES = st.one_of(
    st.builds(Capsule, PLACES, PLACES, st.floats(0.05, 1.0)),
    st.builds(
        lambda low, size: Area(low, (low[0] + size[0], low[1] + size[1])),
        PLACES,
        st.tuples(st.floats(0.1, 2), st.floats(0.1, 2)),
    ),
)


@given(zone=ZONES, place=PLACES, clearance_m=st.floats(0.0, 0.3))
def test_what_is_moved_out_has_its_room_and_what_has_it_stays(zone, place, clearance_m):
    moved = zone.moved_out(place, clearance_m)
    assert zone.signed_distance_m(moved) >= clearance_m - 1e-9
    if zone.signed_distance_m(place) >= clearance_m:
        assert moved == place


@given(zone=ZONES, here=PLACES, target=PLACES)
def test_a_robot_outside_is_never_sent_into_a_zone(zone, here, target):
    assume(zone.signed_distance_m(here) >= 0.09)
    assert zone.signed_distance_m(allowed_target(target, here, (zone,), 0.09)) >= 0.09 - 1e-9


def test_a_robot_inside_is_sent_straight_out():
    zone = Capsule((0.0, 0.0), (0.0, 0.0), 0.5)
    x, y = allowed_target((-3.0, 0.0), (0.3, 0.0), (zone,), 0.09)
    assert x > 0.59
    assert y == 0.0


def test_zones_block_the_free_space_of_who_is_outside_and_not_of_who_is_inside():
    bearing = np.linspace(-math.pi, math.pi, 73)[:-1]
    free = FreeSpace(bearing, np.full(72, 9.0))
    zone = Capsule((1.0, 0.0), (1.0, 0.0), 0.5)
    blocked = block_zones(free, Pose2(0.0, 0.0, 0.0), (zone,), 0.09)
    ahead = int(np.argmin(np.abs(bearing)))
    assert blocked.range_m[ahead] == pytest.approx(0.5, abs=0.01)
    assert blocked.range_m[0] == 9.0
    assert (block_zones(free, Pose2(0.8, 0.0, 0.0), (zone,), 0.09).range_m == 9.0).all()


def test_rays_meet_a_square_where_they_should():
    square = np.array([[1.0, -1.0], [3.0, -1.0], [3.0, 1.0], [1.0, 1.0]])
    found = ranges_to_segments(np.array([0.0, math.pi / 4 - 0.01, math.pi]), square)
    assert found[0] == pytest.approx(1.0)
    assert found[1] == pytest.approx(1.0 / math.cos(math.pi / 4 - 0.01))
    assert found[2] == math.inf
