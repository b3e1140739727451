"""The compiled search for the ball against a plain one: connected components, moments and looks around, in NumPy."""

import math

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor import ball as kernel

WIDTH, HEIGHT = 96, 80
AXIS = (47.3, 39.6)
FLOOR_BGR, BALL_BGR, WHITE_BGR = (50, 130, 45), (30, 90, 220), (225, 230, 225)
# R, then G, then B in steps of 8, 4 and 8 counts, as the colour table packs them
PACKING = np.stack([np.arange(256) // 8 * 2048, np.arange(256) // 4 * 32, np.arange(256) // 8]).astype(np.uint16)


def plane(color, other):
    a, b = (np.array(c, dtype=np.float64) / np.linalg.norm(c) for c in (color, other))
    middle = (a + b) / 2
    normal = a - (a @ middle) / (middle @ middle) * middle
    return normal / np.linalg.norm(normal)


COLOR = kernel.BallColor(plane(BALL_BGR, WHITE_BGR), plane(BALL_BGR, FLOOR_BGR), 90.0, 40.0, 12.0)
RADIUS = np.arange(70.0)
SIZES = np.where((RADIUS > 12) & (RADIUS < 60), 7.0 - RADIUS / 15, 0.0)
SIZE = kernel.BallSize(*AXIS, 12.0, SIZES, 0.8 * SIZES)


def floor_table():
    """Log-likelihood ratios that call greenish colours floor."""
    blue, green, red = np.meshgrid(np.arange(32) * 8, np.arange(64) * 4, np.arange(32) * 8, indexing="ij")
    llr = np.where((green > 1.3 * red) & (green > 1.3 * blue) & (green > 40), 20, -20).astype(np.int8)
    return kernel.FloorTable(PACKING, llr.ravel())


TABLE = floor_table()


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
        cv2.ellipse(frame, center, axes, math.degrees(angle), 0, 360, BALL_BGR, -1)
    noisy = cv2.GaussianBlur(frame, (3, 3), 0.6) + rng.normal(0, 4, frame.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def plain_find(frame, hidden):
    """Best score and where; every pixel is a seed, in the order of memory."""
    wide = frame.astype(np.float64)
    hue = (wide @ COLOR.from_floor > 0) & (wide @ COLOR.from_white > 0)
    like_ball = (hue & (wide.sum(axis=2) >= COLOR.min_level) & ~hidden).astype(np.uint8)
    count, labels = cv2.connectedComponents(like_ball, connectivity=4)
    best, where = 0.0, None
    for blob in range(1, count):
        v, u = np.nonzero(labels == blob)
        found = plain_score(frame, wide, u, v)
        if found is not None and found[0] > best:
            best, where = found
    return best, where


def plain_score(frame, wide, u, v):
    # the first pixel, in the order of memory, at which a ball may lie
    at_pixels = (np.hypot(u - AXIS[0], v - AXIS[1]) + 0.5).astype(int)
    at_seed = next((at for at in at_pixels if at < len(SIZES) and SIZES[at] > 0), None)
    if at_seed is None:
        return None
    a, t = SIZE.along_px[at_seed], SIZE.across_px[at_seed]
    if len(u) > 3 * math.pi * (a + 1) * (t + 1):
        return None
    value = wide[v, u] @ COLOR.from_floor
    if value.sum() < COLOR.min_signal * math.sqrt(len(u)):
        return None
    weight = np.minimum(1.0, value / COLOR.sure)
    center = np.array([np.average(u, weights=weight), np.average(v, weights=weight)])
    ray = center - AXIS
    radius = float(np.hypot(*ray))
    index = int(radius + 0.5)
    if index >= len(SIZES) or SIZES[index] <= 0:
        return None
    a, t = SIZE.along_px[index], SIZE.across_px[index]
    if len(u) < max(2.0, kernel.MIN_AREA_RATIO * math.pi * (a + 0.25) * (t + 0.25)):
        return None
    if len(u) > kernel.MAX_AREA_RATIO * math.pi * (a + 0.75) * (t + 0.75):
        return None
    ray /= radius
    aside = np.array([-ray[1], ray[0]])
    off = np.stack([u, v], axis=1) - center
    spread = (weight[:, None] * off).T @ off / weight.sum() + np.eye(2) / 12
    along, across = 2 * math.sqrt(ray @ spread @ ray), 2 * math.sqrt(aside @ (spread - np.eye(2) / 12) @ aside + 1 / 12)
    for half, expected in ((along, a), (across, t)):
        if not kernel.MIN_SIZE_RATIO * expected - 0.5 <= half <= kernel.MAX_SIZE_RATIO * expected + 1.0:
            return None
    floor, like, asked, wanted = 0, 0, 0, 9
    for k in range(16):
        angle = (8 + ((k + 1) // 2 if k % 2 else -(k // 2))) * math.pi / 8
        place = center + (1.35 * a + 2) * math.cos(angle) * ray + (1.35 * t + 2) * math.sin(angle) * aside
        pu, pv = (int(x + 0.5) for x in place)
        if not (1 <= pu < WIDTH - 1 and 1 <= pv < HEIGHT - 1):
            continue
        if math.hypot(pu - AXIS[0], pv - AXIS[1]) < SIZE.body_px + 2:
            wanted -= 1
            continue
        asked += 1
        mean = frame[pv - 1 : pv + 2, pu - 1 : pu + 2].reshape(-1, 3).sum(axis=0, dtype=int) // 9
        if mean @ COLOR.from_floor > 0 and mean @ COLOR.from_white > 0:
            like += mean.sum() >= COLOR.min_level
        elif asked <= wanted and TABLE.floor_llr[sum(int(PACKING[c, mean[c]]) for c in range(3))] > 0:
            floor += 1
    return (floor / wanted - like / 8, (*center, (along / a + across / t) / 2, floor / wanted)) if wanted else None


@settings(deadline=None, max_examples=80)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_the_ball_is_the_one_that_a_plain_search_finds(seed, masked):
    frame = scene(seed)
    hidden = np.zeros((HEIGHT, WIDTH), dtype=bool)
    if masked:
        hidden[:, : WIDTH // 3] = True
    stamps = np.where(hidden, kernel.NEVER, 0).astype(np.int32)
    scratch = kernel.Scratch(stamps, np.empty(WIDTH * HEIGHT, dtype=np.int32))
    seeds = np.stack(np.nonzero(~hidden), axis=1).astype(np.int32)
    out = np.full(4, np.nan)
    score, last = kernel.find_ball(frame, seeds, scratch, 1, COLOR, SIZE, TABLE, out)
    expected, where = plain_find(frame, hidden)
    assert abs(score - expected) < 1e-12
    if where is not None:
        np.testing.assert_allclose(out, where, rtol=1e-9)
    # stamps of one frame do not hide anything from the next
    again, _ = kernel.find_ball(frame, seeds, scratch, last + 1, COLOR, SIZE, TABLE, out)
    assert again == score
