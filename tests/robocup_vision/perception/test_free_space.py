"""Free ranges from polar cells: counting equals the paper's labelling, and errs only towards the robot."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage.measure import label
from strategies import cameras

from field_models.errors import ArgumentError
from robocup_vision.perception.free_space import FreeSpaceGrid
from robocup_vision.perception.polar_view import BODY_COLUMNS, PolarView
from robocup_vision.vision import Vision
from sim2d.rendering.cameras import sekimori_camera

VIEW = PolarView(sekimori_camera())
seeds = st.integers(0, 2**32 - 1)
grids = st.builds(
    lambda directions, rings, threshold: FreeSpaceGrid(VIEW, directions, rings, threshold),
    st.integers(3, 100),
    st.one_of(
        st.integers(1, 40),
        st.lists(st.floats(0.1, 4.0), min_size=2, max_size=12, unique=True).map(lambda r: tuple(sorted(r))),
    ),
    st.floats(0.05, 1.0),
)


def blobs(seed, shape=VIEW.valid.shape):
    rng = np.random.default_rng(seed)
    passable = np.ones(shape, dtype=np.uint8)
    for _ in range(rng.integers(0, 12)):
        k, m = rng.integers(0, shape[0]), rng.integers(0, shape[1])
        passable[np.arange(k, k + rng.integers(1, 20)) % shape[0], m : m + rng.integers(1, 20)] = 0
    passable[rng.random(shape) < rng.choice([0.0, 0.02, 0.2])] = 0
    return passable * rng.integers(1, 4, shape, dtype=np.uint8)


def measure_by_labelling(grid, passable):
    """Free ranges the paper's way: AND with the template of cells, label, add up areas per cell (eqs. 7-9).

    Pieces of different cells never join, whatever lies between the cells.
    """
    labels = label(np.where(passable > 0, grid.cell, -1), background=-1, connectivity=1)
    area = np.bincount(labels.ravel())
    where = np.zeros(len(area), dtype=np.int64)
    where[labels.ravel()] = grid.cell.ravel()
    rings = len(grid.ring_bounds_m) - 1
    free, total = (
        np.zeros(rings * grid.directions),
        np.bincount(grid.cell[grid.cell >= 0], minlength=rings * grid.directions),
    )
    np.add.at(free, where[1:], area[1:])
    needed = np.ceil(total * grid.threshold - 1e-6).reshape(rings, -1)
    in_view = ((np.arange(rings) + 1)[:, None] * (needed > 0)).max(axis=0)
    blocked = free.reshape(rings, -1) < needed
    first = np.where(blocked.any(axis=0), blocked.argmax(axis=0), in_view)
    return grid.ring_bounds_m[np.minimum(first, in_view)]


@given(grids, seeds)
def test_counting_equals_the_papers_labelling(grid, seed):
    passable = blobs(seed)
    np.testing.assert_array_equal(grid.measure(passable).range_m, measure_by_labelling(grid, passable))


@given(cameras(), st.integers(3, 90), st.integers(1, 30))
def test_cells_hold_the_samples_that_lie_in_them(camera, directions, rings):
    grid = FreeSpaceGrid(PolarView(camera), directions, rings)
    bounds, floor = grid.ring_bounds_m, grid.view.floor_m
    assert (np.diff(bounds) > 0).all()
    assert (np.diff(grid.bearing_rad) > 0).all()
    k, m = np.nonzero(grid.cell >= 0)
    ring, direction = np.divmod(grid.cell[k, m], directions)
    x, y = floor[k, m].T
    assert (np.hypot(x, y) >= bounds[ring] - 1e-9).all()
    assert (np.hypot(x, y) <= bounds[ring + 1] + 1e-9).all()
    off = (np.arctan2(y, x) - grid.bearing_rad[direction] + math.pi) % math.tau - math.pi
    assert np.abs(off).max(initial=0.0) <= math.pi / directions + 1e-9
    assert (grid.view.valid[k, m] > 0).all()
    assert (m >= BODY_COLUMNS).all()


def test_all_blocked_and_all_free():
    grid = FreeSpaceGrid(VIEW, 40, 10)
    nothing = np.zeros(VIEW.valid.shape, dtype=np.uint8)
    np.testing.assert_array_equal(grid.measure(nothing).range_m, grid.ring_bounds_m[0])
    everywhere = grid.measure(nothing + 1).range_m
    # above and below, the frame ends before the mirror does
    assert np.median(everywhere) == grid.ring_bounds_m[-1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"directions": 2}, "directions must be at least 3, got 2"),
        ({"rings": 0}, "rings must be at least 1, got 0"),
        ({"rings": (0.3,)}, r"rings must be at least two increasing ranges in metres, got \[0.3\]"),
        ({"rings": (0.3, 0.3)}, "rings must be at least two increasing"),
        ({"rings": (-0.1, 0.3)}, "rings must be at least two increasing"),
        ({"rings": (0.1, math.nan)}, "rings must be at least two increasing"),
        ({"threshold": 0.0}, "threshold must be within 0 to 1, got 0.0"),
        ({"threshold": 1.5}, "threshold must be within 0 to 1, got 1.5"),
    ],
)
def test_wrong_grids_are_reported(options, message):
    with pytest.raises(ArgumentError, match=message):
        FreeSpaceGrid(VIEW, **options)


def test_rendered_ranges_are_near_the_truth_and_on_the_safe_side(ssl_field, paper_camera, nominal_samples):
    vision = Vision(ssl_field, paper_camera)
    within, beyond, count = 0, 0, 0
    for one in nominal_samples:
        vision.forget()
        found = vision.look(one.frame).free_space
        half = math.pi / len(found.bearing_rad)
        inside = found.bearing_rad[:, None] + np.linspace(-half, half, 9)
        truth = one.scene.free_range_m(one.pose, inside.ravel()).reshape(inside.shape)
        bounds = vision.grid.ring_bounds_m
        near, far = truth.min(axis=1), truth.max(axis=1)
        ring = np.clip(np.searchsorted(bounds, found.range_m) + 1, 0, len(bounds) - 1)
        below = bounds[np.maximum(np.searchsorted(bounds, found.range_m) - 1, 0)]
        seen = near < bounds[-2]
        within += ((below <= far) & (bounds[ring] >= near))[seen].sum()
        beyond += (found.range_m > bounds[np.minimum(np.searchsorted(bounds, far) + 1, len(bounds) - 1)])[seen].sum()
        count += seen.sum()
    assert within / count > 0.95
    assert beyond / count < 0.01
