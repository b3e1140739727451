"""Proposals without a prior: line points on the floor, bearings of columns, colours without grey."""

import math

import numpy as np
import pytest

from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.kernels.model_edges.find import BINS, chroma, column_of, floor_places

CAMERA = PinholeCamera(
    (104, 80), (96.0, 96.0), (51.5, 39.5), 0.185, pan_rad=0.0, tilt_rad=-0.17, roll_rad=0.03, roll_std_rad=0.02
)
HALF_VIEW_RAD = math.atan(52 / 96)


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


def test_a_bin_lies_where_its_bearing_is_seen():
    lens = lens_table(CAMERA)
    bearing = HALF_VIEW_RAD * (1.0 - 2.0 * (np.arange(BINS) + 0.5) / BINS)
    columns = [column_of(i, HALF_VIEW_RAD, lens) for i in range(BINS)]
    np.testing.assert_array_equal(columns, np.rint(51.5 - 96.0 * np.tan(bearing)))


def test_colour_is_what_is_left_without_grey():
    image = np.array([[[30, 60, 210], [100, 104, 98]]], dtype=np.uint8)
    np.testing.assert_allclose(chroma(image, 0, 0), (-70.0, -40.0, 110.0, math.sqrt(70**2 + 40**2 + 110**2)))
    assert chroma(image, 0, 1)[3] == 0.0
