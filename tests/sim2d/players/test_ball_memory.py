"""What a player remembers of the ball, and what hides it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robocup_vision.belief import Track
from robocup_vision.perception.free_space import FreeSpace
from sim2d.players.ball import BallMemory, HiddenBall, block_ball, is_in_sight

BEARING = (np.arange(64) + 0.5) * math.tau / 64
OPEN = FreeSpace(BEARING, np.full(64, 1.0))


def test_a_rolling_ball_has_a_velocity_and_an_unseen_one_is_forgotten():
    memory = BallMemory()
    assert memory.place(0.0) is None
    for k in range(20):
        memory.update((0.03 * k, 0.0), k / 30)
    assert memory.velocity_mps == (pytest.approx(0.9, abs=0.01), 0.0)
    assert memory.place(1.0) == (pytest.approx(0.57), 0.0)
    assert memory.age_s(1.0) == pytest.approx(1.0 - 19 / 30)
    assert memory.place(9.0) is None
    # seen elsewhere later, it has not rolled there
    memory.update((-1.0, 0.0), 2.0)
    assert memory.velocity_mps == (0.0, 0.0)
    memory.miss()
    assert memory.place(2.0) is None


def test_a_ball_that_jumps_did_not_roll():
    memory = BallMemory()
    memory.update((0.0, 0.0), 0.0)
    memory.update((1.0, 0.0), 1 / 30)
    assert memory.velocity_mps == (0.0, 0.0)


def test_a_ball_blocks_its_own_directions_only():
    blocked = block_ball(OPEN, (0.5, 0.0), 0.02).range_m
    assert blocked[0] == blocked[-1] == pytest.approx(0.48)
    assert np.all(blocked[2:-2] == 1.0)
    assert block_ball(OPEN, (0.01, 0.0), 0.02) is OPEN


def test_a_place_is_in_sight_where_the_floor_is_free_up_to_it():
    assert is_in_sight(OPEN, (0.6, 0.3))
    assert not is_in_sight(OPEN, (1.2, 0.3))
    ahead = FreeSpace(np.linspace(-0.3, 0.3, 9), np.full(9, 2.0))
    assert not is_in_sight(ahead, (-1.0, 0.0))


def track(number, x_m, y_m, vx_mps=0.0):
    return Track(number, x_m, y_m, vx_mps, 0.0, np.eye(4) * 1e-4, 0.99, 10, 0)


def test_a_ball_goes_out_of_sight_behind_who_had_it():
    hidden = HiddenBall(0.11)
    assert hidden.place((0.0, 0.0), [track(4, 0.5, 0.0)], 0.0) is None
    hidden.update((0.52, 0.1), [track(4, 0.5, 0.0), track(7, 0.9, 0.9)], 0.0)
    later = [track(4, 0.5, 0.5, vx_mps=0.2), track(7, 0.9, 0.9)]
    place, velocity = hidden.place((0.0, 0.0), later, 0.5)
    there = math.hypot(0.6, 0.5)
    assert place == (pytest.approx(0.6 * (1 + 0.11 / there)), pytest.approx(0.5 * (1 + 0.11 / there)))
    assert velocity == (0.2, 0.0)
    # who is no longer followed hides nothing
    assert hidden.place((0.0, 0.0), later[1:], 0.0) is None
    hidden.update((0.0, 0.5), later, 0.0)
    assert hidden.place((0.0, 0.0), later, 0.0) is None
