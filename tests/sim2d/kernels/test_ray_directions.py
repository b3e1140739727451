"""A camera's rays against plain NumPy: directions, floor, patches to the last bit, and the spread of bearings."""

import math

import numpy as np
import pytest

from sim2d.kernels.ray_directions import FlatRays, flatten_rays, pinhole_patches

HEIGHT_M = 0.3


def unit_directions(pixels, samples, rng, *, spread=0.02):
    """Rays of a pixel lie together; some look up, some along the floor."""
    middle = rng.uniform(-1, 1, (pixels, 1, 3)) * (1, 1, 0.4)
    rays = middle + spread * rng.standard_normal((pixels, samples, 3))
    return rays / np.linalg.norm(rays, axis=2, keepdims=True)


def flatten(directions, radial, tangential, order):
    flat = FlatRays(*np.empty((6, directions[..., 0].size), dtype=np.float32))
    return flat, flatten_rays(HEIGHT_M, order, directions, radial, tangential, flat)


@pytest.mark.parametrize("samples", [1, 4, 9])
def test_rays_are_those_of_numpy(samples):
    rng = np.random.default_rng(samples)
    directions = unit_directions(300, samples, rng)
    directions[0] = (0.0, 0.0, 1.0)
    radial, tangential = rng.uniform(0.001, 0.1, (2, 300, samples))
    order = rng.permutation(300)
    flat, _ = flatten(directions, radial, tangential, order)
    x, y, z = directions[order].reshape(-1, 3).T
    run = np.maximum(np.hypot(x, y), 1e-9)
    with np.errstate(divide="ignore"):
        floor = np.where(z / run < -1e-7, HEIGHT_M / -(z / run), np.inf)
    right = FlatRays(x / run, y / run, z / run, floor, radial[order].ravel(), tangential[order].ravel())
    for got, plain in zip(flat, right, strict=True):
        np.testing.assert_array_equal(got, plain.astype(np.float32))
    assert np.isinf(flat.floor_m).any()


def test_the_spread_is_that_of_the_bearings():
    rng = np.random.default_rng(7)
    directions = unit_directions(200, 9, rng)
    directions = directions[np.hypot(*directions[:, 0, :2].T) > 0.2]
    sizes = np.ones(directions.shape[:2])
    bearing = np.arctan2(directions[..., 1], directions[..., 0])
    delta = np.remainder(bearing - bearing[:, :1] + math.pi, math.tau) - math.pi
    _, spread = flatten(directions, sizes, sizes, np.arange(len(directions)))
    assert spread == pytest.approx(np.abs(delta).max(), rel=1e-9)


def test_rays_about_the_zenith_may_have_any_bearing():
    directions = np.array([[[0.1, 0.0, 1.0], [-0.1, 0.0, 1.0]]])
    sizes = np.ones((1, 2))
    assert flatten(directions, sizes, sizes, np.arange(1))[1] == math.pi


def test_patches_are_those_of_numpy():
    rng = np.random.default_rng(3)
    directions, along_axis = unit_directions(200, 4, rng), rng.uniform(0.5, 1.0, (200, 4))
    radial, tangential = np.empty((2, 200, 4))
    pinhole_patches(HEIGHT_M, 800.0, along_axis, directions, radial, tangential)
    run = np.maximum(np.hypot(directions[..., 0], directions[..., 1]), 1e-9)
    with np.errstate(divide="ignore"):
        floor = np.where(directions[..., 2] < -1e-7, HEIGHT_M * run / -directions[..., 2], 1e3)
    ray_m = np.hypot(np.minimum(floor, 1e3), HEIGHT_M)
    angle = along_axis**2 / 800.0
    np.testing.assert_array_equal(radial, ray_m**2 / HEIGHT_M * angle)
    np.testing.assert_array_equal(tangential, ray_m * angle)
    assert ray_m.max() > 1e3 > 10 > ray_m.min()
