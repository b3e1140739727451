"""Poses stay within walls: the nearest floor is floor, and near; a carpet that goes on bounds nothing."""

import math

import numpy as np
import pytest
from hypothesis import given
from strategies import numbers

from field_models import load_field
from robocup_vision.localization.filter.pose_filter import FloorBound

WALLED = [load_field(name) for name in ("ssl_2001", "ssl_division_b")]


@pytest.mark.parametrize("field", WALLED, ids=lambda field: field.name)
@given(numbers(-9, 9), numbers(-9, 9))
def test_the_nearest_floor_is_floor_and_none_is_nearer(field, x, y):
    place = FloorBound(field).nearest(x, y)
    assert (place is None) == field.is_on_floor(x, y)
    if place is not None:
        assert field.is_on_floor(*place.tolist())
        away = math.hypot(place[0] - x, place[1] - y)
        corners = field.floor_polygon
        edges = np.concatenate([corners + t * (np.roll(corners, -1, axis=0) - corners) for t in np.linspace(0, 1, 201)])
        assert away <= np.hypot(*(edges - (x, y)).T).min() + 1e-5


def test_a_carpet_that_goes_on_bounds_nothing():
    assert FloorBound(load_field("msl_18x12")).nearest(99.0, 0.0) is None
