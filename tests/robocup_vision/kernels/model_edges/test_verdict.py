"""Found, hidden or missing, and line points explained: against plain NumPy on planted samples."""

import numpy as np
import pytest

from robocup_vision.camera.lens_table import lens_table
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.camera.projection import camera_rotation
from robocup_vision.kernels.model_edges.tables import (
    EDGE,
    FOUND,
    HIDDEN,
    MISSING,
    ON_FLOOR,
    RIDGE,
    UNKNOWNS,
    UNSEEN,
    UPRIGHT,
    empty_room,
)
from robocup_vision.kernels.model_edges.verdict import SURE_PX, explained, judge
from robocup_vision.localization.model_edges.settings import EdgeSettings

COUNT = 80
NUMBERS = EdgeSettings().for_width(208, 0.025)
CAMERA = PinholeCamera((104, 80), (90.0, 92.0), (51.0, 41.0), height_m=0.25, tilt_rad=0.0)
# blue, green, red, noise, fraction
CARPET = np.array([45.0, 125.0, 42.0, 2.0, 0.8])


def planted(seed):
    """Plant samples of every kind over a picture whose left half is carpet."""
    rng, room = np.random.default_rng(seed), empty_room(COUNT, COUNT)
    image = rng.integers(0, 256, (80, 104, 3)).astype(np.uint8)
    image[:, :52] = CARPET[:3]
    samples, found = room.samples, room.found
    samples.uv[:] = rng.uniform((-2.0, -2.0), (106.0, 82.0), (COUNT, 2))
    angle = rng.uniform(0.0, 2 * np.pi, COUNT)
    samples.normal[:] = np.column_stack([np.cos(angle), np.sin(angle)])
    samples.width_px[:] = rng.uniform(0.3, 12.0, COUNT)
    samples.kind[:] = rng.choice([RIDGE, EDGE], COUNT)
    samples.place[:] = rng.choice([ON_FLOOR, UPRIGHT], COUNT)
    room.rows[:] = rng.normal(0.0, 1.0, room.rows.shape)
    found.candidates[:] = rng.integers(-1, 3, COUNT)
    found.offset_px[:] = rng.uniform(-8.0, 8.0, found.offset_px.shape)
    return image, room, rng.normal(0.0, 0.5, UNKNOWNS), rng


def plain_patch(image, u, v):
    x, y = int(np.rint(u)), int(np.rint(v))
    if not (1 <= x <= image.shape[1] - 2 and 1 <= y <= image.shape[0] - 2):
        return False
    color, known = image[y - 1 : y + 2, x - 1 : x + 2].mean(axis=(0, 1)), CARPET[:3]
    ratio = color.sum() / known.sum()
    difference = np.abs(color / color.sum() - known / known.sum())[[0, 2]]
    return bool(0.45 <= ratio <= 1.6 and (difference < 0.05 + 2.0 * CARPET[3] / color.sum()).all())


def plain_status(image, room, n, expected):
    samples, found = room.samples, room.found
    if found.candidates[n] < 0:
        return UNSEEN
    if (np.abs(found.offset_px[n, : found.candidates[n]] - expected) < NUMBERS.gate_px).any():
        return FOUND
    if samples.kind[n] == RIDGE and samples.width_px[n] < SURE_PX:
        return HIDDEN
    into = expected + (0.5 * min(samples.width_px[n], 8.0) if samples.kind[n] == EDGE else 0.0)
    return MISSING if plain_patch(image, *(samples.uv[n] + into * samples.normal[n])) else HIDDEN


def plainly_in_a_box(pixels, p, boxes):
    """Whether rays meet a box: (N,) bool; of the way along each ray, what lies within the box along each axis."""
    rays = CAMERA.pixel_to_camera_ray(pixels) @ camera_rotation(*p[2:5]).T
    eye = np.array([p[0], p[1], p[5]])
    low, high = boxes[:, None, 0::2], boxes[:, None, 1::2]
    ends = np.sort([(low - eye) / rays, (high - eye) / rays], axis=0)
    return (ends[0].max(axis=-1).clip(0.0) <= ends[1].min(axis=-1)).any(axis=0)


@pytest.mark.parametrize("seed", range(4))
def test_samples_are_judged_as_plainly(seed):
    image, room, z, _ = planted(seed)
    counts = judge(image, CARPET, NUMBERS, room, COUNT, z)
    status = np.array([plain_status(image, room, n, room.rows[n] @ z) for n in range(COUNT)])
    np.testing.assert_array_equal(room.found.status, status)
    assert set(status) == {UNSEEN, FOUND, HIDDEN, MISSING}
    upright = room.samples.place == UPRIGHT
    # a thin line hides nothing, wherever it is
    thin = (room.samples.kind == RIDGE) & (room.samples.width_px < SURE_PX)
    hidden = (status == HIDDEN) & upright & ~thin
    expected = (status == FOUND, status == MISSING, (status == FOUND) & upright, hidden)
    assert counts == tuple(int(np.count_nonzero(one)) for one in expected)


@pytest.mark.parametrize("seed", range(4))
def test_line_points_are_explained_as_plainly(seed):
    _, room, z, rng = planted(seed)
    samples, spacing = room.samples, NUMBERS.spacing_px
    room.points[:, :2] = rng.uniform((0.0, 0.0), (104.0, 80.0), (COUNT, 2))
    off = room.points[:, None, :2] - samples.uv
    across = np.einsum("mnk,nk->mn", off, samples.normal) - room.rows @ z
    along = off[..., 1] * samples.normal[:, 0] - off[..., 0] * samples.normal[:, 1]
    half = np.where(samples.kind == RIDGE, 0.0, 0.5 * samples.width_px)
    on = (np.abs(across - half) < NUMBERS.gate_px + half) & (np.abs(along) < 1.2 * spacing)
    on &= (np.abs(off) <= 2.0 * spacing).all(axis=-1) & (samples.place == ON_FLOOR)
    right = int(np.count_nonzero(on.any(axis=1)))
    assert 0 < right < COUNT
    p = np.array([0.3, -0.2, 0.4, -0.35, 0.02, 0.25, 0.0])
    # a net, and the floor beyond the lines
    boxes = np.array([[1.0, 1.5, -0.5, 0.8, 0.0, 0.4], [2.0, 9.0, -9.0, 9.0, -1e-6, 1e-6]])
    rest = ~on.any(axis=1)
    silent = int(np.count_nonzero(plainly_in_a_box(room.points[:, :2], p, boxes) & rest))
    assert 0 < silent < np.count_nonzero(rest)
    lens, gates = lens_table(CAMERA), (NUMBERS.spacing_px, NUMBERS.gate_px)
    assert explained(room, COUNT, COUNT, z, *gates, boxes, lens, p) == (right, silent)
    assert explained(room, COUNT, COUNT, z, *gates, boxes[:0], lens, p) == (right, 0)
