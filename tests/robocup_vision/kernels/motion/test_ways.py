"""Ways over a grid, and how a robot follows one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from steering_twins import plain_positions

from robocup_vision.kernels.motion import path_following as kernels
from robocup_vision.kernels.motion.way_grid import (
    BLOCKED,
    FREE,
    MarkRules,
    RangesInGrid,
    dearest_between,
    find_way,
    mark_view,
    straight_part,
)

seeds = st.integers(0, 2**32 - 1)
SIZE = 24


@pytest.mark.parametrize(("views", "mark"), [(0, FREE), (30, BLOCKED)])
def test_floor_seen_from_near_is_overruled_from_far_once_others_may_have_entered_it(views, mark):
    state, seen_from = np.full((SIZE, SIZE), FREE, np.uint8), np.full((SIZE, SIZE), 3.0, np.float32)
    bearing = (np.arange(36) + 0.5) * math.tau / 36 - math.pi
    for range_cells in (*[20.0] * views, 9.5):
        ranges = RangesInGrid(4.0, 12.0, 0.0, bearing, np.full(36, range_cells))
        mark_view(state, seen_from, ranges, 1.0, 15.0, 2.0, MarkRules(1.03, 1.5))
    # ten cells from the robot: 1.5 times 3 cells is less, 1.5 times 3 * 1.03^30 is more
    assert state[12, 14] == mark


def ways(seed, size=SIZE):
    rng = np.random.default_rng(seed)
    price = np.where(rng.random((size, size)) < 0.3, rng.uniform(5, 100, (size, size)), 1.0).astype(np.float32)
    start, goal = rng.integers(0, size * size, 2).tolist()
    come_from, cost = np.empty(size * size, np.int32), np.empty(size * size, np.float32)
    find_way(price, start, goal, come_from, cost)
    return price, start, goal, come_from, cost


@given(seeds)
def test_the_way_is_as_cheap_as_dijkstras(seed):
    sparse = pytest.importorskip("scipy.sparse")
    from scipy.sparse.csgraph import dijkstra

    price, start, goal, _, cost = ways(seed)
    index = np.arange(SIZE * SIZE).reshape(SIZE, SIZE)
    rows, columns, lengths = [], [], []
    for y, x in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = (slice(0, SIZE - y), slice(max(0, -x), SIZE - max(0, x)))
        there = (slice(y, SIZE), slice(max(0, x), SIZE - max(0, -x)))
        rows.append(index[here].ravel())
        columns.append(index[there].ravel())
        lengths.append((math.hypot(x, y) * (price[here] + price[there]) / 2).ravel())
    ends = (np.concatenate(rows), np.concatenate(columns))
    graph = sparse.coo_array((np.concatenate(lengths), ends), shape=(SIZE * SIZE, SIZE * SIZE)).tocsr()
    assert cost[goal] == pytest.approx(dijkstra(graph, directed=False, indices=start)[goal], rel=1e-3)


@given(seeds)
def test_the_straight_part_comes_no_closer_to_anything_than_the_way(seed):
    price, start, goal, come_from, _ = ways(seed)
    way = [goal]
    while way[-1] != start:
        way.append(int(come_from[way[-1]]))
        assert max(abs(way[-1] // SIZE - way[-2] // SIZE), abs(way[-1] % SIZE - way[-2] % SIZE)) <= 1
    way.reverse()
    reached, after = straight_part(price, come_from, start, goal, float(start % SIZE), float(start // SIZE), 3)
    k = way.index(reached)
    assert k >= min(1, len(way) - 1)
    assert after == way[min(k + 3, len(way) - 1)]
    dearest = max(float(price.ravel()[cell]) for cell in way[: k + 1])
    straight = dearest_between(price, start % SIZE, start // SIZE, reached % SIZE, reached // SIZE)
    # the first step is taken whatever it costs
    assert k == 1 or straight <= dearest + 1e-3


PATH = np.array([[0.0, 0.0], [1.0, 0.2], [1.0, 0.2], [1.5, -0.4], [3.0, 0.0]])
LENGTH = np.hypot(*np.diff(PATH, axis=0).T).sum()


def fine_path(count=20001):
    ends = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(PATH, axis=0).T))])
    arcs = np.linspace(0.0, LENGTH, count)
    return arcs, np.stack([np.interp(arcs, ends, PATH[:, k]) for k in (0, 1)], axis=1)


@given(st.floats(-1, 4), st.floats(-1, 1))
def test_the_nearest_point_is_nearer_than_all_others(x, y):
    arcs, points = fine_path()
    away = np.hypot(*(points - (x, y)).T)
    arc, nearest, length = kernels.nearest_on_path(PATH, (x, y))
    assert length == pytest.approx(LENGTH)
    assert nearest == pytest.approx(away.min(), abs=1e-4)
    assert np.hypot(*(np.array(kernels.point_on_path(PATH, arc)) - (x, y))) == pytest.approx(nearest)
    index = np.searchsorted(arcs, arc)
    np.testing.assert_allclose(kernels.point_on_path(PATH, arc), points[min(index, len(points) - 1)], atol=2e-4)


def test_the_command_leads_to_the_point_ahead_and_to_rest_at_the_end():
    x, y = kernels.follow(PATH, (0.0, 0.1), 0.8, 0.3, 1.2)
    ahead = np.array(kernels.point_on_path(PATH, kernels.nearest_on_path(PATH, (0.0, 0.1))[0] + 0.3)) - (0.0, 0.1)
    assert math.hypot(x, y) == pytest.approx(0.8)
    assert math.atan2(y, x) == pytest.approx(math.atan2(ahead[1], ahead[0]))
    assert kernels.follow(PATH, (3.0, 0.0), 0.8, 0.3, 1.2) == (0.0, 0.0)
    near = math.hypot(*kernels.follow(PATH, (2.99, 0.0), 0.8, 0.3, 1.2))
    assert 0.0 < near <= 0.1
    # past the end it comes back at a speed from which it can stop there
    assert kernels.follow(PATH, (3.2, 0.0), 0.8, 0.3, 1.2)[0] < -0.3


def test_a_robot_that_follows_arrives_at_rest():
    place, velocity, pending = (0.0, 0.4), (0.0, 0.0), (0.0, 0.0)
    fastest = 0.0
    for _ in range(300):
        target = kernels.follow(PATH, place, 1.0, 0.35, 2.0)
        place, velocity = kernels.drive(place, velocity, pending, target, 2.0, 0.03, 1 / 30)
        pending = target
        fastest = max(fastest, math.hypot(*velocity))
    np.testing.assert_allclose(place, PATH[-1], atol=0.003)
    assert math.hypot(*velocity) < 0.02
    assert 0.95 < fastest <= 1.0 + 1e-9


@given(seeds)
def test_a_period_is_the_dead_time_with_the_old_command_and_the_rest_with_the_new(seed):
    place, velocity, pending, target = map(tuple, np.random.default_rng(seed).uniform(-1, 1, (4, 2)))
    by_old = plain_positions(place, velocity, pending, 1.5, np.array([0.0, 0.0199999, 0.02]))
    then = (by_old[2] - by_old[1]) / 1e-7
    found, moving = kernels.drive(place, velocity, pending, target, 1.5, 0.02, 0.05)
    by_new = plain_positions(tuple(by_old[2]), tuple(then), target, 1.5, np.array([0.03, 0.0299999]))
    np.testing.assert_allclose(found, by_new[0], atol=1e-5)
    np.testing.assert_allclose(moving, (by_new[0] - by_new[1]) / 1e-7, atol=1e-4)


def clearance(path, place, velocity, pending, covariance, *numbers):
    """Return what the kernel finds with the twin's arguments."""
    *way, discs = numbers
    start = kernels.Start(place, velocity, pending, covariance)
    return kernels.min_clearance(path, start, kernels.Following(*way), discs, 3.0)


