"""Bright bands between carpets: where they lie and how wide they are, whatever a line's width should be."""

import numpy as np
import pytest

from robocup_vision.kernels.model_edges.bands import FLANK, line_bands
from robocup_vision.kernels.model_edges.carpet import carpet_mask

CARPET = np.array([45.0, 125.0, 42.0, 1.0, 0.8])
GLARE = np.array([135.0, 187.0, 142.0])
LIT = np.array([*CARPET, *GLARE])
STEP, WIDEST, STRIDE = 60.0, 30, 8


def found(image, carpet=CARPET, widest=WIDEST):
    bands = np.zeros((400, 4))
    return bands[: line_bands(image, carpet, STEP, widest, STRIDE, bands)]


def lawn(height=96, width=128):
    return np.tile(CARPET[:3], (height, width, 1))


def plain_profile(light, is_floor, min_step, widest):
    """Return middle and width of each band of one row; `is_floor` tells of each place whether carpet surrounds it."""
    bands, i, length = [], FLANK, len(light)
    while i < length - FLANK - 1:
        ground = (light[i - 3] + light[i - 2]) / 2
        if light[i] - ground < min_step:
            i += 1
            continue
        k, top = i, 0.0
        while k < length - 1 and k - i <= widest and light[k] > (ground + max(top, light[i])) / 2:
            top, k = max(top, light[k]), k + 1
        half = (ground + top) / 2
        if k >= length - 1 or light[k] > half:
            i += 1
            continue
        end = k - (half - light[k]) / max(light[k - 1] - light[k], 1.0)
        first = next(j for j in range(i - 1, k + 1) if j == k or light[j] >= half)
        begin = first - (light[first] - half) / max(light[first] - light[first - 1], 1.0)
        left, right, middle = int(begin) - FLANK, int(end) + FLANK, int((begin + end) / 2 + 0.5)
        if left >= 1 and right + 1 < length and is_floor[left] and is_floor[right] and not is_floor[middle]:
            bands.append(((begin + end) / 2, end - begin))
        i = int(end) + 2
    return bands


def plain_bands(image, carpet):
    """Do the same by whole arrays: rows of the picture, then of its transpose."""
    rows = []
    for by_row in (False, True):
        picture = image if by_row else image.swapaxes(0, 1)
        floor = np.zeros(picture.shape[:2], dtype=bool)
        blocks = np.lib.stride_tricks.sliding_window_view(picture, (3, 3), axis=(0, 1)).mean(axis=(-1, -2))
        held = carpet.copy()
        held[3] /= 3.0  # the noise of a mean of nine
        floor[1:-1, 1:-1] = carpet_mask(blocks, held)
        light = picture[..., 0].astype(float) + picture[..., 2]
        for at in range(STRIDE // 2, len(picture) - 1, STRIDE):
            for middle, width in plain_profile(light[at], floor[at], STEP, WIDEST):
                rows.append((middle, at, 1.0, width) if by_row else (at, middle, 0.0, width))
    return np.array(rows).reshape(-1, 4)


@pytest.mark.parametrize("carpet", [CARPET, LIT])
@pytest.mark.parametrize("seed", range(3))
def test_bands_are_those_of_plain_code(seed, carpet):
    rng = np.random.default_rng(seed)
    image = lawn()
    image[:, 70:] = GLARE
    for _ in range(24):
        u, v, wide, high = *rng.integers(0, (128, 96)), *rng.integers(2, 22, 2)
        image[v : v + high, u : u + wide] = 235.0 if rng.random() < 0.8 else 100.0
    image = np.clip(image + rng.normal(0.0, 1.0, image.shape), 0, 255).astype(np.uint8)
    expected = plain_bands(image, carpet)
    assert len(expected) > 10
    np.testing.assert_allclose(found(image, carpet), expected, atol=1e-9)


@pytest.mark.parametrize("width", [4.0, 5.5, 17.0])
def test_a_blurred_stripe_is_as_wide_as_it_was_painted(width):
    across = np.clip((width / 2 + 1.5 - np.abs(np.arange(128) - 60.3)) / 3.0, 0.0, 1.0)[None, :, None]
    image = (lawn() + across * (235.0 - lawn())).astype(np.uint8)
    bands = found(image)
    assert len(bands) == 96 // STRIDE
    np.testing.assert_allclose(bands[:, 0], 60.3, atol=0.3)
    np.testing.assert_allclose(bands[:, 3], width, atol=0.6)


def test_what_has_no_carpet_on_one_side_and_what_is_too_wide_are_no_bands():
    beside_a_wall = lawn()
    beside_a_wall[:, 60:66], beside_a_wall[:, 66:] = 235.0, 90.0
    assert not len(found(beside_a_wall.astype(np.uint8)))
    stripe = lawn()
    stripe[:, 50:70] = 235.0
    assert len(found(stripe.astype(np.uint8)))
    assert not len(found(stripe.astype(np.uint8), widest=15))


def test_a_sunny_patch_of_carpet_is_no_band():
    image = lawn()
    image[:, 50:60] = GLARE
    assert not len(found(image.astype(np.uint8), LIT))
    image[:, 50:60] = 235.0
    assert len(found(image.astype(np.uint8), LIT))
