"""Edges along lines of sight, drawn where they are known to be."""

import math

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.kernels.floor.radial_edges import EdgeSearch, Rays, radial_edges

seeds = st.integers(0, 2**32 - 1)
NO_MASK = np.empty((0, 0), dtype=np.uint8)
# channels that one colour of the floor and one of a wall may have
FLOOR, WALL = (50, 130, 45), (228, 232, 225)


def disc(radius, floor, wall, blur, center=(80.0, 80.0), size=161):
    fine = 4
    v, u = (np.mgrid[: size * fine, : size * fine] + 0.5) / fine - 0.5
    inside = np.hypot(u - center[0], v - center[1])[..., None] < radius
    image = np.where(inside, np.float32(floor), np.float32(wall)).reshape(size, fine, size, fine, 3).mean(axis=(1, 3))
    return cv2.GaussianBlur(image, (0, 0), blur)


def edges_of(frame, start, *, hidden=NO_MASK, min_contrast=10.0, count=160):
    angle = np.arange(count) * math.tau / count
    out = np.empty(count)
    starts = np.full(count, float(start))
    rays = Rays(80.0, 80.0, np.cos(angle), np.sin(angle), starts)
    radial_edges(frame, hidden, rays, EdgeSearch(1.04, 0.013, min_contrast), out)
    return out


@given(
    st.floats(30, 60),
    st.floats(0.5, 1.1),
    st.floats(-1.2, 0.4),
    st.sampled_from([(1, 1, 1), (0.8, 0.95, 1.25), (1.25, 0.95, 0.8), (0.4, 0.4, 0.4), (1.0, 1.15, 1.2)]),
)
def test_a_drawn_edge_is_found_to_a_small_part_of_a_pixel_under_any_light(radius, blur, off, cast):
    frame = np.clip(disc(radius, FLOOR, WALL, blur) * cast, 0, 255).astype(np.uint8)
    found = edges_of(frame, radius - 1.0 + off)
    assert np.isfinite(found).all()
    # the blur of a curved edge moves it inwards a little; truncation to bytes darkens by half a count
    assert abs(np.mean(found) - radius) < 0.12
    assert np.abs(found - radius).max() < 0.3


def test_no_edge_in_a_uniform_frame_nor_below_the_contrast():
    flat = np.full((161, 161, 3), 90, dtype=np.uint8)
    assert np.isnan(edges_of(flat, 45.0)).all()
    # a picture without any noise asks for no contrast
    assert np.isnan(edges_of(flat, 45.0, min_contrast=0.0)).all()
    faint = disc(45.0, (50, 130, 45), (53, 133, 48), 0.7).astype(np.uint8)
    assert np.isnan(edges_of(faint, 44.0)).all()


def test_an_edge_that_needs_pixels_beyond_the_frame_is_none():
    frame = disc(78.0, FLOOR, WALL, 0.7).astype(np.uint8)
    assert np.isnan(edges_of(frame, 77.0)[[0, 40, 80, 120]]).all()


def test_what_lies_under_the_mask_changes_no_edge():
    frame = disc(45.0, FLOOR, WALL, 0.7).astype(np.uint8)
    mask = np.zeros((161, 161), dtype=np.uint8)
    cv2.line(mask, (80, 80), (160, 120), 1, 3)
    hidden = cv2.dilate(mask, np.ones((3, 3), np.uint8))
    before = edges_of(frame, 44.0, hidden=hidden)
    frame[mask > 0] = np.random.default_rng(0).integers(0, 256, (int(mask.sum()), 3))
    np.testing.assert_array_equal(edges_of(frame, 44.0, hidden=hidden), before)
    assert 0 < np.isnan(before).sum() < 20
