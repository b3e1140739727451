"""Edges of a goal measured to a small part of a pixel, and the point spread that they are measured with."""

import dataclasses
import math

import numpy as np
import pytest
from goal_samples import silhouette_normals

from field_models import COLOR_NAMES, load_field
from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.localization.goal.edges import EdgeAppearance, EdgeSamples
from robocup_vision.localization.goal.fit import GoalFit, goal_model, residuals
from robocup_vision.localization.goal.geometry import EDGES, UNKNOWNS, goal_shape
from robocup_vision.localization.goal.point_spread import (
    HALVED,
    PER_PX,
    SPREADS,
    TYPICAL,
    PointSpread,
    nearest_best,
    step_response,
)
from robocup_vision.localization.goal.profile import polish
from sim2d.rendering.goal.scenes import ers7_camera

FIELD = load_field("four_legged_2007")
SHAPE = goal_shape(FIELD)
CAMERA = dataclasses.replace(ers7_camera(), height_std_m=0.0)
MODEL = goal_model(SHAPE, CAMERA, 0.0)
CYAN = np.array(COLOR_NAMES["cyan"], dtype=float)
AWAY = CYAN - CYAN.mean()
TOWARDS = EdgeAppearance(AWAY / np.linalg.norm(AWAY), 235.0, 0.0)
TRUTH = np.array([-1.9, 0.3, -0.05, 0.02, 0.01, CAMERA.height_m, 0.0, 0.0])
FINE = 6


def drawn(p, shade=0.0, shine=False):
    """Draw a goal of a hue before an even wall on carpet, every pixel the mean over its own square: (H, W, 3) float."""
    width, height = CAMERA.size_px
    # each row of rays is shifted against the one above it, and each column: edges along them meet every place
    part = np.arange(FINE) / FINE**2
    across = (np.arange(width * FINE)[None, :] + 0.5) / FINE - 0.5 + (part - part.mean())[:, None]
    down = (np.arange(FINE)[:, None] + 0.5) / FINE - 0.5 + np.tile(part - part.mean(), width)[None, :]
    turn = camera_rotation(p[2], p[3], p[4])
    left = (MODEL.view.center_px[0] - across) / MODEL.view.focal_px[0]
    rows = []
    normals = silhouette_normals(SHAPE, p)
    for block in range(height):
        up = (MODEL.view.center_px[1] - block - down) / MODEL.view.focal_px[1]
        ray = np.stack([np.ones_like(up), left, up], axis=-1) @ turn.T
        beyond = ray @ normals.T
        light = np.where((ray[..., 2] < 0)[..., None], np.array([40.0, 110.0, 50.0]), np.array([120.0, 115.0, 110.0]))
        foot = p[5] / np.maximum(-ray[..., 2], 1e-9)
        for edges, is_bar in (((4, 5), True), ((0, 1), False), ((2, 3), False)):
            a, b = beyond[..., edges[0]], beyond[..., edges[1]]
            inside = (a < 0) & (b < 0)
            if is_bar:
                inside &= (beyond[..., 0] < 0) & (beyond[..., 3] < 0)
            else:
                inside &= beyond[..., 4] < 0
                inside &= foot * np.hypot(ray[..., 0], ray[..., 1]) > _reach(p, ray, edges)
            xi = (a - b) / np.minimum(a + b, -1e-12)
            paint = CYAN * 0.6 * (1 - shade + shade * np.sqrt(np.maximum(0.0, 1 - xi * xi)))[..., None]
            if shine and not is_bar:
                paint = np.where((np.abs(xi - 0.1) < 0.3)[..., None], 255.0, paint)
            light = np.where(inside[..., None], paint, light)
        rows.append(light.reshape(FINE, width, FINE, 3).mean(axis=(0, 2)))
    return np.array(rows)


def _reach(p, ray, edges):
    """How far along the floor a post's near side is, in the direction of each ray; infinite beside it."""
    post = np.array([SHAPE.line_x_m, SHAPE.post_y_m[0 if edges[0] == 0 else 1]]) - p[:2]
    flat = ray[..., :2] / np.linalg.norm(ray[..., :2], axis=-1, keepdims=True)
    ahead = flat @ post
    square = SHAPE.radius_m**2 - (post @ post - ahead**2)
    return np.where(square >= 0, ahead - np.sqrt(np.maximum(square, 0)), np.inf)


def found_near(p, offset):
    """Return a fit of edges that is off and says so."""
    index = np.empty(0, np.int64)
    none = np.empty((0, 2))
    samples = EdgeSamples(index, none, index, index, none, none, np.empty(0), np.full(EDGES, 10))
    information = np.diag(np.array([0.2, 0.2, 0.05, 0.02, 0.02, 0.01, 0.01, 0.1]) ** -2.0)
    return GoalFit(p + offset, information, samples, np.empty(0), np.ones(EDGES))


def jpeg_colour(image):
    """Let pairs of pixels, both ways, share one colour and keep their own brightness."""
    luma = image @ np.array([0.114, 0.587, 0.299])
    rest = image - luma[..., None]
    height, width, _ = image.shape
    shared = rest.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3)).repeat(2, axis=0).repeat(2, axis=1)
    return luma[..., None] + shared


def mixed(image, share):
    """Mix neighbours along rows and columns."""
    for axis in (0, 1):
        image = (1 - 2 * share) * image + share * (np.roll(image, 1, axis) + np.roll(image, -1, axis))
    return image


