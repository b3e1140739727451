"""Laws of the distances to a field's lines, and which lines are point-symmetric."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.localization.lines.line_map import LineMap

MAP = LineMap(load_field("msl_6x4"))
coordinates = st.tuples(st.floats(-5, 5), st.floats(-4, 4))


@given(coordinates)
def test_stepping_back_along_the_normal_reaches_the_line(point):
    near = MAP.nearest(point)
    foot = np.array(point) - near.distance_m[:, None] * near.normal
    assert MAP.nearest(foot).distance_m[0] < 1e-8
    np.testing.assert_allclose(np.linalg.norm(near.normal), 1.0)


@pytest.mark.parametrize("name", ["msl_6x4", "msl_18x12", "spl_2020", "ssl_2001"])
def test_built_in_fields_are_point_symmetric(name):
    assert LineMap(load_field(name)).is_point_symmetric


def test_a_field_with_one_goal_area_is_not():
    field = load_field("ssl_2001")
    lopsided = dataclasses.replace(field, lines=np.vstack([field.lines, [1.0, -0.3, 1.0, 0.3]]))
    assert not LineMap(lopsided).is_point_symmetric


def test_robots_may_stand_wherever_the_floor_surely_reaches():
    np.testing.assert_allclose(MAP.extent_m, [[-3.3, -2.3], [3.3, 2.3]])
