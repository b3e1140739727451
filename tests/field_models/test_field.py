"""What holds for every field: half-turn symmetry, a counter-clockwise floor, lines on it, walls around it."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from strategies import built_in_fields, numbers

from field_models import COLOR_NAMES, Field, field_names, load_field


@pytest.fixture(params=field_names())
def field(request: pytest.FixtureRequest) -> Field:
    return load_field(request.param)


def assert_same_points(a: np.ndarray, b: np.ndarray) -> None:
    distance = np.linalg.norm(a[:, None] - b[None], axis=2)
    assert distance.min(axis=0).max() < 1e-9
    assert distance.min(axis=1).max() < 1e-9


@pytest.mark.parametrize("signs", [(-1, -1), (1, -1)], ids=["half turn", "reflection"])
def test_lines_arcs_floor_and_walls_are_symmetric(field: Field, signs: tuple[int, int]):
    dense = field.line_points(0.01)
    distance = np.linalg.norm((field.line_points(0.25) * signs)[:, None] - dense[None], axis=2)
    assert distance.min(axis=1).max() < 0.006  # half the dense spacing: it lies on a line
    assert_same_points(field.floor_polygon * signs, field.floor_polygon)
    middles = (field.walls[:, :2] + field.walls[:, 2:]) / 2
    assert_same_points(middles * signs, middles)


def test_floor_polygon_is_counter_clockwise(field: Field):
    x, y = field.floor_polygon.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    recesses = sum(g.depth_m * g.width_m for g in field.goals if g.kind == "recess")
    reach = np.array([field.length_m, field.width_m]) + 2 * (np.abs(y).max() - field.width_m / 2)
    assert area == pytest.approx(reach[0] * reach[1] + recesses)


def test_every_line_and_arc_lies_on_the_floor(field: Field):
    points = field.line_points(0.02)
    assert len(points) > 50
    assert field.contains(points * (1 - 1e-9)).all()


def test_line_points_are_as_close_as_asked_and_cover_every_line(field: Field):
    points = field.line_points(0.05)
    for x0, y0, x1, y1 in field.lines:
        for end in ((x0, y0), (x1, y1), ((x0 + x1) / 2, (y0 + y1) / 2)):
            assert np.hypot(*(points - end).T).min() <= 0.025 + 1e-9
    for x, y, radius, start, sweep in field.arcs:
        middle = (x + radius * math.cos(start + sweep / 2), y + radius * math.sin(start + sweep / 2))
        assert np.hypot(*(points - middle).T).min() <= 0.025 + 1e-9


def test_penalty_and_corner_arcs_are_painted_only_where_they_belong(field: Field):
    for x, y, radius, start, sweep in field.arcs:
        angles = start + np.linspace(0, sweep, 50)
        points = np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1)
        assert np.all(np.abs(points) <= [field.length_m / 2 + 1e-9, field.width_m / 2 + 1e-9])
        if abs(sweep) > 6:
            continue
        if y == 0:  # a penalty arc: it begins and ends on the area's front line and bulges towards the centre
            front = np.abs(points[:, 0]).max()
            assert np.abs(points[[0, -1], 0]) == pytest.approx([front, front])
            assert any(math.isclose(abs(line[0]), front) and line[0] == line[2] for line in field.lines)
            assert np.all(np.abs(points[1:-1, 0]) < front)


@given(built_in_fields(), numbers(-8, 8), numbers(-6, 6))
def test_contains_agrees_with_opencv(field: Field, x: float, y: float):
    signed = cv2.pointPolygonTest(field.floor_polygon.astype(np.float32), (x, y), True)
    if abs(signed) > 1e-5:  # OpenCV's contour is float32
        assert bool(field.contains([x, y])) == (signed > 0)


def test_contains_takes_any_shape_and_knows_the_goal_recess():
    field = load_field("ssl_2001")
    assert field.contains([0.0, 0.0]).shape == ()
    assert field.contains(np.zeros((2, 3, 2))).shape == (2, 3)
    np.testing.assert_array_equal(
        field.contains([[1.5, 0.0], [1.5, 0.29], [1.5, 0.31], [1.56, 0.0], [-1.5, 0.1], [1.36, 0.7], [np.nan, 0.0]]),
        [True, True, False, False, True, True, False],
    )


def test_walls_go_once_around_the_floor_and_add_the_goals_panels(field: Field):
    corners = len(field.floor_polygon)
    around, panels = field.walls[:corners], field.walls[corners:]
    np.testing.assert_array_equal(around[:, :2], field.floor_polygon)
    np.testing.assert_array_equal(around[:, 2:], np.roll(field.floor_polygon, -1, axis=0))
    assert len(panels) == 3 * sum(g.kind == "panels" for g in field.goals)
    assert field.contains(panels.reshape(-1, 2) * (1 - 1e-9)).all()


def test_goal_panels_are_its_two_sides_and_its_back(field: Field):
    for goal in field.goals:
        side, back, other = goal.panels
        half = goal.width_m / 2
        assert goal.line_x_m == goal.side * field.length_m / 2
        assert abs(goal.back_x_m) == pytest.approx(abs(goal.line_x_m) + goal.depth_m)
        np.testing.assert_allclose(side, [goal.line_x_m, -half, goal.back_x_m, -half])
        np.testing.assert_allclose(back, [goal.back_x_m, -half, goal.back_x_m, half])
        np.testing.assert_allclose(other, [goal.back_x_m, half, goal.line_x_m, half])
    assert [goal.side for goal in field.goals] in ([1, -1], [])


@pytest.mark.parametrize("name", ["lines", "arcs", "floor_polygon", "walls"])
def test_arrays_are_read_only(field: Field, name: str):
    array = getattr(field, name)
    with pytest.raises(ValueError, match="read-only"):
        array[...] = 0.0


def test_colours_are_ones_a_renderer_knows(field: Field):
    used = {field.wall_color, field.ball_color, field.line_color} | {goal.color for goal in field.goals}
    assert used | {color for beacon in field.beacons for color in beacon.colors} <= set(COLOR_NAMES)


def test_only_an_outline_that_stands_bounds_the_floor(field: Field):
    assert field.is_bounded == (field.wall_height_m > 0)
