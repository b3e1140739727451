"""Ways through a grid against SciPy's Dijkstra, and laws of their straight parts."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.kernels.motion.way_grid import (
    BLOCKED,
    FREE,
    MarkRules,
    RangesInGrid,
    dearest_between,
    find_way,
    mark_view,
    note_try,
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


@given(seeds, st.floats(-3, SIZE + 3), st.floats(-3, SIZE + 3), st.floats(0, 6))
def test_a_try_counts_within_a_disc_where_the_floor_is_not_open(seed, x, y, radius):
    tried = np.zeros((SIZE, SIZE), np.float32)
    price = np.random.default_rng(seed).choice([1.0, 1.2, 300.0], (SIZE, SIZE)).astype(np.float32)
    note_try(tried, price, x, y, radius)
    rows, columns = np.mgrid[:SIZE, :SIZE]
    np.testing.assert_array_equal(tried, (price > 1) & ((columns - x) ** 2 + (rows - y) ** 2 <= radius * radius))


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
    reached, after = straight_part(price, come_from, start, goal, start % SIZE, start // SIZE, 3)
    k = way.index(reached)
    assert k >= min(1, len(way) - 1)
    assert after == way[min(k + 3, len(way) - 1)]
    dearest = max(float(price.ravel()[cell]) for cell in way[: k + 1])
    straight = dearest_between(price, start % SIZE, start // SIZE, reached % SIZE, reached // SIZE)
    # the first step is taken whatever it costs
    assert k == 1 or straight <= dearest + 1e-3
