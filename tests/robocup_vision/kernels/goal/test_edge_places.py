"""Places at which a goal's edges are measured, against NumPy."""

import math

import numpy as np
import pytest
from goal_twins import silhouette_lines
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.kernels.goal.edge_places import (
    EdgePlaces,
    goal_outline,
    goal_points,
    project_outline,
    spread_samples,
)
from robocup_vision.localization.goal.edges import edge_segments, goal_scene
from robocup_vision.localization.goal.geometry import IdealView, foot_points, goal_shape, project

SHAPE = goal_shape(load_field("four_legged_2007"))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_places_to_measure_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-2.0, 1.8), rng.uniform(-1.2, 1.2)
    p = np.array([x, y, math.atan2(-y, SHAPE.line_x_m - x), *rng.uniform(-0.1, 0.1, 2), 0.185, 0.0, 0.0])
    view = IdealView((384.0, 380.0), (207.5, 159.5))
    offsets = np.array([-0.6, 0.0, 0.6])
    points = np.empty((24, 2))
    assert goal_points(goal_scene(SHAPE, view)._replace(offsets=offsets), p, points)
    feet = foot_points(SHAPE, p, offsets).reshape(-1, 3)
    above = feet + np.array([0, 0, 0.5 * SHAPE.radius_m])
    expected = project(view, p, np.concatenate([edge_segments(SHAPE, p).reshape(-1, 3), feet, above]))
    np.testing.assert_allclose(points, expected, atol=1e-6)
    # a place's outline serves every orientation there
    outline, again = np.empty((24, 3)), np.empty((24, 2))
    scene = goal_scene(SHAPE, view)._replace(offsets=offsets)
    goal_outline(scene, *p[[0, 1, 5]], outline)
    np.testing.assert_allclose(outline[12:18] + p[[0, 1, 5]], feet, atol=1e-9)
    assert project_outline(outline, scene.camera, *p[2:5], again)
    np.testing.assert_allclose(again, expected, atol=1e-6)

    room = 6 * 10 + 6
    starts, normals, inside = np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
    edge, expected_count = np.empty(room, np.int64), np.empty(6, np.int64)
    places = EdgePlaces(starts, normals, edge, inside, expected_count)
    count = spread_samples(points, 6, (416, 320), 2.0, 10, places)
    assert count == expected_count.sum() + 6
    np.testing.assert_allclose(np.linalg.norm(normals[:count], axis=1), 1)
    assert (np.bincount(edge[:count], minlength=7)[:6] == expected_count).all()
    lines = silhouette_lines(SHAPE, view, p)
    for n in range(count - 6):
        e = edge[n]
        assert lines[e] @ np.append(starts[n], 1.0) == pytest.approx(0.0, abs=1e-6)
        # the normal points out, and the places inside the object
        assert lines[e] @ np.append(starts[n] + normals[n], 1.0) > 0.5
    np.testing.assert_allclose(starts[count - 6 : count], points[12:18])


def test_nothing_is_measured_behind_the_camera():
    p = np.array([0.0, 0.0, math.pi, 0.0, 0.0, 0.185, 0.0, 0.0])
    scene = goal_scene(SHAPE, IdealView((384.0, 380.0), (207.5, 159.5)))
    assert not goal_points(scene._replace(offsets=np.zeros(1)), p, np.empty((16, 2)))
