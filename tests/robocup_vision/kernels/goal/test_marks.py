"""Which lines of a field are looked for in a picture of a goal."""

import numpy as np
from goal_samples import VIEW, floor_px

from robocup_vision.kernels.goal.marks import MarkLimits, MarkPlaces, line_marks, measure_ridges

VIEW_ARRAY = np.array([384.0, 380.0, 207.5, 159.5])
ALONG = np.arange(-1.5, 1.5, 0.02)
POINTS = np.column_stack([np.full(len(ALONG), 2.0), ALONG])


def places(p, spacing=6.0, least=0.2):
    points = POINTS
    room = len(points)
    marks, pixels, normals, widths = np.empty((room, 2)), np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
    along = np.tile([0.0, 1.0], (room, 1))
    size = (416, 320)
    limits = MarkLimits(0.05, spacing, least)
    n = line_marks(points, along, VIEW_ARRAY, p, size, limits, MarkPlaces(marks, pixels, normals, widths))
    return marks[:n], pixels[:n], normals[:n], widths[:n]


def test_places_lie_where_paint_is_projected_across_it_and_as_wide():
    p = np.array([0.1, -0.2, 0.15, -0.1, 0.05, 0.3, 0.04, 0.0])
    marks, pixels, normals, widths = places(p)
    assert len(marks) > 20
    np.testing.assert_allclose(pixels, floor_px(VIEW, p, marks), atol=1e-6)
    far, near = (floor_px(VIEW, p, marks + np.array([side * 0.025, 0.0])) for side in (1, -1))
    np.testing.assert_allclose(widths, np.abs(((far - near) * normals).sum(axis=1)), rtol=1e-3)
    along = floor_px(VIEW, p, marks + np.array([0.0, 1e-5])) - pixels
    np.testing.assert_allclose((along * normals).sum(axis=1), 0.0, atol=1e-8)


def test_thin_and_hidden_lines_are_left_out():
    p = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0])
    assert len(places(p)[0]) > 20
    assert len(places(p, least=3.0)[0]) == 0
    turned = p.copy()
    turned[2] = np.pi  # looks away
    assert len(places(turned)[0]) == 0


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
