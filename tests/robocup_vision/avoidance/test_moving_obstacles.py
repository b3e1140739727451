"""Moving obstacles: the floor seen past them, and what is commanded before them."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from robocup_vision.avoidance import Steering, SteeringSettings
from robocup_vision.avoidance.steering import moving_table, ranges_past
from robocup_vision.disc import Disc
from robocup_vision.motion_limits import MotionLimits

RADIUS = 0.09
LIMITS = MotionLimits(0.6, 1.2, 0.03)
BEARING = np.arange(128) * math.tau / 128 - math.pi


def open_floor(obstacles=(), reach=3.0):
    range_m = np.full(len(BEARING), reach)
    for o in obstacles:
        distance = math.hypot(o.x_m, o.y_m)
        off = np.abs(np.angle(np.exp(1j * (BEARING - math.atan2(o.y_m, o.x_m)))))
        hit = off < math.asin(o.radius_m / distance)
        range_m[hit] = distance - o.radius_m * np.cos(off[hit])
    return SimpleNamespace(bearing_rad=BEARING, range_m=range_m)


def steering():
    return Steering(RADIUS, LIMITS)


def test_the_table_adds_the_radii():
    doubt, of_velocity = np.diag([0.01, 0.004]) ** 2, np.diag([0.01, 0.02]) ** 2
    uncertain = Disc(1.0, 2.0, 0.1, doubt, vx_mps=0.3, vy_mps=0.4, velocity_covariance=of_velocity)
    table = moving_table([uncertain], 0.09)
    assert table.shape == (1, 8)
    np.testing.assert_allclose(table[0, :7], [1.0, 2.0, 0.3, 0.4, 0.19, 0.01, 0.02])
    assert moving_table([], 0.09).shape == (0, 8)


def test_past_an_obstacle_the_floor_is_as_free_as_beside_it_on_its_nearer_side():
    mover = Disc(1.0, 0.0, RADIUS, vy_mps=0.5)
    seen = open_floor([mover])
    seen.range_m[BEARING > 0] = np.minimum(seen.range_m[BEARING > 0], 2.0)
    past = ranges_past(BEARING, seen.range_m, [mover])
    assert past.min() == 2.0
    np.testing.assert_array_equal(past[np.abs(BEARING) > 0.2], seen.range_m[np.abs(BEARING) > 0.2])
    # what stands before or behind it stays
    for other in (0.5, 1.4):
        blocked = np.where(np.abs(BEARING) < 0.15, other, 3.0)
        np.testing.assert_array_equal(ranges_past(BEARING, blocked, [mover]), blocked)


def test_unseen_bearings_stay_unseen_and_an_obstacle_all_around_changes_nothing():
    mover = Disc(0.01, 0.0, RADIUS)
    near = np.full(len(BEARING), RADIUS)
    np.testing.assert_array_equal(ranges_past(BEARING, near, [mover]), near)
    mover = Disc(1.0, 0.0, RADIUS)
    unseen = np.where(BEARING > 1.0, np.nan, open_floor([mover]).range_m)
    np.testing.assert_array_equal(np.isnan(ranges_past(BEARING, unseen, [mover])), BEARING > 1.0)


def test_the_papers_variant_takes_what_moves_for_standing():
    leaving = Disc(0.3, 0.12, RADIUS, vy_mps=1.0)
    plain = Steering(RADIUS, LIMITS, SteeringSettings(use_velocity=False))
    told = plain.steer(open_floor([leaving]), (0.4, 0.0), 0.0, moving=[leaving])
    untold = Steering(RADIUS, LIMITS, SteeringSettings(use_velocity=False)).steer(
        open_floor([leaving]), (0.4, 0.0), 0.0
    )
    np.testing.assert_array_equal(told.velocity_mps, untold.velocity_mps)
    np.testing.assert_array_equal(told.time_to_contact_s, untold.time_to_contact_s)


def test_one_that_clears_the_way_in_time_is_no_obstacle_and_one_that_will_block_it_is():
    leaving = Disc(0.3, 0.12, RADIUS, vy_mps=1.0)
    assert steering().steer(open_floor([leaving]), (0.4, 0.0), 0.0).reason == "around obstacle"
    command = steering().steer(open_floor([leaving]), (0.4, 0.0), 0.0, moving=[leaving])
    assert command.reason == "towards target"
    # it will be ahead before the robot could stop
    coming = Disc(0.35, 0.5, RADIUS, vy_mps=-1.0)
    assert steering().steer(open_floor([coming]), (0.6, 0.0), 0.0).reason == "towards target"
    command = steering().steer(open_floor([coming]), (0.6, 0.0), 0.0, moving=[coming])
    assert command.reason != "towards target"


def test_a_robot_that_stands_gives_way_to_nothing_it_cannot_escape():
    walls = SimpleNamespace(bearing_rad=BEARING, range_m=np.full(len(BEARING), 0.12))
    coming = Disc(0.5, 0.0, RADIUS, vx_mps=-1.0)
    command = steering().steer(walls, (0.0, 0.0), 0.0, moving=[coming])
    assert not command.safe
    np.testing.assert_array_equal(command.velocity_mps, 0.0)


@pytest.mark.parametrize("speed", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("offset_s", [-0.4, -0.2, 0.0, 0.2, 0.4])
def test_the_robot_never_drives_into_one_that_crosses_steadily(speed, offset_s):
    """Exact knowledge, exact obedience: a moving robot of ours never closes the last gap itself."""
    pilot, period = steering(), 1 / 30
    place, velocity, waiting = np.zeros(2), np.zeros(2), np.zeros(2)
    meet_s = 2.0 + offset_s
    for k in range(150):
        t = k * period
        other = np.array([0.8, speed * (t - meet_s)])
        mover = Disc(*(other - place), RADIUS, vy_mps=speed)
        goal = np.array([2.0, 0.0]) - place
        command = pilot.steer(
            open_floor([mover] if np.hypot(*(other - place)) > 2 * RADIUS else []), velocity,
            math.atan2(goal[1], goal[0]), float(np.hypot(*goal)), waiting, moving=[mover],
        )  # fmt: skip
        before = velocity
        change = np.array(waiting) - velocity
        velocity = velocity + change * min(1.0, 1.2 * period / max(float(np.hypot(*change)), 1e-9))
        waiting = command.velocity_mps
        place = place + period * (before + velocity) / 2
        away = np.array([0.8, speed * (t + period - meet_s)]) - place
        distance = float(np.hypot(*away))
        if distance < 2 * RADIUS:
            assert velocity @ away / distance < 0.02
            break
