"""Free floor in polar samples: marks, things, dark feet, strips behind lines."""

from __future__ import annotations

import math

import numpy as np
import pytest
from frozen import frozen
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.kernels.floor.dark_feet import FADE, block_dark_bodies, block_dark_feet, foot_px
from robocup_vision.kernels.floor.free_floor import BALL, BLOCKED, FLOOR, LINE, clear_ball, passable
from robocup_vision.kernels.floor.polar import outer_boundary
from robocup_vision.kernels.floor.things import FieldFeet, blocked_feet, is_of_field


@pytest.mark.parametrize(("first", "strength", "end"), [(13, 50, 14), (13, 5, 10), (16, 50, 10)])
def test_floor_goes_on_behind_a_line_where_a_strip_of_it_is_near_and_sure(first, strength, end):
    llr = np.full((5, 30), -40, np.int8)
    llr[:, :11], llr[:, first : first + 2] = 50, strength
    out = np.empty(5, np.int64)
    outer_boundary(llr, frozen(np.ones((5, 30), np.uint8)), 48, 3, 80, out)
    np.testing.assert_array_equal(out, end)


RANGE_M = frozen(np.geomspace(0.3, 6.0, 24))


@pytest.mark.parametrize(("last", "foot"), [(12, 5), (6, 24 + 23)])
def test_a_thing_hides_the_floor_behind_it_and_a_speck_does_not(last, foot):
    marks, out = np.ones((1, 24), np.uint8), np.empty(1, np.int64)
    marks[0, 5 : last + 1] = 0
    # half as high as the camera it hides as much again as it is away: six columns
    blocked_feet(frozen(marks), frozen(np.ones_like(marks)), RANGE_M, 0, 24, 0.5, 0.25, out)
    assert out[0] == foot


def test_the_floors_end_and_what_the_field_has_on_it_is_its_own():
    field = load_field("ssl_division_b")
    feet = FieldFeet(
        np.array(field.floor_polygon),
        np.vstack([goal.panels for goal in field.goals]),
        np.array([[1.0, 1.0, 0.1]]),
        np.empty((0, 4)),
    )
    rng = np.random.default_rng(0)
    robot = (0.5, -0.3, 0.7)
    c, s = math.cos(robot[2]), math.sin(robot[2])
    for x, y in rng.uniform(-5.5, 5.5, (400, 2)):
        away = np.array([x - robot[0], y - robot[1]])
        local = c * away[0] + s * away[1], c * away[1] - s * away[0]
        error_m = float(rng.uniform(0.0, 0.3))
        behind = np.array([x, y]) + error_m * away / np.hypot(*away)
        expected = not field.contains(behind) or math.hypot(x - 1.0, y - 1.0) < 0.1 + error_m
        for x0, y0, x1, y1 in feet.panels:
            along = np.linspace(0, 1, 2001)[:, None] * [x1 - x0, y1 - y0] + [x0, y0]
            expected |= bool(np.hypot(*(along - [x, y]).T).min() < error_m)
        assert is_of_field(*local, error_m, (0.0, 0.0), robot, feet) == expected


def test_the_inside_of_a_goal_with_a_net_is_the_fields_own():
    floor = np.array([[-5.0, -3.0], [5.0, -3.0], [5.0, 3.0], [-5.0, 3.0]])
    feet = FieldFeet(floor, np.empty((0, 4)), np.empty((0, 3)), np.array([[1.0, 4.0, 4.5, 0.8], [-1.0, 4.0, 4.5, 0.8]]))
    here = (0.0, 0.0), (0.0, 0.0, 0.0)
    assert is_of_field(4.3, 0.5, 0.05, *here, feet)
    assert is_of_field(-4.3, 0.5, 0.05, *here, feet)
    assert not is_of_field(3.9, 0.5, 0.05, *here, feet)
    assert not is_of_field(4.3, 1.0, 0.05, *here, feet)


seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("foot", [9.6, 12.0, 14.3])
@pytest.mark.parametrize("spread", [0.6, 1.5])
def test_the_foot_lies_where_half_of_the_floor_is_left(foot, spread):
    at = np.arange(30)
    floor = 1.0 / (1.0 + np.exp((at - foot) / (0.4 * spread)))
    samples = np.repeat(np.rint(20 + 120 * floor)[None, :, None], 3, axis=2).astype(np.uint8)
    by_color = np.array([int(np.flatnonzero(floor > 0.08)[-1]), -1])
    ends = np.empty(2)
    samples, valid = np.repeat(samples, 2, axis=0), frozen(np.ones((2, 30), dtype=np.uint8))
    foot_px(samples, valid, by_color, frozen(3.0 * at), 3.0, ends)
    # no more than the sampling leaves open
    assert ends[0] / 3.0 == pytest.approx(foot, abs=0.25 if spread > 1 else 0.5)
    assert np.isnan(ends[1])
    marks = (floor > 0.08).astype(np.uint8)[None].repeat(2, axis=0)
    block_dark_feet(samples, valid, 30, marks)
    np.testing.assert_array_equal(marks, np.repeat((floor >= 0.5)[None], 2, axis=0))


def test_what_is_bright_behind_the_floor_leaves_its_end_where_it_was():
    samples = np.full((1, 20, 3), 90, dtype=np.uint8)
    samples[0, 12:] = 200
    marks = (np.arange(20) < 12).astype(np.uint8)[None]
    ends = np.empty(1)
    valid = frozen(np.ones((1, 20), dtype=np.uint8))
    foot_px(samples, valid, np.array([11]), frozen(np.arange(20.0)), 1.0, ends)
    block_dark_feet(samples, valid, 20, marks)
    assert ends[0] == 11.5
    assert marks.sum() == 12


def dark_stretch(behind, level=0.3):
    """Return samples and marks of one bearing: floor, at column 12 a stretch as dark as `level`, at 22 what follows."""
    brightness = np.full(40, 120.0)
    brightness[12:22] *= level
    marks = np.full((1, 40), FLOOR, dtype=np.uint8)
    marks[0, 22:26] = behind
    return np.repeat(brightness.astype(np.uint8)[None, :, None], 3, axis=2), marks


def blocked_of(samples, marks):
    block_dark_bodies(samples, frozen(np.ones(marks.shape, dtype=np.uint8)), 36, marks)
    return np.flatnonzero(marks[0] == BLOCKED).tolist()


def test_a_dark_stretch_of_floor_before_something_else_is_its_body_and_before_floor_a_shadow():
    assert blocked_of(*dark_stretch(BLOCKED)) == list(range(12, 26))
    assert blocked_of(*dark_stretch(FLOOR)) == []
    assert blocked_of(*dark_stretch(LINE)) == []
    # what is no darker than a shadow stays floor
    assert blocked_of(*dark_stretch(BLOCKED, level=0.6)) == list(range(22, 26))


def test_a_body_that_is_dark_up_to_the_horizon_is_blocked_where_half_of_the_light_is_left():
    at = np.arange(40)
    brightness = np.interp(at, [10, 10 + FADE - 2], [120, 20])
    samples = np.repeat(brightness.astype(np.uint8)[None, :, None], 3, axis=2)
    marks = np.full((1, 40), FLOOR, dtype=np.uint8)
    assert blocked_of(samples, marks) == list(range(int(np.flatnonzero(brightness < 60)[0]), 36))


@given(
    st.floats(-30, 30), st.floats(0, 30), st.floats(0.5, 6), st.floats(0.5, 8), st.floats(0.5, 8), st.booleans(), seeds
)
def test_a_ball_clears_its_ellipse_only(row, radius, half_rows, near_px, far_px, is_ring, seed):
    rng = np.random.default_rng(seed)
    marks = rng.integers(0, 3, (20, 25), dtype=np.uint8)
    radius_px = frozen(np.linspace(2.0, 28.0, 25))
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
        passable(samples, llr, frozen(np.ones_like(out)), widest, widest, columns, is_ring, no_rim, out)
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
        valid = frozen(np.ones((rows, columns), dtype=np.uint8))
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
    valid = frozen((rng.random((12, 15)) < 0.7).astype(np.uint8))
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
