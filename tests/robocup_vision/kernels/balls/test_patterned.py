"""The compiled search for patterned balls against plain loops over the same definitions."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.balls import patterned as kernel

HEIGHT, WIDTH = 48, 64
TURNS = np.arange(kernel.DIRECTIONS) * math.tau / kernel.DIRECTIONS
DIRECTIONS = np.column_stack([np.cos(TURNS), np.sin(TURNS)])
LOGS = np.log(np.arange(256) + 8.0)
ANY = np.tile((0.0, np.inf), (HEIGHT, 1))
SEARCH = kernel.DiscSearch(0.82, 1.12, 1.5, 0.25, 0.8, 0.5, 0.7, 0.55, 0.04)


def blobs(rng, count=3):
    """Kinds and levels of a picture of discs on carpet."""
    kinds, level = np.zeros((HEIGHT, WIDTH), np.uint8), np.full((HEIGHT, WIDTH), 110, np.uint8)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    for _ in range(count):
        radius = rng.uniform(5, 10)
        inside = np.hypot(u - rng.uniform(0, WIDTH), v - rng.uniform(0, HEIGHT)) < radius
        kinds[inside], level[inside] = kernel.NEUTRAL, rng.choice([20, 200], inside.sum(), p=[0.3, 0.7])
    return kinds, level


def is_in(x, y):
    return 0 <= x < WIDTH and 0 <= y < HEIGHT


def plain_disc(kinds, u, v, radius):
    agree = shown = inside = count = 0
    for c, s in DIRECTIONS:

        def place(reach, c=c, s=s):
            return int(u + reach * c + 0.5), int(v + reach * s + 0.5)

        rim, half, far = (
            place(SEARCH.inner * radius),
            place(0.5 * radius),
            place(SEARCH.outer * radius + SEARCH.beyond_px),
        )
        if not is_in(*rim):
            continue
        if s > 0.5 and kinds[rim[1], rim[0]] == kernel.CARPET:
            continue
        is_ball = kinds[rim[1], rim[0]] == kernel.NEUTRAL
        shows = [is_ball] + ([kinds[half[1], half[0]] == kernel.NEUTRAL] if is_in(*half) else [])
        inside, count = inside + sum(shows), count + len(shows)
        if is_in(*far):
            shown += 1
            agree += is_ball and kinds[far[1], far[0]] == kernel.CARPET
    return agree, shown, inside / max(count, 1)


def plain_patches(kinds, level, u, v, radius, max_dark):
    inside = []
    middle_u, middle_v, reach = int(u + 0.5), int(v + 0.5), int(0.85 * radius + 0.5)
    for y in range(HEIGHT):
        if abs(y - middle_v) > reach:
            continue
        half = int(math.sqrt(max(0.7225 * radius**2 - (y - middle_v) ** 2, 0.0)) + 0.5)
        inside += [(y, x) for x in range(WIDTH) if abs(x - middle_u) <= half]
    levels = sorted((int(level[p]) for p in inside if kinds[p] == kernel.NEUTRAL), reverse=True)
    if not levels:
        return 0.0, 0.0
    upper = [one for one in levels if one >= levels[(len(levels) + 1) // 2 - 1]]
    white = sum(upper) / len(upper)
    return white, sum(one < max_dark * white for one in levels) / len(inside)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(-0.4, 0.0), st.floats(0.05, 0.4), st.floats(0, 150))
def test_pixels_are_told_apart(seed, max_hue, min_green, min_level):
    frame = np.random.default_rng(seed).integers(0, 256, (10, 9, 3)).astype(np.uint8)
    kinds, levels = np.zeros((2, 10, 9), np.uint8)
    kernel.classify(frame, 2, max_hue, min_green, min_level, levels, kinds)
    assert (kinds[:2] == kernel.COLORED).all()
    np.testing.assert_array_equal(levels[2:], frame[2:, :, 1])
    frame, kinds = frame[2:], kinds[2:]
    logs, near = LOGS[frame], frame.astype(float)
    red, blue = logs[..., 2] - logs[..., 1], logs[..., 0] - logs[..., 1]
    total = near.sum(axis=-1)
    carpet = (red + kernel.BLUE_WEIGHT * blue < max_hue) & (3 * near[..., 1] - total > min_green * (total + 30))
    carpet &= near[..., 1] >= min_level
    colored = ~carpet & ((red > 0.6) | (blue > 0.4))
    np.testing.assert_array_equal(
        kinds, np.where(carpet, kernel.CARPET, np.where(colored, kernel.COLORED, kernel.NEUTRAL))
    )


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(0, WIDTH), st.floats(0, HEIGHT), st.floats(4, 12))
def test_a_disc_is_measured_as_plainly_defined(seed, u, v, radius):
    kinds, level = blobs(np.random.default_rng(seed))
    agree, shown, inside = kernel.measure_disc(kinds, DIRECTIONS, u, v, radius, SEARCH)
    assert (agree, shown) == plain_disc(kinds, u, v, radius)[:2]
    assert inside == pytest.approx(plain_disc(kinds, u, v, radius)[2])
    measured = kernel.measure_patches(kinds, level, u, v, radius, SEARCH.max_dark)
    np.testing.assert_allclose(measured, plain_patches(kinds, level, u, v, radius, SEARCH.max_dark))


@pytest.mark.parametrize("seed", range(3))
def test_discs_that_are_found_pass_the_plain_measure_and_each_place_that_passes_clearly_is_found(seed):
    kinds, _ = blobs(np.random.default_rng(seed))
    radii = np.array([6.0, 8.0])
    out = np.empty((5000, kernel.COLUMNS))
    found = {(x[0], x[1], x[2]) for x in out[: kernel.find_discs(kinds, DIRECTIONS, radii, ANY, SEARCH, out)]}
    assert found
    for radius in radii:
        step = int(SEARCH.steps * radius + 0.5)
        for v in range(0, HEIGHT, step):
            for u in range(0, WIDTH, step):
                agree, shown, inside = plain_disc(kinds, u, v, radius)
                if (u, v, radius) in found:
                    assert shown >= 12
                    assert agree >= SEARCH.min_agree * shown
                    assert inside >= SEARCH.min_inside
                elif shown == kernel.DIRECTIONS:
                    # the first look passes whatever is a ball all around
                    assert agree < 0.95 * shown or inside < 1.0


def ball(kinds, level, u0, v0, radius):
    """Lay a ball with one dark patch over a picture."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    inside = np.hypot(u - u0, v - v0) < radius
    kinds[inside], level[inside] = kernel.NEUTRAL, 200
    level[inside & (np.hypot(u - u0 + 2, v - v0 + 2) < 0.45 * radius)] = 20


