"""Silhouettes among edges of any colour: marking against NumPy, scores against plain loops, settling by itself."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.kernels.goal.edge_places import goal_points
from robocup_vision.kernels.goal.silhouettes import (
    Cameras,
    Evidence,
    mark_edges,
    score_places,
    settle,
    silhouette_nats,
    strongest_gradients,
)
from robocup_vision.localization.goal.edges import goal_scene
from robocup_vision.localization.goal.geometry import IdealView, goal_shape

SHAPE = goal_shape(load_field("four_legged_2007"))
SIZE = (120, 90)
SCENE = goal_scene(SHAPE, IdealView((110.0, 108.0), (59.5, 44.5)))._replace(offsets=np.empty(0))
HEIGHT_M = 0.185
NATS = np.tile([-1.2, 0.6, 1.5], (4, 1))
NORMALS = [(1.0, 0.0), (math.sqrt(0.5), math.sqrt(0.5)), (0.0, 1.0), (-math.sqrt(0.5), math.sqrt(0.5))]


def outlined(x, y, heading, tilt, roll):
    """Place the ends (12, 2) of the goal's six edges in cells; None where it is not all in front."""
    points = np.empty((12, 2))
    unknowns = np.array([x, y, heading, tilt, roll, HEIGHT_M, 0.0, 0.0])
    return points if goal_points(SCENE, unknowns, points) else None


def direction_of(ends):
    """Which of the four directions an edge between two points has: that of the nearest normal."""
    along, down = ends[1] - ends[0]
    normal = np.array([-down, along]) / math.hypot(along, down)
    return int(np.argmax([abs(normal @ one) for one in NORMALS]))


def drawn(points):
    """Levels with a goal's edges in them, and beside them in the cells around."""
    levels = np.zeros(SIZE[::-1], np.uint8)
    for edge in points.reshape(6, 2, 2):
        bit = direction_of(edge)
        for part in np.linspace(0.0, 1.0, 200):
            u, v = np.floor(edge[0] + part * (edge[1] - edge[0]) + 0.5).astype(int)
            if 0 <= u < SIZE[0] and 0 <= v < SIZE[1]:
                levels[v, u] |= 1 << bit
                levels[max(v - 1, 0) : v + 2, max(u - 1, 0) : u + 2] |= 16 << bit
    return levels


def along(points, part):
    """Cell that lies at a part of the way between two points."""
    u, v = points[0] + part * (points[1] - points[0]) + 0.5
    return (int(u), int(v)) if u >= 0 and v >= 0 and u < SIZE[0] and v < SIZE[1] else None


def plain_score(evidence, points):
    """Evidence of a silhouette: paint, and edges."""
    parts = (np.arange(10) + 0.5) / 10
    paint = edges = 0.0
    ends = points.reshape(3, 2, 2, 2).mean(axis=1)
    for element in ends:
        for part in parts:
            cell = along(element, part)
            paint += 0.0 if cell is None else float(evidence.paint_nats[cell[1], cell[0]])
    for edge in points.reshape(6, 2, 2):
        bit = direction_of(edge)
        for part in parts:
            cell = along(edge, part)
            if cell is not None:
                level = int(evidence.levels[cell[1], cell[0]])
                edges += evidence.edge_nats[bit, (level >> bit & 1) + (level >> (bit + 4) & 1)]
    return paint, edges


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_gradients_are_those_of_the_channel_where_they_are_greatest(seed):
    image = np.random.default_rng(seed).integers(0, 256, (9, 11, 3)).astype(np.uint8)
    across, down = np.empty((2, 9, 11), np.int32)
    strongest_gradients(image, across, down)
    signed = image.astype(np.int32)
    du, dv = signed[1:-1, 2:] - signed[1:-1, :-2], signed[2:, 1:-1] - signed[:-2, 1:-1]
    best = np.argmax(du**2 + dv**2, axis=2)[..., None]
    np.testing.assert_array_equal(across[1:-1, 1:-1], np.take_along_axis(du, best, 2)[..., 0])
    np.testing.assert_array_equal(down[1:-1, 1:-1], np.take_along_axis(dv, best, 2)[..., 0])
    border = np.ones((9, 11), bool)
    border[1:-1, 1:-1] = False
    assert not across[border].any()
    assert not down[border].any()


