"""Distances to field lines."""

import numpy as np

from field_models import load_field
from robocup_vision.kernels.lines.lines import nearest_lines


def test_nearest_lines_have_a_normal_on_the_line_itself():
    field = load_field("msl_6x4")
    points = field.line_points(0.3)
    distance, normal, _ = nearest_lines(points, field.lines, field.arcs)
    assert distance.max() < 1e-9
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)