def test_a_ball_whose_underside_is_as_green_as_the_carpet_keeps_its_place_and_size():
    kinds, level = np.zeros((HEIGHT, WIDTH), np.uint8), np.full((HEIGHT, WIDTH), 110, np.uint8)
    ball(kinds, level, 30, 22, 9)
    kinds[22 + 6 :] = kernel.CARPET
    found, out = np.empty((5000, kernel.COLUMNS)), np.empty((10, kernel.COLUMNS))
    count = kernel.find_discs(kinds, DIRECTIONS, np.array([6.0, 7.2, 8.6, 10.4]), ANY, SEARCH, found)
    assert kernel.best_discs(kinds, level, DIRECTIONS, SEARCH, found[:count], out) >= 1
    row = out[0]
    assert math.hypot(row[kernel.U] - 30, row[kernel.V] - 22) < 2
    assert row[kernel.RADIUS] == pytest.approx(9, rel=0.15)
    assert row[kernel.AGREE] == 1.0
    assert 0.6 < row[kernel.SHOWN] < 1.0


def test_a_disc_of_another_size_is_kept_beside_a_better_one_at_its_place():
    """A ball and the line it touches look like a larger ball."""
    kinds, level = np.zeros((HEIGHT, WIDTH), np.uint8), np.full((HEIGHT, WIDTH), 110, np.uint8)
    kinds[11:15], level[11:15] = kernel.NEUTRAL, 220
    ball(kinds, level, 30, 22, 7)
    found, out = np.zeros((3, kernel.COLUMNS)), np.empty((10, kernel.COLUMNS))
    found[:, kernel.U], found[:, kernel.V], found[:, kernel.RADIUS] = 30, (19, 22, 22), (10.5, 7.0, 7.8)
    found[:, kernel.AGREE], found[:, kernel.INSIDE] = (0.95, 0.9, 0.85), 1.0
    kept = out[: kernel.best_discs(kinds, level, DIRECTIONS, SEARCH, found, out)]
    assert len(kept) == 2
    assert math.hypot(kept[1, kernel.U] - 30, kept[1, kernel.V] - 22) < 2
    assert kept[1, kernel.RADIUS] == pytest.approx(7, rel=0.15)


def test_of_discs_on_one_ball_one_is_kept_that_lies_on_it():
    kinds, level = np.zeros((HEIGHT, WIDTH), np.uint8), np.full((HEIGHT, WIDTH), 110, np.uint8)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    inside = np.hypot(u - 30, v - 22) < 9
    kinds[inside], level[inside] = kernel.NEUTRAL, 200
    level[inside & (np.hypot(u - 28, v - 20) < 4)] = 20
    found, out = np.empty((5000, kernel.COLUMNS)), np.empty((10, kernel.COLUMNS))
    count = kernel.find_discs(kinds, DIRECTIONS, np.array([6.0, 7.2, 8.6, 10.4]), ANY, SEARCH, found)
    assert count > 5
    assert kernel.best_discs(kinds, level, DIRECTIONS, SEARCH, found[:count], out) == 1
    row = out[0]
    assert math.hypot(row[kernel.U] - 30, row[kernel.V] - 22) < 2
    assert row[kernel.RADIUS] == pytest.approx(9, rel=0.15)
    assert row[kernel.WHITE] == 200
    assert row[kernel.CARPET_LEVEL] == 110
    assert row[kernel.AROUND] > 0.95
    assert row[kernel.AGREE] == 1.0
    # without a dark patch it is none
    level[inside] = 200
    assert kernel.best_discs(kinds, level, DIRECTIONS, SEARCH, found[:count], out) == 0
