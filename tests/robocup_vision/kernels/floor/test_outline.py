"""The joined steps of the floor's outline against the steps one by one, each of which has a plain twin."""

import math

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor.free_floor import passable
from robocup_vision.kernels.floor.outline import OutlineRules, outline_floor
from robocup_vision.kernels.floor.polar import EdgeSearch, Rays, outer_boundary, radial_edges


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_one_call_does_what_the_steps_do(seed):
    rng = np.random.default_rng(seed)
    rows, columns = 24, 20
    smooth = cv2.GaussianBlur(rng.integers(0, 256, (120, 130, 3), dtype=np.uint8), (0, 0), 2.0)
    frame = np.clip((smooth.astype(int) - 128) * 4 + 150, 0, 255).astype(np.uint8)
    samples = rng.integers(60, 140, (rows, columns, 3), dtype=np.uint8)
    llr = np.where(np.arange(columns) < rng.integers(0, columns, (rows, 1)), 50, -40).astype(np.int8)
    llr[rng.random((rows, columns)) < 0.1] = 5
    valid = (rng.random((rows, columns)) < 0.98).astype(np.uint8)
    angles = np.arange(rows) * math.tau / rows
    widest = rng.integers(1, 4, (2, columns), dtype=np.int32)
    rules = OutlineRules(
        valid=valid,
        hidden=(rng.random((120, 130)) < 0.005).astype(np.uint8),
        center_u=64.5,
        center_v=59.2,
        step_u=np.cos(angles),
        step_v=np.sin(angles),
        radius_px=np.linspace(8.0, 45.0, columns),
        column_step_px=37.0 / 19,
        half_width=0.05,
        certain=48,
        gap=3,
        min_strip=80,
        line_columns=widest[0],
        line_rows=np.sort(widest[1])[::-1].copy(),
        columns_in_use=columns - 1,
    )
    outermost, edge, marks = np.empty(rows, dtype=np.int64), np.empty(rows), np.empty((rows, columns), dtype=np.uint8)
    near = outline_floor(frame, samples, llr, rules, 20.0, outermost, edge, marks)
    assert near == llr[:, : columns // 3].sum(dtype=int)

    expected = np.empty(rows, dtype=np.int64), np.empty(rows), np.empty((rows, columns), dtype=np.uint8)
    outer_boundary(llr, valid, 48, 3, 80, expected[0])
    start = np.append(rules.radius_px, np.nan)[expected[0]]
    rays = Rays(64.5, 59.2, rules.step_u, rules.step_v, start)
    radial_edges(frame, rules.hidden, rays, EdgeSearch(37.0 / 19, 0.05, 20.0), expected[1])
    in_use = columns - 1
    passable(samples, llr, valid, rules.line_columns, rules.line_rows, in_use, True, expected[0], expected[2])
    assert (expected[0] >= 0).any()
    for found, one_by_one in zip((outermost, edge, marks), expected, strict=True):
        np.testing.assert_array_equal(found, one_by_one)
