"""Tests of how a ball with patches turns as it rolls."""

import math

import pytest

from sim2d.sensors.match_camera import RollingBall
from sim2d.world.state import BallState

RADIUS_M = 0.05


def roll(*places):
    """Return the turn of a ball that has been at these places."""
    ball = RollingBall(RADIUS_M)
    turns = [ball.turn_rad(BallState(x_m, y_m, 0.0, 0.0)) for x_m, y_m in places]
    return turns[-1]


def test_a_ball_that_lies_still_does_not_turn():
    assert roll((0.3, 0.4), (0.3, 0.4)) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("way_m", [0.02, -0.05])
def test_it_turns_by_the_way_over_its_radius(way_m):
    # ahead about y, to the left about -x
    assert roll((0.0, 0.0), (way_m, 0.0)) == pytest.approx((0.0, way_m / RADIUS_M, 0.0))
    assert roll((0.0, 0.0), (0.0, way_m)) == pytest.approx((-way_m / RADIUS_M, 0.0, 0.0))


def test_after_a_whole_turn_it_looks_as_before():
    around_m = math.tau * RADIUS_M
    places = [(around_m * k / 50 * 0.6, around_m * k / 50 * 0.8) for k in range(51)]
    assert roll(*places) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
