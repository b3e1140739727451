"""The map of a field's lines."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.localization.line_map import LineMap

MAP = LineMap(load_field("msl_6x4"))
coordinates = st.tuples(st.floats(-5, 5), st.floats(-4, 4))


@given(coordinates)
def test_stepping_back_along_the_normal_reaches_the_line(point):
    near = MAP.nearest(point)
    foot = np.array(point) - near.distance_m[:, None] * near.normal
    assert MAP.nearest(foot).distance_m[0] < 1e-8
    np.testing.assert_allclose(np.linalg.norm(near.normal), 1.0)


def test_robots_may_stand_wherever_the_floor_surely_reaches():
    corners = MAP.field.floor_polygon
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], [[-3.3, -2.3], [3.3, 2.3]])
