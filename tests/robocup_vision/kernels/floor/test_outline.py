"""The joined steps of the floor's outline against the steps one by one, each of which has a plain twin."""

import math

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor.free_floor import passable
from robocup_vision.kernels.floor.outline import OutlineRules, outline_floor, read_floor
from robocup_vision.kernels.floor.polar import classify, outer_boundary
from robocup_vision.kernels.floor.radial_edges import EdgeSearch, Rays, radial_edges
from robocup_vision.kernels.floor.unrolled import unroll


def rules_of(rng, valid):
    """Return rules of a camera for samples (K, M)."""
    rows, columns = valid.shape
    angles = np.arange(rows) * math.tau / rows
    widest = rng.integers(1, 4, (2, columns), dtype=np.int32)
    return OutlineRules(
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


def empty_outline(rows, columns):
    return np.empty(rows, dtype=np.int64), np.empty(rows), np.empty((rows, columns), dtype=np.uint8)


def blurred_frame(rng):
    smooth = cv2.GaussianBlur(rng.integers(0, 256, (120, 130, 3), dtype=np.uint8), (0, 0), 2.0)
    return np.clip((smooth.astype(int) - 128) * 4 + 150, 0, 255).astype(np.uint8)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_one_call_does_what_the_steps_do(seed):
    rng = np.random.default_rng(seed)
    rows, columns = 24, 20
    frame = blurred_frame(rng)
    samples = rng.integers(60, 140, (rows, columns, 3), dtype=np.uint8)
    llr = np.where(np.arange(columns) < rng.integers(0, columns, (rows, 1)), 50, -40).astype(np.int8)
    llr[rng.random((rows, columns)) < 0.1] = 5
    valid = (rng.random((rows, columns)) < 0.98).astype(np.uint8)
    rules = rules_of(rng, valid)
    outermost, edge, marks = empty_outline(rows, columns)
    near = outline_floor(frame, samples, llr, rules, 20.0, outermost, edge, marks)
    assert near == llr[:, : columns // 3].sum(dtype=int)

    expected = empty_outline(rows, columns)
    outer_boundary(llr, valid, 48, 3, 80, expected[0])
    start = np.append(rules.radius_px, np.nan)[expected[0]]
    rays = Rays(64.5, 59.2, rules.step_u, rules.step_v, start)
    radial_edges(frame, rules.hidden, rays, EdgeSearch(37.0 / 19, 0.05, 20.0), expected[1])
    in_use = columns - 1
    passable(samples, llr, valid, rules.line_columns, rules.line_rows, in_use, True, expected[0], expected[2])
    assert (expected[0] >= 0).any()
    for found, one_by_one in zip((outermost, edge, marks), expected, strict=True):
        np.testing.assert_array_equal(found, one_by_one)


def test_a_frame_is_unrolled_and_looked_up_before():
    rng = np.random.default_rng(0)
    rows, columns, ring = 24, 20, 3
    frame, valid = blurred_frame(rng), (rng.random((rows, columns)) < 0.98).astype(np.uint8)
    rules = rules_of(rng, valid)
    places = 3 * rng.integers(0, 120 * 130, (rows, columns), dtype=np.int32)
    packing = np.stack([np.arange(256) // 32 << shift for shift in (6, 3, 0)]).astype(np.uint16)
    table = rng.integers(-60, 100, 512, dtype=np.int8)
    samples, llr = np.empty((rows, columns, 3), dtype=np.uint8), np.empty((rows, columns), dtype=np.int8)
    found = empty_outline(rows, columns)
    told = read_floor(frame, places, packing, table, ring, rules, 20.0, samples, llr, *found)

    expected_samples, expected_llr, expected = np.empty_like(samples), np.empty_like(llr), empty_outline(rows, columns)
    unroll(frame, places, expected_samples)
    mean = classify(expected_samples, packing, table, valid, ring, expected_llr)
    near = outline_floor(frame, expected_samples, expected_llr, rules, 20.0, *expected)
    assert told == (mean, near)
    for one, other in zip((samples, llr, *found), (expected_samples, expected_llr, *expected), strict=True):
        np.testing.assert_array_equal(one, other)
