"""Covering a goal: no straight shot into it passes, and nowhere farther from the ball would do."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.planning import cover_goal

POSTS = ((-1.37, 0.3), (-1.37, -0.3))
REACH_M = 0.1115

balls = st.tuples(st.floats(-1.2, 1.2), st.floats(-0.7, 0.7))


def passes_m(ball: tuple[float, float], place: tuple[float, float]) -> np.ndarray:
    """How near straight shots from the ball into the mouth pass to a place."""
    (x, top), (_, bottom) = POSTS
    aims = np.stack([np.full(101, x), np.linspace(bottom, top, 101)], axis=1) - ball
    off = np.array(place) - ball
    along = np.clip(aims @ off / np.sum(aims**2, axis=1), 0.0, None)
    return np.hypot(*(off - along[:, None] * aims).T)


@given(balls)
def test_no_shot_passes_where_there_is_room_enough(ball):
    cover = cover_goal(ball, POSTS, REACH_M, 0.0)
    assert passes_m(ball, cover.place_m).max() <= REACH_M + 1e-9
    assert math.dist(ball, cover.place_m) >= REACH_M - 1e-9
    # one step farther from the ball leaves a gap
    away = [b + 1.1 * (p - b) for b, p in zip(ball, cover.place_m, strict=True)]
    assert passes_m(ball, tuple(away)).max() > REACH_M


@given(balls, st.floats(0.0, 0.2))
def test_the_room_is_kept_and_both_sides_are_alike(ball, room_m):
    cover = cover_goal(ball, POSTS, REACH_M, room_m)
    assert math.dist(ball, cover.place_m) >= REACH_M + room_m - 1e-9
    assume(abs(ball[1]) > 1e-9)
    other = cover_goal((ball[0], -ball[1]), POSTS, REACH_M, room_m)
    assert other.place_m == pytest.approx((cover.place_m[0], -cover.place_m[1]))
    assert other.open_rad == pytest.approx(cover.open_rad)
    assert cover_goal(ball, POSTS[::-1], REACH_M, room_m).place_m == pytest.approx(cover.place_m)


@pytest.mark.parametrize(
    ("reach_m", "room_m", "text"),
    [
        (0.0, 0.0, "reach_m must be positive, got 0.0"),
        (math.nan, 0.0, "reach_m must be positive, got nan"),
        (0.1, -0.1, "room_m must not be negative, got -0.1"),
    ],
)
def test_refuses_bad_numbers(reach_m, room_m, text):
    with pytest.raises(ArgumentError, match=text):
        cover_goal((0.0, 0.0), POSTS, reach_m, room_m)
