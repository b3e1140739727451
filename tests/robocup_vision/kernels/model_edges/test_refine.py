"""The wider picture that an open heading asks for."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.kernels.model_edges.prediction import predict
from robocup_vision.kernels.model_edges.refine import widened
from robocup_vision.kernels.model_edges.tables import HEADING, Prior, empty_samples
from robocup_vision.localization.model_edges.field_edges import field_edges
from robocup_vision.localization.model_edges.settings import EdgeSettings

NUMBERS = EdgeSettings().for_width(208, 0.025)
CAMERA = PinholeCamera((208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, pan_rad=0.0, tilt_rad=-0.17, roll_rad=0.0)


def prior_of(heading_std_rad):
    root = np.diag([0.05, 0.05, heading_std_rad, 0.02, 0.02, 0.006, 0.0])
    return Prior(np.array([-0.5, -0.2, 3.0, -0.17, 0.0, 0.185, 0.0]), root)


def test_a_heading_that_is_known_widens_nothing():
    wide, beside_px = widened(lens_table(CAMERA), prior_of(0.01), NUMBERS)
    assert beside_px == 0.0
    np.testing.assert_array_equal(wide, lens_table(CAMERA))
    # nor does a search's proposal
    assert widened(lens_table(CAMERA), prior_of(0.1), NUMBERS._replace(view_sigmas=0.0))[1] == 0.0


@pytest.mark.parametrize("heading_std_rad", [0.06, 0.1, 0.5])
def test_a_wider_picture_shows_what_a_camera_so_much_wider_shows(heading_std_rad):
    prior, edges = prior_of(heading_std_rad), field_edges(load_field("four_legged_2007"), math.inf)
    assert prior.root[HEADING, HEADING] == heading_std_rad
    wide, beside_px = widened(lens_table(CAMERA), prior, NUMBERS)
    assert beside_px == pytest.approx(min(NUMBERS.view_sigmas * heading_std_rad * 192.0, NUMBERS.max_reach_px))
    seen, expected = empty_samples(600), empty_samples(600)
    count = predict(edges, wide, prior.mean, 10.0, seen)
    # the pixels beside it, to a whole one
    more = round(beside_px)
    wider = replace(CAMERA, size_px=(208 + 2 * more, 160), center_px=(103.5 + more, 79.5))
    number = predict(edges, lens_table(wider), prior.mean, 10.0, expected)
    assert count == pytest.approx(number, abs=0.1 * number)
    left, right = (seen.uv[:count, 0] - beside_px).min(), (seen.uv[:count, 0] - beside_px).max()
    assert left == pytest.approx((expected.uv[:number, 0] - more).min(), abs=6.0)
    assert right == pytest.approx((expected.uv[:number, 0] - more).max(), abs=6.0)
    within = ((seen.uv[:count, 0] >= beside_px) & (seen.uv[:count, 0] < beside_px + 208)).sum()
    plain = predict(edges, lens_table(CAMERA), prior.mean, 10.0, expected)
    assert within == pytest.approx(plain, abs=0.25 * plain)
