"""Feet of what stands on the floor: narrow ones, and those of the field itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.kernels.floor.things import FieldFeet, blocked_feet, is_of_field

RANGE_M = np.geomspace(0.3, 6.0, 24)


@pytest.mark.parametrize(("last", "foot"), [(12, 5), (6, 24 + 23)])
def test_a_thing_hides_the_floor_behind_it_and_a_speck_does_not(last, foot):
    marks, out = np.ones((1, 24), np.uint8), np.empty(1, np.int64)
    marks[0, 5 : last + 1] = 0
    # half as high as the camera it hides as much again as it is away: six columns
    blocked_feet(marks, np.ones_like(marks), RANGE_M, 0, 24, 0.5, 0.25, out)
    assert out[0] == foot


def test_the_floors_end_and_what_the_field_has_on_it_is_its_own():
    field = load_field("ssl_division_b")
    feet = FieldFeet(
        np.array(field.floor_polygon),
        np.vstack([goal.panels for goal in field.goals]),
        np.array([[1.0, 1.0, 0.1]]),
        np.empty((0, 4)),
    )
    rng = np.random.default_rng(0)
    robot = (0.5, -0.3, 0.7)
    c, s = math.cos(robot[2]), math.sin(robot[2])
    for x, y in rng.uniform(-5.5, 5.5, (400, 2)):
        away = np.array([x - robot[0], y - robot[1]])
        local = c * away[0] + s * away[1], c * away[1] - s * away[0]
        error_m = float(rng.uniform(0.0, 0.3))
        behind = np.array([x, y]) + error_m * away / np.hypot(*away)
        expected = not field.contains(behind) or math.hypot(x - 1.0, y - 1.0) < 0.1 + error_m
        for x0, y0, x1, y1 in feet.panels:
            along = np.linspace(0, 1, 2001)[:, None] * [x1 - x0, y1 - y0] + [x0, y0]
            expected |= bool(np.hypot(*(along - [x, y]).T).min() < error_m)
        assert is_of_field(*local, error_m, (0.0, 0.0), robot, feet) == expected


def test_the_inside_of_a_goal_with_a_net_is_the_fields_own():
    floor = np.array([[-5.0, -3.0], [5.0, -3.0], [5.0, 3.0], [-5.0, 3.0]])
    feet = FieldFeet(floor, np.empty((0, 4)), np.empty((0, 3)), np.array([[1.0, 4.0, 4.5, 0.8], [-1.0, 4.0, 4.5, 0.8]]))
    here = (0.0, 0.0), (0.0, 0.0, 0.0)
    assert is_of_field(4.3, 0.5, 0.05, *here, feet)
    assert is_of_field(-4.3, 0.5, 0.05, *here, feet)
    assert not is_of_field(3.9, 0.5, 0.05, *here, feet)
    assert not is_of_field(4.3, 1.0, 0.05, *here, feet)
