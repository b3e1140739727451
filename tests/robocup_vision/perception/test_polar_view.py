"""The unrolled frame: where samples lie, what they show, and what the mask takes away."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from strategies import cameras

from robocup_vision.perception.polar_view import RADII, PolarView


def with_mask(camera, *shapes):
    width, height = camera.size_px
    mask = np.zeros((height, width), dtype=np.uint8)
    for (u0, v0), (u1, v1) in shapes:
        cv2.line(mask, (u0, v0), (u1, v1), 255, 3)
    return mask


@given(cameras())
def test_samples_lie_where_the_camera_says(camera):
    view = PolarView(camera, 40)
    assert view.pixels.shape == (40, RADII, 2)
    radius = np.hypot(*(view.pixels - camera.center_px).transpose(2, 0, 1))
    np.testing.assert_allclose(radius, np.broadcast_to(view.radius_px, radius.shape))
    bearing = camera.image_bearing_rad(view.pixels)
    np.testing.assert_allclose(np.cos(bearing - view.bearing_rad[:, None]), 1.0)
    np.testing.assert_array_equal(view.floor_m, camera.pixel_to_floor(view.pixels))
    width, height = camera.size_px
    u, v = view.pixels[..., 0], view.pixels[..., 1]
    np.testing.assert_array_equal(view.valid > 0, (u >= 0) & (v >= 0) & (u <= width - 1) & (v <= height - 1))


def test_a_ramp_is_unrolled_to_its_own_values(paper_camera):
    v, u = np.mgrid[:220, :256]
    ramp = np.stack([u / 2, v / 2, 255 - u / 2], axis=-1)
    view = PolarView(paper_camera)
    samples = view.sample(np.round(ramp).astype(np.uint8))
    pixels = view.pixels
    expected = np.stack([pixels[..., 0] / 2, pixels[..., 1] / 2, 255 - pixels[..., 0] / 2], axis=-1)
    # away from the rims, where the average is one-sided
    off = np.abs(samples - expected)[1:-1, 1:-1][view.valid[1:-1, 1:-1] > 0]
    assert off.max() < 1.5


def test_the_frames_edge_does_not_darken_the_samples_beside_it(paper_camera):
    view = PolarView(paper_camera)
    assert not view.valid.all()
    blurred = view.sample(np.full((220, 256, 3), 200, dtype=np.uint8))
    assert (blurred == 200).all()


@pytest.mark.parametrize("direction", [(255, 109), (127, 0), (200, 0)])
def test_what_lies_under_the_mask_reaches_no_valid_sample(paper_camera, direction):
    mask = with_mask(paper_camera, ((127, 109), direction))
    view = PolarView(paper_camera, mask=mask)
    frame = np.full((220, 256, 3), 90, dtype=np.uint8)
    before = view.sample(frame)
    frame[mask > 0] = 255
    after = view.sample(frame)
    assert (after != before).any()
    np.testing.assert_array_equal(after[view.valid > 0], before[view.valid > 0])
    # and it takes no more than it must: the strut's own bearing and a few on both sides
    assert 0.95 < view.valid.sum() / PolarView(paper_camera).valid.sum() < 1.0
