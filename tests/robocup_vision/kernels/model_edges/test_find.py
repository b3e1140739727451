"""Proposals without a prior against plain NumPy: paints by bearing, points on the floor, scores and best poses."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.kernels.model_edges.find import (
    BINS,
    FIRST_POINTS,
    Bank,
    _least,
    best_poses,
    chroma,
    column_of,
    floor_places,
    score_bank,
    upright_bins,
)

CAMERA = PinholeCamera(
    (104, 80), (96.0, 96.0), (51.5, 39.5), 0.185, pan_rad=0.0, tilt_rad=-0.17, roll_rad=0.03, roll_std_rad=0.02
)
HALF_VIEW_RAD = math.atan(52 / 96)
PAINTS = np.array([[-1.0, 0.0, 1.0], [-2.0, 1.0, 1.0]]) / np.sqrt([[2.0], [6.0]])


def plain_upright_bins(image, horizon_row):
    height, width = image.shape[:2]
    top, bottom = max(int(horizon_row - 0.45 * height), 0), min(int(horizon_row + 0.2 * height), height)
    bearing = HALF_VIEW_RAD * (1.0 - 2.0 * (np.arange(BINS) + 0.5) / BINS)
    columns = np.rint(51.5 - 96.0 * np.tan(bearing)).astype(int)
    colors = image[top : bottom : max(1, (bottom - top) // 60)].astype(float)
    grey = colors.mean(axis=-1, keepdims=True)
    chroma = colors - grey
    size = np.linalg.norm(chroma, axis=-1)
    seen = np.zeros((len(PAINTS), BINS + 1))
    for k, paint in enumerate(PAINTS):
        shows = (size > 0.35 * grey[..., 0] + 10.0) & (chroma @ paint > 0.93 * size)
        three = shows[:-2] & shows[1:-1] & shows[2:]
        hit = [0 <= u < width and three[:, u].any() for u in columns]
        seen[k, 1:] = np.cumsum(hit)
    return seen


@pytest.mark.parametrize("horizon_row", [20.3, 55.0, -100.0, 200.0])
def test_paints_are_counted_by_bearing(horizon_row):
    rng = np.random.default_rng(5)
    image = rng.integers(0, 60, (80, 104, 3)).astype(np.uint8)
    image[10:40, 20:30], image[5:50, 60:64], image[30, 80:90] = (20, 40, 230), (20, 210, 225), (20, 40, 230)
    seen = np.full((2, BINS + 1), -1.0)
    upright_bins(image, lens_table(CAMERA), horizon_row, PAINTS, HALF_VIEW_RAD, seen)
    np.testing.assert_array_equal(seen, plain_upright_bins(image, horizon_row))
    assert (seen[:, -1] > 0).all() == (0 < horizon_row < 80)


@pytest.mark.parametrize(("count", "room"), [(0, 10), (1, 10), (40, 40), (40, 7)])
def test_line_points_are_put_on_the_floor(count, room):
    pixels = np.random.default_rng(1).uniform((0.0, 5.0), (103.0, 79.0), (40, 2))
    out = np.full((room, 3), np.nan)
    points = np.column_stack([pixels, np.zeros(40)])
    kept = floor_places(points, count, lens_table(CAMERA), -0.17, 0.03, 0.185, 5.0, out)
    expected = CAMERA.pixel_to_floor(pixels[:count]).reshape(-1, 2)
    with np.errstate(invalid="ignore"):
        expected = expected[np.hypot(*expected.T) <= 5.0]
    assert kept == min(len(expected), room)
    for x, y, tolerance in out[:kept]:
        assert np.abs(expected - (x, y)).max(axis=1).min() < 1e-9
        away = math.hypot(x, y)
        assert tolerance == pytest.approx(0.12 + 0.06 * away + 0.012 * away**2 / 0.185)
    # each point once
    assert len(np.unique(out[:kept].round(9), axis=0)) == kept


@pytest.fixture
def bank():
    rng = np.random.default_rng(8)
    places = np.stack(np.meshgrid(np.arange(-1.0, 1.1, 0.5), np.arange(-0.5, 0.6, 0.5)), axis=-1).reshape(-1, 2)
    items = np.array([[2.0, -0.4, 2.0, 0.4, 0.05], [-0.5, 1.2, -0.5, 1.2, 0.1]])
    return Bank(
        places,
        np.linspace(0.0, math.tau, 12, endpoint=False),
        rng.uniform(0.0, 0.6, (40, 60)).astype(np.float32),
        np.array([-3.0, -2.0]),
        0.1,
        items,
        np.array([0, 1]),
        PAINTS,
        HALF_VIEW_RAD,
    )


def plain_misfit(bank, rows, x, y, theta):
    turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
    place = rows[:, :2] @ turn.T + (x, y)
    column, row = np.floor((place - bank.origin_m) / bank.cell_m + 0.5).astype(int).T
    inside = (column >= 0) & (row >= 0) & (column < bank.distance_m.shape[1]) & (row < bank.distance_m.shape[0])
    away = np.full(len(rows), np.inf)
    away[inside] = bank.distance_m[row[inside], column[inside]]
    return np.minimum((away / rows[:, 2]) ** 2, 1.0)


def plain_wrong_bins(bank, seen, x, y, theta):
    matched = predicted = 0.0
    for (x0, y0, x1, y1, radius), k in zip(bank.items, bank.item_paint, strict=True):
        a, b = math.atan2(y0 - y, x0 - x), math.atan2(y1 - y, x1 - x)
        turn = math.remainder(b - a, math.tau)
        away = math.hypot((x0 + x1) / 2 - x, (y0 + y1) / 2 - y)
        half = radius / max(away, radius)
        middle = math.remainder(a + turn / 2 - theta, math.tau)
        wide = abs(turn) / 2 + half
        per_bin = BINS / (2 * bank.half_view_rad)
        begin = max(int((bank.half_view_rad - middle - wide) * per_bin), 0)
        end = min(int((bank.half_view_rad - middle + wide) * per_bin) + 1, BINS)
        if end > begin:
            matched += seen[k, end] - seen[k, begin]
            predicted += end - begin
    return max(seen[:, -1].sum() - matched, 0.0) + 0.4 * max(predicted - matched, 0.0)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 400), st.booleans())
def test_the_least_are_those_of_a_sort(seed, count, are_alike):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=rng.integers(count, 5000))
    if are_alike:
        # the sampled ones are the greatest, and many are the same
        values = np.round(2 * values)
        values[::31] = 9.0
    expected = np.flatnonzero(values <= np.sort(values)[count - 1])
    np.testing.assert_array_equal(_least(values, count), expected)


@pytest.mark.parametrize("number", [9, 30])
def test_scores_and_best_poses_are_the_plain_ones(bank, number):
    rng = np.random.default_rng(number)
    rows = np.column_stack([rng.uniform(0.2, 2.0, 30), rng.uniform(-1.0, 1.0, 30), rng.uniform(0.2, 0.6, 30)])
    seen = np.zeros((2, BINS + 1))
    seen[:, 1:] = np.cumsum(rng.random((2, BINS)) < 0.2, axis=1)
    scores = np.zeros((len(bank.places), len(bank.headings)))
    score_bank(bank, rows, number, seen, 0.25, scores)
    first, full = min(number, FIRST_POINTS), np.zeros_like(scores)
    for i, (x, y) in enumerate(bank.places):
        for j, theta in enumerate(bank.headings):
            misfit = plain_misfit(bank, rows[:number], x, y, theta)
            few = misfit[:first].sum() * number / first
            wrong = 0.25 * plain_wrong_bins(bank, seen, x, y, theta)
            assert scores[i, j] == pytest.approx(few + wrong, abs=1e-6)
            full[i, j] = misfit.sum() + wrong
    out = np.zeros((5, 4))
    kept = best_poses(bank, rows, number, scores, 60, np.array([0.6, 0.6]), out)
    expected = []
    for place in sorted(np.argsort(scores, axis=None)[:60], key=lambda place: full.flat[place]):
        i, j = np.unravel_index(place, scores.shape)
        pose = (*bank.places[i], bank.headings[j])
        if all(
            math.hypot(pose[0] - x, pose[1] - y) >= 0.6 or abs(math.remainder(pose[2] - theta, math.tau)) >= 0.6
            for x, y, theta, _ in expected
        ):
            expected.append((*pose, full[i, j]))
    assert kept == min(len(expected), 5)
    np.testing.assert_allclose(out[:kept], expected[:kept], atol=1e-6)


def test_a_bin_lies_where_its_bearing_is_seen():
    lens = lens_table(CAMERA)
    bearing = HALF_VIEW_RAD * (1.0 - 2.0 * (np.arange(BINS) + 0.5) / BINS)
    columns = [column_of(i, HALF_VIEW_RAD, lens) for i in range(BINS)]
    np.testing.assert_array_equal(columns, np.rint(51.5 - 96.0 * np.tan(bearing)))


def test_colour_is_what_is_left_without_grey():
    image = np.array([[[30, 60, 210], [100, 104, 98]]], dtype=np.uint8)
    np.testing.assert_allclose(chroma(image, 0, 0), (-70.0, -40.0, 110.0, math.sqrt(70**2 + 40**2 + 110**2)))
    assert chroma(image, 0, 1)[3] == 0.0
