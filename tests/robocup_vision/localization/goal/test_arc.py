"""The arc of cameras that see a far goal alike: on exact samples with known noise."""

from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.kernels.goal.edge_places import goal_points
from robocup_vision.localization.goal.arc import follow_arc, turned
from robocup_vision.localization.goal.edges import FOOT_OFFSETS, EdgeSamples
from robocup_vision.localization.goal.fit import covariance_of, fit, goal_model, only, weigh
from robocup_vision.localization.goal.geometry import EDGES, HEADING, Y, goal_shape, project
from sim2d.rendering.goal.scenes import ers7_camera

SHAPE = goal_shape(load_field("four_legged_2007"))
MODEL = goal_model(SHAPE, ers7_camera(208, 160), 0.15)
TRUTH = np.array([-2.0, 0.9, -0.19, 0.02, 0.01, 0.185, 0.0, 0.0])


def samples(rng, noise_px=0.06):
    points, count = np.empty((12 + 4 * len(FOOT_OFFSETS), 2)), len(FOOT_OFFSETS)
    goal_points(MODEL.scene, TRUTH, points)
    edge, uv = [], []
    for e, (a, b) in enumerate(points[:12].reshape(6, 2, 2)):
        normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.hypot(*(b - a))
        shift = noise_px * rng.standard_normal() * normal
        edge += [e] * 12
        uv += [a + t * (b - a) + shift for t in np.linspace(0.02, 0.98, 12)]
    feet = points[12 : 12 + 2 * count]
    return weigh(
        EdgeSamples(
            np.array(edge),
            np.array(uv),
            np.repeat([0, 1], count),
            np.tile(np.arange(count), 2),
            feet,
            np.tile([0.0, 1.0], (2 * count, 1)),
            np.full(len(edge) + 2 * count, 0.02),
            np.full(6, 12),
        )
    )


def test_the_arc_s_spread_covers_what_one_point_s_covariance_does_not():
    rng = np.random.default_rng(4)
    squares, naive = [], []
    for _ in range(25):
        seen = samples(rng)
        p, _, information = fit(MODEL, seen, TRUTH + 0.01, np.full(8, 0.3))
        covariance = covariance_of(MODEL, information)
        std = float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
        arc = follow_arc(MODEL, seen.for_fit, p, std)
        assert np.all(np.diff(arc.unknowns[:, HEADING]) > 0)
        assert arc.probability.sum() == pytest.approx(1.0)
        off = (p - TRUTH)[:3]
        squares.append(off @ np.linalg.solve(arc.covariance_about(p)[:3, :3], off))
        naive.append(off @ np.linalg.solve(covariance[:3, :3], off))
        # somewhere on it the truth is
        at_truth = np.interp(TRUTH[HEADING], arc.unknowns[:, HEADING], arc.unknowns[:, 1])
        assert at_truth == pytest.approx(TRUTH[1], abs=0.1)
    assert np.mean(squares) < 6.0 < np.mean(naive)


def test_without_a_fit_there_is_no_arc():
    behind = TRUTH.copy()
    behind[HEADING] += np.pi
    assert follow_arc(MODEL, samples(np.random.default_rng(0)).for_fit, behind, 0.1) is None


def test_what_is_held_has_no_variance():
    seen = samples(np.random.default_rng(0))
    _, _, information = fit(MODEL, seen, TRUTH, np.full(4, 0.3))
    held = np.isinf(MODEL.weight)
    assert held.any()
    assert not covariance_of(MODEL, information)[held].any()


@pytest.mark.parametrize("y_m", [-0.8, 0.0, 0.9])
def test_what_one_post_leaves_open_is_definite_beyond_rounding(y_m):
    """Roots of its variances are taken: rounding errors of the rest must not make one negative."""
    seen = samples(np.random.default_rng(0))
    of_post = only(seen, np.arange(EDGES) < 2, np.array([True, False]))
    of_post = replace(of_post, sigma=np.full(len(of_post.sigma), 0.02))
    start = TRUTH.copy()
    start[Y] = y_m
    _, cost, information = fit(MODEL, of_post, start, np.full(1, 0.3))
    assert np.isfinite(cost)
    least, *_, most = np.linalg.eigvalsh(information)
    assert least > 100 * np.finfo(np.float64).eps * most
    assert np.linalg.eigvalsh(covariance_of(MODEL, information)[:2, :2])[1] > 1.0


def test_turning_keeps_the_goal_where_it_is_seen():
    p = turned(MODEL, TRUTH, 0.2)
    assert p[HEADING] == pytest.approx(TRUTH[HEADING] + 0.2)
    middle = np.array([[SHAPE.line_x_m, 0.0, 0.2]])
    np.testing.assert_allclose(project(MODEL.view, p, middle), project(MODEL.view, TRUTH, middle), atol=1e-9)
