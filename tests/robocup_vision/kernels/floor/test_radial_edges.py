"""Edges along lines of sight against a plain NumPy twin, and drawn edges of known place."""

import math

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor.radial_edges import EdgeSearch, Rays, radial_edges

seeds = st.integers(0, 2**32 - 1)
NO_MASK = np.empty((0, 0), dtype=np.uint8)
# channels that one colour of the floor and one of a wall may have
FLOOR, WALL = (50, 130, 45), (228, 232, 225)


def bilinear(frame, points):
    """Colours (N, 3) at points (N, 2), with fractions of a pixel rounded to 1/32."""
    u, v = points.T
    x, y = np.floor(u).astype(int), np.floor(v).astype(int)
    fx, fy = (np.floor(np.stack([u - x, v - y]) * 32 + 0.5) / 32)[..., None]
    top = frame[y, x] * (1 - fx) + frame[y, x + 1] * fx
    bottom = frame[y + 1, x] * (1 - fx) + frame[y + 1, x + 1] * fx
    return top * (1 - fy) + bottom * fy


def edge_twin(frame, hidden, center, direction, start, column_step, half_width, min_contrast):
    height, width = frame.shape[:2]
    center, direction = np.array(center), np.array(direction)
    search = math.ceil(column_step + 1)
    reach = search + 3
    near = start + column_step + 0.5 - reach
    far = near + 2 * reach + 5
    ends, aside = center + np.outer([near - 5, far], direction), half_width * far + 1
    if (ends.min(axis=0) < aside).any() or (ends.max(axis=0) + aside >= (width - 1, height - 1)).any():
        return math.nan
    points = center + np.outer(near + np.arange(2 * reach + 1), direction)
    profile = bilinear(frame, points)
    steep = ((profile[2:] - profile[:-2]) ** 2).sum(axis=1)[reach - search - 1 : reach + search]
    place = reach - search + int(np.argmax(steep))
    outer = profile[place + 2 : place + 4].sum(axis=0)
    gain = np.floor((outer - profile[place - 3 : place - 1].sum(axis=0)) / 2)
    contrast2, clear = (gain**2).sum(), outer < 2 * 245
    if contrast2 <= min_contrast**2:
        return math.nan
    clear2 = (gain[clear] ** 2).sum()
    if 10 * clear2 > contrast2 and clear2 > min_contrast**2:
        contrast2, gain = clear2, np.where(clear, gain, 0)
    grey = profile @ gain
    rise = max((grey[place + 1] - grey[place - 1]) / 2, 0.2 * contrast2)
    edge = near + place + np.clip(((grey[place - 2] + grey[place + 2]) / 2 - grey[place]) / rise, -1, 1)
    across = half_width * np.array([-direction[1], direction[0]])
    lines = [center + np.outer(edge + np.arange(-2, 3), direction + side * across) for side in (-1, 1)]
    visited = np.floor(np.vstack([points, *lines])).astype(int)
    if hidden.size and hidden[visited[:, 1], visited[:, 0]].any():
        return math.nan
    middle = int(edge - near + 0.5)
    own = grey[np.clip(np.arange(middle - 3, middle + 4), 0, len(grey) - 1)]
    base = own[:2].mean()
    span = own[5:].mean() - base
    if not span > 0:
        return math.nan
    value = np.concatenate([*(bilinear(frame, line) @ gain for line in lines), own[1:6]])
    at = np.concatenate([np.arange(-2.0, 3.0)] * 2 + [np.arange(-2, 3) + near + middle - edge])
    shift = 0.0
    for _ in range(2):
        x = (at - shift) / 1.75
        inside = np.abs(x) < 1
        x, seen = x[inside], (value[inside] - base) / span
        weight = 1 - x**2
        misfit = (weight * (0.5 + 0.75 * x - 0.25 * x**3 - seen)).sum() / (weight**2).sum()
        shift = np.clip(shift + misfit * 1.75 / 0.75, -1.5, 1.5)
    return edge + shift


@settings(deadline=None, max_examples=25)
@given(seeds, st.booleans())
def test_radial_edges_agree_with_their_twin(seed, masked):
    rng = np.random.default_rng(seed)
    smooth = cv2.GaussianBlur(rng.integers(0, 256, (70, 90, 3), dtype=np.uint8), (0, 0), 2.0)
    frame = np.clip((smooth.astype(int) - 128) * 4 + 150, 0, 255).astype(np.uint8)
    hidden = (rng.random((70, 90)) < 0.01).astype(np.uint8) if masked else NO_MASK
    angles = rng.uniform(0, math.tau, 24)
    start = np.where(rng.random(24) < 0.9, rng.uniform(12.0, 40.0, 24), np.nan)
    center = (44.3, 35.8)
    out = np.empty(24)
    u, v = np.cos(angles), np.sin(angles)
    options = (1.1, 0.02, 20.0)
    radial_edges(frame, hidden, Rays(*center, u, v, start), EdgeSearch(*options), out)
    expected = [
        edge_twin(frame, hidden, center, (u[k], v[k]), start[k], *options) if start[k] > 0 else math.nan
        for k in range(24)
    ]
    np.testing.assert_allclose(out, expected, atol=1e-6)


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


@settings(deadline=None, max_examples=25)
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