@pytest.fixture(scope="module")
def plain():
    return drawn(TRUTH)


def fitted(image, offset=None):
    if offset is None:
        offset = np.array([0.02, -0.02, 0.002, 0.001, -0.001, 0, 0, 0])
    frame = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    return polish(frame, CAMERA, MODEL, found_near(TRUTH, offset), TOWARDS)


def edge_errors_px(fit):
    """Return how far each piece of an edge was measured from where it was drawn."""
    samples = fit.samples
    assert len(samples.edge) > 25
    return np.abs(residuals(MODEL, samples, TRUTH)[: len(samples.edge)])


@pytest.mark.parametrize("share", [0.11, 0.2])
def test_edges_lie_where_they_were_drawn_whatever_the_point_spread(plain, share):
    fit = fitted(mixed(plain, share))
    assert np.median(edge_errors_px(fit)) < 0.02
    assert math.dist(fit.unknowns[:2], TRUTH[:2]) < 0.03


def test_colour_at_half_the_resolution_moves_no_edge(plain):
    fit = fitted(jpeg_colour(mixed(plain, 0.11)))
    assert np.median(edge_errors_px(fit)) < 0.02
    assert math.dist(fit.unknowns[:2], TRUTH[:2]) < 0.03


@pytest.mark.slow
def test_a_lit_cylinder_and_shining_paint_move_no_edge():
    """Only this finds a gloss on a post that moves its edges."""
    fit = fitted(mixed(drawn(TRUTH, shade=0.5, shine=True), 0.11))
    assert np.median(edge_errors_px(fit)) < 0.03
    assert math.dist(fit.unknowns[:2], TRUTH[:2]) < 0.04


def test_what_does_not_confirm_the_edges_leaves_them():
    flat = np.full((CAMERA.size_px[1], CAMERA.size_px[0], 3), 90.0)
    start = found_near(TRUTH, np.zeros(UNKNOWNS))
    assert polish(flat.astype(np.uint8), CAMERA, MODEL, start, TOWARDS) is start
    behind = TRUTH.copy()
    behind[2] += math.pi
    start = found_near(behind, np.zeros(UNKNOWNS))
    assert polish(flat.astype(np.uint8), CAMERA, MODEL, start, TOWARDS) is start


@pytest.mark.parametrize("spread", [*SPREADS, *(PointSpread(0.125, 0.2, kind) for kind in HALVED)])
def test_a_step_rises_from_dark_to_light_by_its_own_density(spread):
    for light, density in np.moveaxis(step_response(spread), 2, 1):
        assert light[0] == pytest.approx(0.0, abs=1e-3)
        assert light[-1] == pytest.approx(1.0, abs=1e-3)
        assert np.all(np.diff(light) > -1e-12)
        slope = (light[2:] - light[:-2]) * PER_PX / 2
        np.testing.assert_allclose(density[1:-1], slope, atol=0.03)


@pytest.mark.parametrize("spread", SPREADS)
def test_light_is_that_of_a_square_pixel_mixed_and_blurred(spread):
    fine = 200
    at = np.arange(-6 * fine, 6 * fine) / fine
    step = np.array([0.5 * math.erfc(-t / (spread.lens_px * math.sqrt(2))) for t in at])
    pixel = np.convolve(step, np.ones(fine) / fine, "same")
    mixed = (1 - 2 * spread.mixed) * pixel + spread.mixed * (np.roll(pixel, fine) + np.roll(pixel, -fine))
    for offset in (-1.3, -0.4, 0.0, 0.2, 0.9):
        got = step_response(spread)[0, round((4 + offset) * PER_PX), 0]
        assert got == pytest.approx(np.interp(round(offset * PER_PX) / PER_PX, at, mixed), abs=5e-3)


@pytest.mark.parametrize("kind", HALVED)
def test_colour_at_half_the_resolution_is_that_of_two_pixels_each(kind):
    # a row of pixels with a step at 10.3, averaged in pairs and spread again
    whole, halved = (step_response(PointSpread(0.0, 0.2, k)) for k in ("", kind))
    where, pixels = 10.3, np.arange(24)

    def light(response, pixel):
        entry = np.clip((pixel - where) * PER_PX + 4 * PER_PX, 0, response.shape[1] - 1)
        return np.interp(entry, np.arange(response.shape[1]), response[pixel % 2, :, 0])

    values = np.array([light(whole, pixel) for pixel in pixels]).reshape(-1, 2).mean(axis=1)
    beside = np.where(pixels % 2 == 0, pixels // 2 - 1, pixels // 2 + 1).clip(0, len(values) - 1)
    near = 0.75 if kind == "linear" else 1.0
    expected = near * values[pixels // 2] + (1 - near) * values[beside]
    got = np.array([light(halved, pixel) for pixel in pixels])
    np.testing.assert_allclose(got[4:-4], expected[4:-4], atol=5e-3)


@pytest.mark.parametrize("truth", SPREADS)
def test_the_search_finds_a_spread_that_shows_a_step_alike(truth):
    shown = step_response(truth)[0, :, 0]

    def cost(spread):
        return float(np.sum((step_response(spread)[0, :, 0] - shown) ** 2))

    found = step_response(nearest_best(cost, TYPICAL))[0, :, 0]
    np.testing.assert_allclose(found, shown, atol=0.03)


def test_the_search_stays_where_all_cost_alike():
    assert nearest_best(lambda spread: 1.0, TYPICAL) == TYPICAL
