"""Compiled strips, feet and means along a bar against plain NumPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.goal.paint.strips import (
    Runs,
    StripLimits,
    fit_strip,
    foot_row,
    mean_along,
    straight_line,
    summarize_chains,
)

SEEDS = st.integers(0, 2**32 - 1)


def some_runs(rng, count=20):
    row = np.sort(rng.choice(60, count, replace=False)).astype(float)
    left = 30 + 0.05 * row + rng.normal(0, 0.1, count)
    return row, left, left + 6 + rng.normal(0, 0.1, count), rng.uniform(1, 40, count)


@settings(deadline=None, max_examples=30)
@given(SEEDS)
def test_a_line_is_the_least_squares_line_of_what_is_kept(seed):
    rng = np.random.default_rng(seed)
    row, left, *_ = some_runs(rng)
    keep = rng.random(len(row)) < 0.7
    keep[:3] = True
    slope, at = straight_line(row, left, keep)
    assert (slope, at) == pytest.approx(tuple(np.polyfit(row[keep], left[keep], 1)), abs=1e-8)


def plain_foot(line, bottom, carpet):
    """`foot_row`, row by row."""
    width = max(3.0, line[2] + line[3] * bottom - line[0] - line[1] * bottom)
    first = max(0, int(bottom - 1.5 * width))
    rows = np.arange(first, min(len(carpet) - 1, int(bottom + 0.5 * width) + 8) + 1)
    if len(rows) < 4:
        return np.nan
    left, right = line[0] + line[1] * rows, line[2] + line[3] * rows
    columns = left[:, None] + (right - left)[:, None] * np.linspace(0.15, 0.85, 7)
    inside = (columns >= 0) & (columns <= carpet.shape[1] - 1)
    at = np.clip(np.rint(columns), 0, carpet.shape[1] - 1).astype(int)
    green = ((carpet[rows[:, None], at] > 0) & inside).mean(axis=1)
    wrong = [green[:k].sum() + (1 - green[k:]).sum() for k in range(len(rows) + 1)]
    split = int(np.argmin(np.round(wrong, 6)))
    below = green[split : split + 4]
    return rows[split] - 0.5 if len(below) >= 3 and below.mean() >= 0.6 else np.nan


@settings(deadline=None, max_examples=60)
@given(SEEDS, st.floats(5, 75), st.integers(0, 80))
def test_a_foot_parts_paint_from_carpet(seed, bottom, carpet_from):
    rng = np.random.default_rng(seed)
    carpet = np.zeros((80, 100), np.uint8)
    carpet[carpet_from:] = 255
    carpet[rng.random(carpet.shape) < 0.1] ^= 255
    line = np.array([rng.uniform(-5, 95), 0.05, 0.0, 0.05])
    line[2] = line[0] + rng.uniform(2, 15)
    assert foot_row(line, bottom, carpet) == pytest.approx(plain_foot(line, bottom, carpet), nan_ok=True)


@settings(deadline=None, max_examples=20)
@given(SEEDS)
def test_a_strip_is_its_straight_edges(seed):
    rng = np.random.default_rng(seed)
    row, left, right, contrast = some_runs(rng)
    left[4] -= 8  # clutter touches it once
    carpet = np.full((80, 100), 255, np.uint8)
    carpet[: int(row[-1]) + 2] = 0
    strip = np.empty(8)
    members = np.arange(len(row))
    assert fit_strip(Runs(row, left, right, contrast), members, carpet, StripLimits(1.0, 0.27, 2.0), strip)
    good = members != 4
    for k, side in ((0, left), (2, right)):
        slope, at = np.polyfit(row[good], side[good], 1)
        assert strip[k : k + 2] == pytest.approx((at, slope), abs=0.15)
    assert tuple(strip[4:7]) == (row[0], row[-1], plain_foot(strip[:4], row[-1], carpet))
    assert strip[7] == pytest.approx(np.minimum(contrast, 20.0).sum())
    assert not fit_strip(
        Runs(row, left, right, contrast), members, carpet, StripLimits(20.0, 0.27, 2.0), strip
    )  # too short
    assert not fit_strip(
        Runs(row, left, right, contrast), members, carpet, StripLimits(1.0, 0.01, 2.0), strip
    )  # leans too much
    assert not fit_strip(
        Runs(row, left, right, contrast), members, carpet, StripLimits(1.0, 0.27, 9.0), strip
    )  # too thin
    scattered = left + rng.uniform(2, 9, len(row)) * rng.choice([-1, 1], len(row))
    assert not fit_strip(
        Runs(row, scattered, right + 20, contrast), members, carpet, StripLimits(0.1, 0.27, 2.0), strip
    )


@settings(deadline=None, max_examples=20)
@given(SEEDS)
def test_chains_are_summed_up(seed):
    rng = np.random.default_rng(seed)
    row, left, right, _ = some_runs(rng)
    order, bounds = np.concatenate([np.arange(0, 20, 2), np.arange(1, 20, 2)]), np.array([0, 10, 20])
    summary = np.empty((2, 6))
    summarize_chains(row, left, right, order, bounds, summary)
    for k, part in enumerate((order[:10], order[10:])):
        wide = (right - left)[part]
        middle = ((left + right) / 2)[part].mean()
        expected = (middle, row[part].mean(), np.median(wide), row[part[0]], row[part[-1]], wide[5])
        assert summary[k] == pytest.approx(expected)


@settings(deadline=None, max_examples=20)
@given(SEEDS)
def test_mean_along_a_bar_is_that_of_its_pixels(seed):
    rng = np.random.default_rng(seed)
    paint = rng.integers(0, 256, (40, 50), np.uint8)
    start, end = rng.uniform(-20, 60, (8, 2)), rng.uniform(-20, 60, (8, 2))
    mean = np.empty(8)
    mean_along(paint, start, end, mean)
    for n in range(8):
        at = np.rint(start[n] + (end[n] - start[n]) * np.linspace(0.08, 0.92, 24)[:, None]).astype(int)
        at = at[(at >= 0).all(axis=1) & (at[:, 0] < 50) & (at[:, 1] < 40)]
        expected = paint[at[:, 1], at[:, 0]].mean() if len(at) >= 8 else 0.0
        assert mean[n] == pytest.approx(expected)
