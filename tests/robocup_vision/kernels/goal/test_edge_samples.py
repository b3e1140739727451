"""Samples of edges and feet against the same steps in plain NumPy."""

import numpy as np
import pytest
from goal_twins import SHAPE, VIEW
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.goal.edge_places import EdgePlaces, goal_points, spread_samples
from robocup_vision.kernels.goal.edge_samples import DueEdges, EdgeLook, FoundEdges, sample_edges, weigh_samples
from robocup_vision.kernels.goal.edges import EdgeOffsets, EdgeStarts, measure_edges
from robocup_vision.localization.goal.edges import EdgeSampleSettings, goal_scene

SPACING_PX, MAX_SAMPLES, REACH_PX, DEPTH_PX = 2.0, 40, 3.0, 3.0
TOWARDS = np.array([-0.4, -0.4, 0.8])
FOOT_TOWARDS = np.array(EdgeSampleSettings().foot_towards)


def measured(image, starts, glare):
    results = np.empty((3, len(starts.uv)))
    measure_edges(image, starts, glare, EdgeOffsets(*results))
    return results


def plain_samples(image, points, feet, paint):
    room = 6 * MAX_SAMPLES + feet
    places = EdgePlaces(
        np.empty((room, 2)), np.empty((room, 2)), np.empty(room, np.int64), np.empty(room), np.empty(6, np.int64)
    )
    count = spread_samples(points, feet, image.shape[1::-1], SPACING_PX, MAX_SAMPLES, places)
    n = count - feet
    uv, normals, edge, inside = places.starts[:count], places.normals[:count], places.edge[:n], places.inside[:count]
    towards = np.vstack([np.tile(TOWARDS, (n, 1)), np.tile(FOOT_TOWARDS, (feet, 1))])
    grey = np.append(np.zeros(n), np.ones(feet))
    offset, contrast, sigma = measured(
        image, EdgeStarts(uv, normals, np.full(count, REACH_PX), inside, towards, grey), 200.0
    )
    found = np.isfinite(offset)
    places.expected[:] -= np.bincount(edge[contrast[:n] < 0], minlength=6)
    where = uv + normals * np.where(found, offset, 0.0)[:, None]
    if paint.size:
        inner = (where - normals * np.clip(inside, 1.0, DEPTH_PX)[:, None]) * paint.shape[1] / image.shape[1]
        column, row = np.rint(inner).astype(int).T
        found &= paint[np.clip(row, 0, paint.shape[0] - 1), np.clip(column, 0, paint.shape[1] - 1)] > 0
    return edge[found[:n]], np.flatnonzero(found[n:]), where[found], normals[found], sigma[found], places.expected


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_samples_are_those_of_numpy(seed, is_masked):
    rng = np.random.default_rng(seed)
    blocks = rng.integers(0, 256, (32, 42, 3))
    image = np.clip(np.kron(blocks, np.ones((10, 10, 1))) + rng.normal(0, 3, (320, 420, 3)), 0, 255).astype(np.uint8)
    feet = 6
    points = np.empty((12 + 2 * feet, 2))
    p = np.array([rng.uniform(-1.5, 1.0), rng.uniform(-0.8, 0.8), *rng.uniform(-0.1, 0.1, 3), 0.2, 0.0, 0.0])
    scene = goal_scene(SHAPE, VIEW)._replace(offsets=np.array([-0.7, 0.0, 0.7]))
    assert goal_points(scene, p, points)
    paint = (rng.random((160, 210)) < 0.7).astype(np.uint8) if is_masked else np.empty((0, 0), np.uint8)
    room = 6 * MAX_SAMPLES + feet
    found = FoundEdges(
        np.empty(room, np.int64), np.empty((room, 2)), np.empty((room, 2)), np.empty(room), np.empty(6, np.int64)
    )
    look = EdgeLook(TOWARDS, FOOT_TOWARDS, 200.0, 0.0, paint, DEPTH_PX)
    edges, stood = sample_edges(image, DueEdges(points, feet, SPACING_PX, MAX_SAMPLES, REACH_PX), look, found)
    edge, foot, uv, normals, sigma, expected = plain_samples(image, points, feet, paint)
    last = edges + stood
    np.testing.assert_array_equal(found.edge[:last], np.append(edge, foot))
    np.testing.assert_allclose(found.uv[:last], uv, atol=1e-9)
    np.testing.assert_allclose(found.normals[:last], normals)
    np.testing.assert_allclose(found.sigma[:last], sigma)
    np.testing.assert_array_equal(found.expected, expected)


def test_what_an_edge_as_a_whole_is_off_counts_for_each_of_its_samples():
    rng = np.random.default_rng(5)
    edge, foot_post = rng.integers(0, 6, 30), rng.integers(0, 2, 5)
    sigma, weighed = rng.uniform(0.1, 0.5, 35), np.empty(35)
    weigh_samples(edge, foot_post, sigma, (0.05, 0.075, 0.25), weighed)
    whole = np.append(0.075**2 * np.bincount(edge)[edge], 0.25**2 * np.bincount(foot_post)[foot_post])
    assert weighed == pytest.approx(np.sqrt(sigma**2 + 0.05**2 + whole))
