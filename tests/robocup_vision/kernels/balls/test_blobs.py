"""The compiled search for balls against a plain one: connected components, moments and looks around, in NumPy."""

import math

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.balls import blobs as kernel

WIDTH, HEIGHT = 96, 80
AXIS = (47.3, 39.6)
FLOOR_BGR, BALL_BGR, WHITE_BGR = (50, 130, 45), (30, 90, 220), (225, 230, 225)


def plane(color, other, ratio=0.5):
    a, b = (np.array(c, dtype=np.float64) / np.linalg.norm(c) for c in (color, other))
    within = b + ratio * (a - b)
    normal = a - (a @ within) / (within @ within) * within
    return tuple((normal / np.linalg.norm(normal)).tolist())


COLOR = kernel.BallColor(
    from_white=plane(BALL_BGR, WHITE_BGR, 0.3),
    from_floor=plane(BALL_BGR, FLOOR_BGR),
    half_white=plane(BALL_BGR, WHITE_BGR),
    plane_ratio=0.3,
    apart_rad=0.7,
    min_hue=3.0,
    weak=0,
    middle=1,
    clipped_ratio=0.8,
    min_level=90.0,
    sure=40.0,
    min_signal=12.0,
)
RADIUS = np.arange(70.0)
SIZES = np.where((RADIUS > 12) & (RADIUS < 60), 7.0 - RADIUS / 15, 0.0)
SIZE = kernel.BallSize(*AXIS, 12.0, SIZES, 0.8 * SIZES, np.full(len(SIZES), 0.3), 0.2)


def scene(seed):
    rng = np.random.default_rng(seed)
    frame = np.full((HEIGHT, WIDTH, 3), FLOOR_BGR, dtype=np.uint8)
    for _ in range(rng.integers(0, 4)):
        u, v = (int(x) for x in rng.uniform((0, 0), (WIDTH, HEIGHT)))
        color = WHITE_BGR if rng.random() < 0.5 else (60, 40, 40)
        cv2.rectangle(frame, (u, v), (u + int(rng.integers(2, 20)), v + int(rng.integers(2, 20))), color, -1)
    for _ in range(rng.integers(1, 5)):
        angle, radius = rng.uniform(0, math.tau), rng.uniform(8, 50)
        center = (round(AXIS[0] + radius * math.cos(angle)), round(AXIS[1] + radius * math.sin(angle)))
        half = float(SIZES[round(radius)]) * rng.choice([0.4, 1.0, 1.0, 1.0, 2.0])
        axes = (max(round(half), 1), max(round(0.8 * half), 1))
        color = (140, 253, 255) if rng.random() < 0.2 else BALL_BGR
        cv2.ellipse(frame, center, axes, math.degrees(angle), 0, 360, color, -1)
    noisy = cv2.GaussianBlur(frame, (3, 3), 0.6) + rng.normal(0, 4, frame.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def burnt_out(colors):
    wide = np.asarray(colors, dtype=np.float64)
    return (wide.max(axis=-1) >= kernel.CLIPPED) & (wide[..., 0] < 0.8 * wide[..., 1])


def of_hue(colors):
    wide = np.asarray(colors, dtype=np.float64)
    return (wide @ COLOR.from_floor > 0) & (wide @ COLOR.from_white > COLOR.min_hue) | burnt_out(colors)


@given(st.tuples(*[st.integers(0, 255)] * 3))
def test_a_pixel_has_the_hue_on_one_side_of_both_planes_or_where_it_is_burnt_out(color):
    assert kernel.has_hue(COLOR, *color) == of_hue(color)


def plain_blobs(frame, hidden):
    """Rows of what may be balls; every pixel is a seed."""
    wide = frame.astype(np.float64)
    like_ball = (of_hue(frame) & (wide.sum(axis=2) >= COLOR.min_level) & ~hidden).astype(np.uint8)
    count, labels = cv2.connectedComponents(like_ball, connectivity=4)
    rows = []
    for blob in range(1, count):
        v, u = np.nonzero(labels == blob)
        row = plain_row(frame, u, v)
        if row is not None:
            rows.append(row)
    return np.array(rows).reshape(-1, kernel.COLUMNS)


def plain_row(frame, u, v):
    # the first pixel, in the order of memory, at which a ball may lie
    at_pixels = (np.hypot(u - AXIS[0], v - AXIS[1]) + 0.5).astype(int)
    at_seed = next((at for at in at_pixels if at < len(SIZES) and SIZES[at] > 0), None)
    if at_seed is None or len(u) < 3:
        return None
    a, t = SIZE.along_px[at_seed], SIZE.across_px[at_seed]
    if len(u) > 2.2 * math.exp(0.6) * math.pi * (a + 1) * (t + 1):
        return None
    colors = frame[v, u].astype(np.float64)
    value = np.where(burnt_out(colors), np.maximum(colors @ COLOR.from_floor, COLOR.sure), colors @ COLOR.from_floor)
    if value.sum() < COLOR.min_signal * math.sqrt(len(u)):
        return None
    weight = np.minimum(1.0, value / COLOR.sure)
    unmixed = burnt_out(colors) | (colors @ COLOR.half_white > 0)
    if weight[unmixed].sum() >= 0.5 * weight.sum():
        weight = np.where(unmixed, weight, 0.0)
    center = np.array([np.average(u, weights=weight), np.average(v, weights=weight)])
    ray = center - AXIS
    radius = float(np.hypot(*ray))
    index = int(radius + 0.5)
    if index >= len(SIZES) or SIZES[index] <= 0:
        return None
    a, t = SIZE.along_px[index], SIZE.across_px[index]
    if len(u) < 0.15 * math.exp(-0.6) * math.pi * (a + 0.25) * (t + 0.25):
        return None
    ray /= radius
    aside = np.array([-ray[1], ray[0]])
    off = np.stack([u, v], axis=1) - center
    spread = (weight[:, None] * off).T @ off / weight.sum()
    along, across = (2 * math.sqrt(way @ spread @ way + 1 / 12) for way in (ray, aside))
    cut = u.min() == 0 or v.min() == 0 or u.max() == WIDTH - 1 or v.max() == HEIGHT - 1
    return [*center, along, across, weight.sum(), float(cut)]


def found_blobs(frame, hidden, rows=64):
    stamps = np.where(hidden, kernel.NEVER, 0).astype(np.int32)
    scratch = kernel.Scratch(stamps, np.empty(WIDTH * HEIGHT, dtype=np.int32), np.empty((2, 6)))
    seeds = np.stack(np.nonzero(~hidden), axis=1).astype(np.int32)
    out = np.full((rows, kernel.COLUMNS), np.nan)
    count, last = kernel.find_blobs(frame, seeds, scratch, 1, COLOR, SIZE, out)
    # stamps of one frame do not hide anything from the next
    again, _ = kernel.find_blobs(frame, seeds, scratch, last + 1, COLOR, SIZE, np.empty_like(out))
    assert again == count
    return out[:count]


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_the_blobs_are_those_that_a_plain_search_finds(seed, masked):
    frame = scene(seed)
    hidden = np.zeros((HEIGHT, WIDTH), dtype=bool)
    if masked:
        hidden[:, : WIDTH // 3] = True
    expected = plain_blobs(frame, hidden)
    found = found_blobs(frame, hidden)
    assert len(found) == len(expected)
    by_place = (np.lexsort(rows.T[:2]) for rows in (found, expected))
    np.testing.assert_allclose(
        *(rows[order] for rows, order in zip((found, expected), by_place, strict=True)), rtol=1e-7, atol=1e-6
    )
    assert len(found_blobs(frame, hidden, rows=1)) == min(1, len(expected))
