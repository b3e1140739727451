"""The compiled loops of the free floor against plain NumPy twins."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor.free_floor import BALL, BLOCKED, FLOOR, LINE, clear_ball, passable

seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=40)
@given(
    st.floats(-30, 30), st.floats(0, 30), st.floats(0.5, 6), st.floats(0.5, 8), st.floats(0.5, 8), st.booleans(), seeds
)
def test_a_ball_clears_its_ellipse_only(row, radius, half_rows, near_px, far_px, is_ring, seed):
    rng = np.random.default_rng(seed)
    marks = rng.integers(0, 3, (20, 25), dtype=np.uint8)
    radius_px = np.linspace(2.0, 28.0, 25)
    rows = np.arange(math.floor(row - half_rows) - 1, math.ceil(row + half_rows) + 2)
    inside = np.zeros((20, 25), dtype=bool)
    half_px = np.where(radius_px > radius, far_px, near_px)
    for k in rows if is_ring else rows[(rows >= 0) & (rows < 20)]:
        inside[k % 20] |= ((k - row) / half_rows) ** 2 + ((radius_px - radius) / half_px) ** 2 <= 1
    expected = np.where(inside & (marks == BLOCKED), BALL, marks)
    clear_ball(row, radius, half_rows, near_px, far_px, is_ring, radius_px, marks)
    # on the very rim rounding decides
    assert (marks != expected).sum() <= 1


def whiter(samples, hidden, floor):
    seen = [np.zeros(3), *(s.astype(float) for s, gone in zip(samples, hidden, strict=True) if not gone)]
    brightest = np.max(seen, axis=0)
    return all(brightest[c] > float(floor[c]) for c in (0, 2))


def passable_twin(samples, llr, valid, line_columns, line_rows, in_use, is_ring, outermost):
    rows = len(llr)
    floor, level = llr > 0, samples.sum(axis=2, dtype=int)
    out = np.where(floor, FLOOR, BLOCKED)
    for k in range(rows):
        reach = [outermost[(k + s) % rows] for s in range(-2, 3)]
        end = in_use - 2 if min(reach) < 0 else min(in_use - 2, max(reach) + 2)
        for m in range(2, end):
            if floor[k, m] or not valid[k, m]:
                continue
            sides = ((0, -1), (0, 1), (-1, 0), (1, 0))
            if all(any(floor[(k + s * dk) % rows, m + s * dm] for s in (1, 2)) for dk, dm in sides):
                out[k, m] = FLOOR
                continue
            for dk, dm in sides:
                one, two = (((k + s * dk) % rows, m + s * dm) for s in (1, 2))
                if floor[one] and floor[two]:
                    out[k, m] = FLOOR if level[k, m] > level[two] else BLOCKED
                    break
    for k in range(rows):
        for m in range(1, in_use - 1):
            beside = [out[k, m - 1], out[k, m + 1], out[(k - 1) % rows, m], out[(k + 1) % rows, m]]
            if out[k, m] == BLOCKED and valid[k, m] and BLOCKED not in beside:
                out[k, m] = FLOOR
    for k in range(rows):
        last = base = -1
        for m in np.flatnonzero(out[k, :in_use] != BLOCKED):
            base = m if floor[k, m] or base < 0 else base
            # the picture's rim bounds as the robot's does
            between = np.arange(max(last + 1, np.argmax(valid[k])), m)
            if 1 <= len(between) <= line_columns[m] and whiter(
                samples[k, between], valid[k, between] == 0, samples[k, base]
            ):
                out[k, between[valid[k, between] > 0]] = LINE
            last = m
    for m in range(in_use):
        last = base = None
        for step in range(rows + line_rows[0] + 1):
            k = step % rows
            if step == rows and not is_ring:
                last = None
            if out[k, m] == BLOCKED:
                continue
            base = k if floor[k, m] or base is None else base
            if last is not None and 1 <= step - last - 1 <= line_rows[m]:
                between = np.arange(last + 1, step) % rows
                if whiter(samples[between, m], valid[between, m] == 0, samples[base, m]):
                    out[between[valid[between, m] > 0], m] = LINE
            last = step
    for k in range(rows):
        left = 0
        for m in [m for m in range(in_use) if valid[k, m]][::-1]:
            if out[k, m] == BLOCKED:
                left = (line_columns[m] + 1) // 2
            elif out[k, m] == LINE and left > 0:
                out[k, m], left = BLOCKED, left - 1
            else:
                left = 0
    return out


@settings(deadline=None, max_examples=60)
@given(seeds, st.booleans())
def test_passable_agrees_with_its_twin(seed, is_ring):
    rng = np.random.default_rng(seed)
    # up to three words of 64 bits a row
    rows, columns = int(rng.integers(6, 16)), int(rng.integers(6, 20) + 58 * rng.integers(3))
    llr = rng.integers(-64, 0, (rows, columns)).astype(np.int8)
    for _ in range(columns // 4):  # patches of floor with gaps between them
        k, m = rng.integers(0, rows), rng.integers(0, columns)
        llr[k : k + rng.integers(1, 6), m : m + rng.integers(1, 8)] = 40
    valid = (rng.random((rows, columns)) < 0.95).astype(np.uint8)
    # rows that begin beyond the picture
    valid[rng.random(rows) < 0.4, : rng.integers(0, 6)] = 0
    if not is_ring:
        valid[-2:], llr[-2:] = 0, 0
    llr[valid == 0] = 0
    samples = rng.integers(60, 140, (rows, columns, 3), dtype=np.uint8)
    line_columns = rng.integers(1, 5, columns, dtype=np.int32)
    line_rows = np.sort(rng.integers(1, 5, columns, dtype=np.int32))[::-1].copy()
    in_use = int(rng.integers(3, columns + 1))
    out = np.empty((rows, columns), dtype=np.uint8)
    outermost = rng.integers(-1, columns, rows)
    rules = valid, line_columns, line_rows, in_use, is_ring, outermost
    passable(samples, llr, *rules, out)
    np.testing.assert_array_equal(out, passable_twin(samples, llr, *rules))


def test_a_bright_corner_is_no_line_and_a_line_is_no_corner():
    rows, columns, tip, wide = 40, 30, 10, 9
    middle, m = np.mgrid[-20 : rows - 20, :columns]
    corner, line = np.abs(middle) <= m - tip, np.abs(middle) <= wide // 2
    widest = np.full(columns, wide, dtype=np.int32)
    marks = []
    for shape in (corner, line):
        samples = np.where(shape[..., None], 230, 60).astype(np.uint8).repeat(3, axis=2)
        llr = np.where(shape, -64, 40).astype(np.int8)
        out = np.empty((rows, columns), dtype=np.uint8)
        valid = np.ones((rows, columns), dtype=np.uint8)
        passable(samples, llr, valid, widest, widest, columns, True, np.full(rows, -1), out)
        marks.append(out)
    assert (marks[0][~corner] == FLOOR).all()
    # what is taken back of the blur costs a sample of its sides, and two of its tip
    assert (marks[0][(np.abs(middle) <= m - tip - 2)] == BLOCKED).all()
    assert (marks[1] != BLOCKED).all()
    assert (marks[1][line][:, None] == LINE).mean() > 0.7


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_what_hidden_samples_show_changes_no_mark(seed):
    rng = np.random.default_rng(seed)
    llr = rng.integers(-64, 64, (12, 15)).astype(np.int8)
    valid = (rng.random((12, 15)) < 0.7).astype(np.uint8)
    llr[valid == 0] = 0
    samples = rng.integers(0, 256, (12, 15, 3), dtype=np.uint8)
    widest = np.full(15, 4, dtype=np.int32)
    outs = []
    for color in (0, 255):
        # a hidden sample beside the marks may become floor by its neighbours, whose colour is then its own
        shown = np.where(valid[..., None] > 0, samples, np.uint8(color))
        out = np.empty((12, 15), dtype=np.uint8)
        seen_llr = np.where(valid > 0, llr, -64).astype(np.int8)
        passable(shown, seen_llr, valid, widest, widest, 15, True, np.full(12, -1), out)
        outs.append(out)
    hidden_floor = (outs[0] == FLOOR) & (valid == 0)
    if not hidden_floor.any():
        np.testing.assert_array_equal(*outs)
    np.testing.assert_array_equal(outs[0] == FLOOR, outs[1] == FLOOR)