NUMBERS = (0.4, 1.5, 0.03, 1 / 30, 0.5)
SLIP = (0.05, 0.1)
STRAIGHT = np.array([[0.0, 0.0], [3.0, 0.0]])


def between_posts(doubt, posts, x=0.0, speed=0.8, slip=SLIP):
    """Clearance of a straight way between posts of 1 cm of doubt."""
    discs = np.array([(*post, 0.18, 1e-4, 0.0, 1e-4) for post in posts])
    moving = (speed, 0.0)
    return clearance(STRAIGHT, (x, 0.0), moving, moving, doubt, speed, *NUMBERS, slip, discs)[0]


@given(seeds)
def test_more_doubt_of_place_or_heading_never_makes_room(seed):
    rng = np.random.default_rng(seed)
    posts = [(1.2, side * rng.uniform(0.3, 0.6)) for side in (-1, 1)]
    x, speed = rng.uniform(0.0, 0.9), rng.uniform(0.3, 1.2)
    small = rng.uniform(0.005, 0.03, 3)
    room = between_posts(np.diag(small**2), posts, x, speed)
    for more in ([2, 1, 1], [1, 2, 1], [1, 1, 3]):
        assert between_posts(np.diag((small * more) ** 2), posts, x, speed) <= room + 1e-9 or room < 0.0


def test_doubt_along_the_way_does_not_hide_that_across():
    """The longer axis lies along the path; the posts of the gap are across, where only the return leads to."""
    posts = [(1.5, -0.24), (1.5, 0.24)]
    vague, sharp = (between_posts(np.diag([0.035, aside, 1e-3]) ** 2, posts, slip=(0.0, 0.0)) for aside in (0.03, 1e-3))
    assert vague < sharp - 0.3


def test_a_heading_that_goes_along_with_the_place_counts_twice():
    """Off to one side and turned to that side is worse than off and turned back."""
    posts = [(1.3, -0.5), (1.3, 0.5)]
    off = np.array([[1e-4, 0.0, 0.0], [0.0, 9e-4, 0.0], [0.0, 0.0, 0.0064]])
    along = off.copy()
    along[1, 2] = along[2, 1] = 0.95 * 0.03 * 0.08
    assert between_posts(along, posts) < between_posts(off, posts) - 0.01


def test_without_discs_there_is_no_end_of_room():
    nothing = clearance(PATH, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), np.eye(3), 1.0, *NUMBERS, SLIP, np.empty((0, 6)))
    assert nothing == (math.inf, -1)
