"""Samples near lines are counted by a table as by the lines themselves."""

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.lines.rough_distances import count_marks_near_lines
from robocup_vision.localization.lines.line_map import LineMap

FIELDS = ["ssl_2001", "four_legged_2007", "msl_18x12"]
POSE = Pose2(0.7, -0.4, 2.1)


@pytest.mark.parametrize("name", FIELDS)
def test_marks_near_lines_are_counted_as_numpy_does(name):
    lines, rng = LineMap(load_field(name)), np.random.default_rng(2)
    marks, floor_m = rng.integers(0, 3, (300, 40), dtype=np.uint8), rng.uniform(-8, 8, (300, 40, 2))
    floor_m[:, -1] = np.nan
    # from what no sample is near to, up to what the table does not hold
    near_m = np.where(np.arange(40) % 5 == 0, 0.0, rng.uniform(0.0, 0.3, 40) ** 2)
    near_m[1] = 2.0
    away_m = lines.nearest(POSE.transform(floor_m)).distance_m.reshape(marks.shape)
    is_near = (away_m < near_m) & np.isfinite(floor_m[..., 0])
    tables = lines.lines, lines.arcs, lines.distances, lines.truncate_m
    for mark in range(3):
        count = count_marks_near_lines(marks, mark, floor_m, near_m, tuple(POSE.array.tolist()), *tables)
        assert count == np.count_nonzero(is_near & (marks == mark)) > 0


def test_points_at_a_lines_reach_are_counted_exactly():
    lines = LineMap(load_field("ssl_2001"))
    feet = lines.field.line_points(0.013)
    near = lines.nearest(feet + 1e-4)
    for away_m, expected in ((0.0499, True), (0.0501, False)):
        floor_m = (feet + 1e-4 + (away_m - near.distance_m)[:, None] * near.normal)[None]
        exact_m = lines.nearest(floor_m[0]).distance_m
        marks, near_m = np.ones((1, len(feet)), dtype=np.uint8), np.full(len(feet), 0.05)
        tables = lines.lines, lines.arcs, lines.distances, lines.truncate_m
        count = count_marks_near_lines(marks, 1, floor_m, near_m, (0.0, 0.0, 0.0), *tables)
        assert count == np.count_nonzero(exact_m < 0.05)
        assert (count > 0.9 * len(feet)) == expected
