"""Upright things about a blob, against plain NumPy."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.balls.blobs import FloorTable
from robocup_vision.kernels.balls.upright import count_upright

WIDTH, HEIGHT = 80, 60


def plain_count(frame, middle, halves, up, table, min_step, spreads):
    aside = np.array([up[1], -up[0]])
    beside = 1.35 * halves[1] + 2.0
    offsets = np.array([-0.5 * halves[1], 0.0, 0.5 * halves[1], -beside, beside])[:, None] * aside
    found = 0
    for way in (1.0, -1.0):
        pixels = np.rint(np.array(middle) + way * (1.35 * halves[0] + 2.0) * np.array(up) + offsets).astype(int)
        if (pixels < 1).any() or (pixels > (WIDTH - 2, HEIGHT - 2)).any():
            continue
        colors = np.array([frame[v - 1 : v + 2, u - 1 : u + 2].reshape(-1, 3).mean(axis=0) for u, v in pixels])
        inner, outer = colors[:3], colors[3:]
        packed = sum(table.packing[c, np.rint(inner[:, c]).astype(int)].astype(int) for c in range(3))
        if (table.floor_llr[packed] > 0).any():
            continue
        spread, apart = (np.abs(some - inner.mean(axis=0)).max(axis=1) for some in (inner, outer))
        found += apart.min() > min_step + spreads * spread.max()
    return found


@settings(deadline=None, max_examples=100)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.floats(0.0, WIDTH), st.floats(0.0, HEIGHT)),
    st.tuples(st.floats(2.0, 12.0), st.floats(2.0, 12.0)),
    st.floats(-0.6, 0.6),
    st.sampled_from([0.0, 0.3]),
)
def test_upright_things_are_counted_as_plainly_defined(seed, middle, halves, tilt, floor_ratio):
    rng = np.random.default_rng(seed)
    # blocks of one colour with little noise in them
    frame = rng.integers(0, 236, (HEIGHT // 10, WIDTH // 10, 3)).repeat(10, axis=0).repeat(10, axis=1)
    frame = (frame + rng.integers(0, 20, frame.shape)).astype(np.uint8)
    packing = np.stack([np.arange(256) >> 5 << 6, np.arange(256) >> 5 << 3, np.arange(256) >> 5]).astype(np.uint16)
    table = FloorTable(packing, np.where(rng.random(512) < floor_ratio, 1, -1).astype(np.int8))
    up = math.sin(tilt), -math.cos(tilt)
    found = count_upright(frame, middle, halves, up, table, 15.0, 2.0)
    assert found == plain_count(frame, middle, halves, up, table, 15.0, 2.0)


def test_a_band_above_and_below_counts_and_carpet_around_does_not():
    carpet, packing = (50, 130, 45), np.zeros((3, 256), dtype=np.uint16)
    packing[1] = np.arange(256)
    table = FloorTable(packing, np.where(np.arange(256) == carpet[1], 1, -1).astype(np.int8))
    frame = np.full((HEIGHT, WIDTH, 3), carpet, dtype=np.uint8)
    blob = (40.0, 30.0), (6.0, 6.0), (0.0, -1.0)
    assert count_upright(frame, *blob, table, 15.0, 2.0) == 0
    frame[:30, 34:47] = 200, 60, 40
    assert count_upright(frame, *blob, table, 15.0, 2.0) == 1
    frame[30:, 34:47] = 60, 200, 220
    assert count_upright(frame, *blob, table, 15.0, 2.0) == 2
