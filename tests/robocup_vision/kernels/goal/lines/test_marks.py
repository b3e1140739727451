"""Places on lines against the plain NumPy picture of floor points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.goal.lines.marks import (
    MarkLimits,
    MarkPlaces,
    _mean_of,
    _pixels_at,
    line_marks,
    mark_stds,
    measure_ridges,
)
from robocup_vision.localization.goal.geometry import IdealView, project

VIEW = IdealView((384.0, 380.0), (207.5, 159.5))
VIEW_ARRAY = np.array([384.0, 380.0, 207.5, 159.5])
ALONG = np.arange(-1.5, 1.5, 0.02)
POINTS = np.column_stack([np.full(len(ALONG), 2.0), ALONG])


def places(p, spacing=6.0, least=0.2, points=POINTS, clear=2.5):
    room = len(points)
    marks, pixels, normals, widths = np.empty((room, 2)), np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
    along = np.tile([0.0, 1.0], (room, 1))
    size = (416, 320)
    limits = MarkLimits(0.05, spacing, least, clear)
    n = line_marks(points, along, VIEW_ARRAY, p, size, limits, MarkPlaces(marks, pixels, normals, widths))
    return marks[:n], pixels[:n], normals[:n], widths[:n]


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_places_are_where_numpy_projects_them(seed):
    rng = np.random.default_rng(seed)
    p = np.array([*rng.uniform(-0.5, 0.5, 2), *rng.uniform(-0.1, 0.1, 3), rng.uniform(0.2, 0.5), 0.01, 0.3])
    marks, pixels, normals, widths = places(p)
    assert len(marks) > 5
    floor = np.column_stack([marks, np.zeros(len(marks))])
    np.testing.assert_allclose(pixels, project(VIEW, p, floor), atol=1e-6)
    # both borders of the paint, measured across the line in the picture
    near, far = (project(VIEW, p, floor + np.array([x, 0, 0])) for x in (-0.025, 0.025))
    np.testing.assert_allclose(np.abs(((far - near) * normals).sum(axis=1)), widths, rtol=0.02)
    ahead = project(VIEW, p, floor + np.array([0, 1e-4, 0])) - pixels
    np.testing.assert_allclose((ahead * normals).sum(axis=1), 0, atol=1e-6)
    assert np.hypot(*np.diff(pixels, axis=0).T).min() >= 6.0


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_spread_of_places_is_that_of_many_cameras(seed):
    rng = np.random.default_rng(seed)
    p = np.array([*rng.uniform(-0.5, 0.5, 2), *rng.uniform(-0.1, 0.1, 3), rng.uniform(0.2, 0.5), 0.01, 0.3])
    marks, _, normals, _ = places(p)
    root = rng.normal(0, 1e-4, (8, 8))
    std = np.empty(len(marks))
    mark_stds(marks, normals, VIEW_ARRAY, p, root @ root.T, std)
    floor = np.column_stack([marks, np.zeros(len(marks))])
    moved = [
        (((project(VIEW, p + column, floor) - project(VIEW, p - column, floor)) / 2) * normals).sum(axis=1)
        for column in np.where(np.arange(8) < 7, root.T, 0.0)
    ]
    np.testing.assert_allclose(std, np.sqrt(np.square(moved).sum(axis=0)), rtol=1e-3)


def test_thin_and_hidden_lines_are_left_out():
    p = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0])
    assert len(places(p)[0]) > 20
    assert len(places(p, least=3.0)[0]) == 0
    turned = p.copy()
    turned[2] = np.pi  # looks away
    assert len(places(turned)[0]) == 0


def test_lines_that_run_into_each_other_are_distinguished_from_neither():
    p = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0])
    beside = POINTS + np.array([0.06, 0.0])
    both = np.vstack([POINTS, beside])
    assert len(places(p, points=both)[0]) == 0
    assert len(places(p, points=both, clear=-100.0)[0]) > 1.9 * len(places(p)[0])
    assert len(places(p, points=np.vstack([POINTS, POINTS + np.array([1.0, 0.0])]))[0]) > len(places(p)[0])


def test_a_line_too_faint_for_one_place_is_seen_over_a_stretch():
    rng = np.random.default_rng(3)
    picture = np.full((60, 400, 3), (50.0, 130.0, 45.0))
    picture[30] += 9.0
    frame = np.clip(np.rint(picture + rng.normal(0, 3, picture.shape)), 0, 255).astype(np.uint8)
    start = np.column_stack([np.arange(20.0, 380.0, 8.0), np.full(45, 30.0)])
    normal, width, reach = np.tile([0.0, 1.0], (45, 1)), np.full(45, 0.2), np.full(45, 2.0)
    off = {}
    for along_px in (0.0, 6.0):
        offset, contrast = np.empty(45), np.empty(45)
        measure_ridges(frame, start, normal, reach, width, along_px, offset, contrast)
        off[along_px] = offset[np.isfinite(offset)]
    assert len(off[6.0]) > 30
    assert len(off[6.0]) > len(off[0.0])
    assert off[6.0].std() < off[0.0].std()


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_a_sample_is_the_weighted_mean_of_four_pixels(seed):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (7, 9, 3), dtype=np.uint8)
    u, v, channel = rng.uniform(0, 8), rng.uniform(0, 6), int(rng.integers(3))
    rows, columns = np.arange(7), np.arange(9)
    weight = np.outer(np.maximum(0, 1 - np.abs(rows - v)), np.maximum(0, 1 - np.abs(columns - u)))
    at, weights = _pixels_at(u, v, 9)
    mean = _mean_of(image.reshape(-1), np.uint64(at + channel), np.uint64(27), weights)
    assert mean == pytest.approx((weight * image[..., channel]).sum())


def interpolated(frame, u, v):
    """Bilinear BGR at places (...,) of a picture."""
    u0, v0 = u.astype(int), v.astype(int)
    fu, fv = (u - u0)[..., None], (v - v0)[..., None]
    upper = frame[v0, u0] * (1 - fu) + frame[v0, u0 + 1] * fu
    return upper * (1 - fv) + (frame[v0 + 1, u0] * (1 - fu) + frame[v0 + 1, u0 + 1] * fu) * fv


def plain_ridge(frame, start, normal, reach, width, along_px):
    """Offset and contrast of one ridge; NaN and 0 where there is none."""
    rows, columns = frame.shape[:2]
    side, repeats = 0.5 * width + 1.5, 1 + int(along_px / 1.5)
    far, half = round(side / 0.5), int(0.3 * width / 0.5)
    t = -reach - side - 1 + 0.5 * np.arange(round(2 * (reach + side + 1) / 0.5) + 1)
    s = 1.5 * (np.arange(repeats) - (repeats - 1) / 2)
    u = start[0] + t[:, None] * normal[0] - s * normal[1]
    v = start[1] + t[:, None] * normal[1] + s * normal[0]
    if not ((u >= 0) & (u < columns - 1) & (v >= 0) & (v < rows - 1)).all():
        return np.nan, 0.0
    b, g, r = interpolated(frame.astype(float), u, v).mean(axis=1).T
    bright, green = np.minimum(b, r), (2 * g - r - b) / (r + g + b + 30)
    best, at = 6.0 / np.sqrt(repeats), -1
    for i in range(far + 2, len(t) - far - 2):
        beside = max(bright[i - far - 2 : i - far + 1].mean(), bright[i + far : i + far + 3].mean())
        value = (bright[i - half : i + half + 1].mean() - beside) * (1 - 0.5 * abs(t[i]) / (reach + 1))
        if value > best and min(green[i - far - 1], green[i + far + 1]) >= 0.08:
            best, at = value, i
    if at < 0:
        return np.nan, 0.0
    peak = max([at, *range(at - half - 1, at + half + 2)], key=lambda i: bright[i])
    ends = []
    for sign in (-1, 1):
        level = (np.mean([bright[at + sign * (far + k)] for k in range(3)]) + bright[peak]) / 2
        i = peak
        while 0 < i + sign < len(t) - 1 and bright[i] > level:
            i += sign
        before = bright[i - sign]
        part = (before - level) / (before - bright[i]) if before > bright[i] else 0.5
        ends.append(t[0] + (i - sign + sign * part) * 0.5)
    seen = ends[1] - ends[0]
    return (np.mean(ends), best) if 0.35 * width - 0.5 < seen < 1.8 * width + 2 else (np.nan, 0.0)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 3.0]))
def test_ridges_are_those_of_plain_numpy(seed, along_px):
    rng = np.random.default_rng(seed)
    picture = np.full((40, 60, 3), (50.0, 130.0, 45.0)) + rng.normal(0, 4, (40, 60, 3))
    turn = rng.uniform(0, np.pi)
    v, u = np.indices((40, 60))
    away = (u - 30) * np.cos(turn) + (v - 20) * np.sin(turn)
    # a line, and beside it something that is not carpet
    picture[np.abs(away) < rng.uniform(0.3, 3)] = (200, 205, 210)
    picture[away > rng.uniform(3, 12)] = (120, 120, 120)
    frame = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    start = np.column_stack([rng.uniform(-2, 62, 30), rng.uniform(-2, 42, 30)])
    normal = np.tile([np.cos(turn), np.sin(turn)], (30, 1))
    reach, width = rng.uniform(1, 8, 30), rng.uniform(0.2, 5, 30)
    offset, contrast = np.empty(30), np.empty(30)
    measure_ridges(frame, start, normal, reach, width, along_px, offset, contrast)
    for n in range(30):
        expected = plain_ridge(frame, start[n], normal[n], reach[n], width[n], along_px)
        np.testing.assert_allclose((offset[n], contrast[n]), expected, rtol=1e-6, atol=1e-6)
