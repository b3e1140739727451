"""The compiled loops over the grid of ways against plain NumPy twins, SciPy's Dijkstra, and laws."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.motion.way_grid import (
    BLOCKED,
    FREE,
    UNSEEN,
    MarkRules,
    PriceRules,
    RangesInGrid,
    dearest_between,
    find_way,
    mark_view,
    note_try,
    price_cells,
    split_blocked,
    straight_part,
)

seeds = st.integers(0, 2**32 - 1)
SIZE = 24
MARK, PRICE = MarkRules(1.03, 1.5), PriceRules(2.0, 5.0, 50.0, 1000.0, 15.0, 1.0, 0.995)


def mark_twin(state, seen_from, x, y, theta, bearing, ranges, least, reach, thickness):
    state, seen_from = state.copy(), seen_from.copy()
    rows, columns = np.mgrid[: len(state), : len(state)]
    r = np.hypot(columns - x, rows - y)
    step = bearing[1] - bearing[0]
    angle = np.arctan2(rows - y, columns - x) - (bearing[0] - step / 2 + theta)
    index = ((angle % math.tau) / step).astype(int)
    end = np.where(index < len(bearing), ranges[np.minimum(index, len(bearing) - 1)], np.nan)
    free, blocked = (r <= reach) & (r < end), (r <= reach) & (r >= end) & (r < end + thickness)
    far = np.maximum(r, least)
    for now, where in ((FREE, free), (BLOCKED, blocked)):
        again = where & (state == now)
        overruled = where & ~again
        if now == BLOCKED:
            overruled &= (state == UNSEEN) | (far <= MARK.overrule_ratio * seen_from)
        seen_from[again] = np.minimum(seen_from * (MARK.fading if now == FREE else 1.0), far)[again]
        seen_from[overruled] = far[overruled]
        state[overruled] = now
    return state, seen_from


@settings(deadline=None, max_examples=40)
@given(seeds)
def test_views_are_marked_as_numpy_marks_them(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 20))
    width = rng.choice([math.tau, 1.5])
    bearing = (np.arange(count) + 0.5) * width / count + rng.uniform(-4, 4)
    ranges = rng.uniform(0, 14, count)
    ranges[rng.random(count) < 0.2] = rng.choice([np.nan, np.inf])
    state = rng.integers(0, 3, (SIZE, SIZE), dtype=np.uint8)
    seen_from = rng.uniform(0, 15, (SIZE, SIZE)).astype(np.float32)
    place = (*rng.uniform(4, 20, 2), rng.uniform(-4, 4))
    expected = mark_twin(state, seen_from, *place, bearing, ranges, 3.0, 11.0, 2.5)
    mark_view(state, seen_from, RangesInGrid(*place, bearing, ranges), 3.0, 11.0, 2.5, MARK)
    # in a cell on the very edge between two sectors rounding decides
    assert (state != expected[0]).sum() <= 1
    agree = state == expected[0]
    assert (~np.isclose(seen_from, expected[1], rtol=1e-4))[agree].sum() <= 1


def price_twin(away_any, away_sure, tried, radius, spare, soft):
    gap = away_any - 0.5
    open_floor = 1 + PRICE.tight * np.clip((radius + soft - gap) / soft, 0, None) ** 2
    price = np.where(gap < radius, PRICE.shut + PRICE.maybe_barred * (1 - gap / radius) ** 2, open_floor)
    lack = (radius + spare - away_sure + 0.5) / (radius + spare)
    price = np.where(lack > 0, np.maximum(price, PRICE.shut + PRICE.barred * lack**2), price)
    return price + PRICE.tried * np.maximum(tried - PRICE.tries, 0)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_prices_are_those_numpy_reckons(seed):
    rng = np.random.default_rng(seed)
    away_any = rng.uniform(0, 12, (SIZE, SIZE)).astype(np.float32)
    away_sure = (away_any + rng.uniform(0, 4, (SIZE, SIZE))).astype(np.float32)
    tried = rng.uniform(0, 2 * PRICE.tries, (SIZE, SIZE)).astype(np.float32)
    before, price = tried.copy(), np.empty((SIZE, SIZE), np.float32)
    price_cells(away_any, away_sure, tried, 5.0, 0.5, 2.5, PRICE, price)
    expected = price_twin(away_any.astype(float), away_sure.astype(float), before.astype(float), 5.0, 0.5, 2.5)
    # at the rim of what is shut the price jumps
    clear = np.abs(away_any - 5.5) > 1e-4
    np.testing.assert_allclose(price[clear], expected[clear], rtol=1e-4)
    np.testing.assert_allclose(tried, PRICE.remembered * before, rtol=1e-5)
    assert (price >= 1).all()


@settings(deadline=None, max_examples=30)
@given(seeds, st.floats(-3, SIZE + 3), st.floats(-3, SIZE + 3), st.floats(0, 6))
def test_a_try_counts_within_a_disc_where_the_floor_is_not_open(seed, x, y, radius):
    tried = np.zeros((SIZE, SIZE), np.float32)
    price = np.random.default_rng(seed).choice([1.0, 1.2, 300.0], (SIZE, SIZE)).astype(np.float32)
    note_try(tried, price, x, y, radius)
    rows, columns = np.mgrid[:SIZE, :SIZE]
    np.testing.assert_array_equal(tried, (price > 1) & ((columns - x) ** 2 + (rows - y) ** 2 <= radius * radius))


def test_only_what_was_seen_from_near_is_surely_blocked():
    state = np.array([[BLOCKED, BLOCKED], [FREE, UNSEEN]], dtype=np.uint8)
    seen_from = np.array([[3, 8], [3, 0]], dtype=np.float32)
    open_any, open_sure = np.empty((2, 2), np.uint8), np.empty((2, 2), np.uint8)
    split_blocked(state, seen_from, 5.0, open_any, open_sure)
    np.testing.assert_array_equal(open_any, [[0, 0], [1, 1]])
    np.testing.assert_array_equal(open_sure, [[0, 1], [1, 1]])


def ways(seed, size=SIZE):
    rng = np.random.default_rng(seed)
    price = np.where(rng.random((size, size)) < 0.3, rng.uniform(5, 100, (size, size)), 1.0).astype(np.float32)
    start, goal = rng.integers(0, size * size, 2).tolist()
    come_from, cost = np.empty(size * size, np.int32), np.empty(size * size, np.float32)
    find_way(price, start, goal, come_from, cost)
    return price, start, goal, come_from, cost


@settings(deadline=None, max_examples=25)
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


@settings(deadline=None, max_examples=40)
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