@pytest.mark.parametrize("cell_px", [1, 3])
@pytest.mark.parametrize("turned_rad", np.arange(8) * math.pi / 8)
def test_an_edge_is_marked_where_it_runs_by_its_direction_and_in_the_cells_around(cell_px, turned_rad):
    v, u = np.mgrid[0:60, 0:60].astype(float) - 29.7
    depth = u * math.cos(turned_rad) + v * math.sin(turned_rad)
    image = np.repeat(np.uint8(255 / (1 + np.exp(-depth)))[..., None], 3, axis=2)
    across, down = np.empty((2, 60, 60), np.int32)
    strongest_gradients(image, across, down)
    levels = np.zeros((60 // cell_px, 60 // cell_px), np.uint8)
    mark_edges(across, down, 400.0, cell_px, levels)
    there, nearby = levels & 15, levels >> 4
    # a direction between two of the four is both
    normal = (math.cos(turned_rad), math.sin(turned_rad))
    bits = sum(1 << k for k, one in enumerate(NORMALS) if (one[0] * normal[0] + one[1] * normal[1]) ** 2 > 0.67)
    assert set(np.unique(there)) == {0, bits}
    middle = 29.7 + (0.5 if cell_px == 1 else 0.0)
    rows, columns = np.nonzero(there)
    off = (columns + 0.5) * cell_px * normal[0] + (rows + 0.5) * cell_px * normal[1] - middle * sum(normal)
    assert np.abs(off).max() < 1.0 + cell_px
    assert len(rows) >= 50 // cell_px
    around = np.zeros_like(nearby)
    for row, column in zip(rows, columns, strict=True):
        around[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] |= there[row, column]
    np.testing.assert_array_equal(nearby, around)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_places_are_scored_as_plain_loops_score_them(seed):
    rng = np.random.default_rng(seed)
    evidence = Evidence(
        rng.integers(0, 256, SIZE[::-1]).astype(np.uint8),
        rng.normal(size=(4, 3)),
        rng.normal(0.1, 1.0, SIZE[::-1]).astype(np.float32),
        np.where(np.arange(SIZE[1])[:, None] > 45, np.uint8(255), np.uint8(0)) * np.ones(SIZE, np.uint8).T,
    )
    places = np.stack([rng.uniform(-1.0, 2.0, 3), rng.uniform(-1.0, 1.0, 3)], axis=-1)
    cameras = Cameras(places, np.array([-0.1, 0.05]), np.array([40.0, 59.0, 80.0]), 0.02, HEIGHT_M)
    found = np.empty((3, 4))
    score_places(SCENE, evidence, cameras, found)
    for place, result in zip(places, found, strict=True):
        best = (-math.inf, 0.0, 0.0, 0.0)
        for tilt in cameras.tilts_rad:
            for column in cameras.columns:
                heading = math.atan2(-place[1], SHAPE.line_x_m - place[0]) + math.atan((column - 59.5) / 110.0)
                points = outlined(*place, heading, tilt, 0.02)
                if points is None or points[8, 1] < -1.0:
                    continue
                feet = points[[0, 6]] + 0.5
                if feet.min() < 0 or (feet >= SIZE).any():
                    continue
                if not any(evidence.carpet[min(int(v) + 2, SIZE[1] - 1), int(u)] for u, v in feet):
                    continue
                paint, edges = plain_score(evidence, points)
                if paint >= 0:
                    best = max(best, (paint + edges, heading, tilt, paint))
        if math.isinf(best[0]):
            assert math.isinf(result[0])
        else:
            assert result == pytest.approx(best, abs=1e-4)


@settings(deadline=None, max_examples=30)
@given(
    st.floats(-1.0, 2.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0), st.floats(-0.2, 0.2), st.integers(0, 2**32 - 1)
)
def test_one_camera_counts_paint_and_edges_as_plain_loops_do(x, y, heading, tilt, seed):
    rng = np.random.default_rng(seed)
    evidence = Evidence(
        rng.integers(0, 256, SIZE[::-1]).astype(np.uint8),
        rng.normal(size=(4, 3)),
        rng.normal(size=SIZE[::-1]).astype(np.float32),
        np.zeros(SIZE[::-1], np.uint8),
    )
    nats = silhouette_nats(SCENE, evidence, np.array([x, y, heading, tilt, 0.02, HEIGHT_M, 0.0, 0.0]))
    points = outlined(x, y, heading, tilt, 0.02)
    assert nats == pytest.approx(-np.inf if points is None else sum(plain_score(evidence, points)), abs=1e-6)


@settings(deadline=None, max_examples=15)
@given(st.floats(0.8, 1.3), st.floats(-0.6, 0.6), st.floats(-0.1, 0.1), st.integers(0, 2**32 - 1))
def test_a_camera_settles_where_the_goal_s_edges_are(x, y, tilt, seed):
    rng = np.random.default_rng(seed)
    true = np.array([x, y, math.atan2(-y, SHAPE.line_x_m - x), tilt, 0.0])
    nothing = np.zeros(SIZE[::-1], np.float32)
    evidence = Evidence(drawn(outlined(*true)), NATS, nothing, nothing.astype(np.uint8))
    start = true + rng.uniform(-1, 1, 5) * [0.03, 0.03, 0.015, 0.015, 0.005]
    before = plain_score(evidence, outlined(*start))[1]
    settled = start.copy()
    nats = settle(SCENE, evidence.levels, evidence.edge_nats, HEIGHT_M, 2.0, settled)
    points = outlined(*settled)
    assert nats == pytest.approx(plain_score(evidence, points)[1], abs=1e-6)
    assert nats >= before - 1e-9
    assert np.hypot(*(points - outlined(*true)).T).mean() < 1.5
