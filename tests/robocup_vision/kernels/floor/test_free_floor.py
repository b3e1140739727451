"""What counts as floor: balls, lines and corners of bright things."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.kernels.floor.free_floor import BALL, BLOCKED, FLOOR, LINE, clear_ball, passable

seeds = st.integers(0, 2**32 - 1)


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


@given(seeds, st.booleans())
def test_marks_do_not_depend_on_where_in_a_row_things_lie(seed, is_ring):
    rng = np.random.default_rng(seed)
    # things of 20 columns in open floor; a row is read in words of 64 samples
    rows, wide, around = 14, 20, 8
    things = np.where(rng.random((rows, wide)) < 0.4, -40, 40).astype(np.int8)
    colors = rng.integers(60, 200, (rows, wide, 3), dtype=np.uint8)
    marks = []
    for first in (around, around + 40, around + 50, around + 64):
        columns = first + wide + around
        llr, samples = np.full((rows, columns), 40, np.int8), np.full((rows, columns, 3), 120, np.uint8)
        llr[:, first : first + wide], samples[:, first : first + wide] = things, colors
        widest, out = np.full(columns, 3, np.int32), np.empty((rows, columns), np.uint8)
        no_rim = np.full(rows, -1)
        passable(samples, llr, np.ones_like(out), widest, widest, columns, is_ring, no_rim, out)
        marks.append(out[:, first : first + wide])
    for other in marks[1:]:
        np.testing.assert_array_equal(other, marks[0])


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
