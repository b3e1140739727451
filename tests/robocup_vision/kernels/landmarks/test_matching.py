"""The compiled matching against one matrix product."""

import numpy as np
import pytest

from robocup_vision.kernels.landmarks.matching import Described, best_two


def described(rng, count):
    unit = rng.random((count, 128)).astype(np.float32) ** 8
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    return Described(unit, rng.uniform(0, 300, (count, 2)), rng.uniform(2, 6, count))


@pytest.mark.parametrize("seed", range(10))
def test_the_best_two_are_those_of_the_product(seed):
    rng = np.random.default_rng(seed)
    landmarks, features = described(rng, 40), described(rng, 150)
    gate_px, size_ratio = (60.0, 40.0), 1.6
    apart = np.abs(landmarks.pixels[:, None] - features.pixels[None])
    ratio = features.size_px[None] / landmarks.size_px[:, None]
    allowed = (apart <= gate_px).all(axis=2) & (ratio <= size_ratio) & (ratio >= 1 / size_ratio)
    product = np.where(allowed, landmarks.descriptors @ features.descriptors.T, -1)
    ordered = np.sort(product, axis=1)
    best, nearest, runner_up = best_two(landmarks, features, gate_px, size_ratio)
    np.testing.assert_allclose(nearest, ordered[:, -1], atol=1e-5)
    np.testing.assert_allclose(runner_up, ordered[:, -2], atol=1e-5)
    found = nearest > -1
    assert found.any()
    np.testing.assert_array_equal(best[found], product.argmax(axis=1)[found])
