"""Selective refinement: the first undecided floor on the optimistic path, and paths as short as if all was known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.planning.gaze.selective_look import SelectiveLook

CELL_M, RADIUS_M, HALF_VIEW_RAD = 0.1, 0.15, math.radians(10)
SHAPE = (40, 20)
START, GOAL = (0.25, 1.05), (3.75, 1.05)


def _map(no_go: tuple[slice, slice] | None = None, undecided: tuple[slice, slice] | None = None):
    free, blocked = np.ones(SHAPE, bool), np.zeros(SHAPE, bool)
    if undecided is not None:
        free[undecided] = False
    if no_go is not None:
        free[no_go], blocked[no_go] = False, True
    return free, blocked


def _planner() -> SelectiveLook:
    return SelectiveLook(CELL_M, RADIUS_M, HALF_VIEW_RAD)


def test_free_way_needs_no_look() -> None:
    chosen = _planner().choose(*_map(), (0.0, 0.0), START, GOAL)
    assert chosen.answer == "go"
    assert chosen.at_m is None
    assert chosen.length_m == pytest.approx(3.5)
    assert chosen.sure_m == chosen.length_m
    assert chosen.path_m[[0, -1]] == pytest.approx(np.array([START, GOAL]))
    assert chosen.reason == "go: 3.50 m, all of it free"


def test_looks_at_the_first_doubt_on_the_way_alone() -> None:
    free, no_go = _map(undecided=np.s_[20:22, :])
    free[30:32, :] = False
    free[5:8, 0:3] = False  # nearer, but beside the way
    chosen = _planner().choose(free, no_go, (0.0, 0.0), START, GOAL)
    assert chosen.answer == "look"
    assert chosen.at_m == pytest.approx((2.05, 1.05))
    # up to where the robot's rim touches it
    assert chosen.sure_m == pytest.approx(2.05 - 0.1 - START[0], abs=0.01)
    assert chosen.reason == "look at (2.05, 1.05), 1.80 m off: the first undecided floor on a way of 3.50 m"


def test_doubt_is_avoided_where_it_costs_nothing() -> None:
    free, no_go = _map(undecided=np.s_[18:24, 10:12])
    around = _planner().choose(free, no_go, (0.0, 0.0), START, (3.75, 1.55))
    assert around.answer == "go"
    assert around.length_m == pytest.approx(3.0 + 0.5 * math.sqrt(2), abs=0.01)


def test_what_is_hidden_is_not_looked_at() -> None:
    # a wall with a gap at its upper end; all behind it is undecided
    free, no_go = _map(no_go=np.s_[15:17, 0:16], undecided=np.s_[17:, 0:16])
    chosen = _planner().choose(free, no_go, (0.0, 0.0), START, (2.05, 0.55))
    assert chosen.answer == "go"
    assert chosen.sure_m < chosen.length_m
    assert chosen.reason == f"go: {chosen.length_m:.2f} m, of which {chosen.length_m - chosen.sure_m:.2f} m " + (
        "must be seen from nearer"
    )


def test_two_looks_from_one_place_are_enough() -> None:
    planner, grids = _planner(), _map(undecided=np.s_[20:22, :])
    for _ in range(2):
        chosen = planner.choose(*grids, (0.0, 0.0), START, GOAL)
        assert chosen.at_m == pytest.approx((2.05, 1.05))
        planner.observe(chosen.at_m, START)
    assert planner.choose(*grids, (0.0, 0.0), START, GOAL).answer == "go"
    # from elsewhere it is worth another one
    assert planner.choose(*grids, (0.0, 0.0), (0.75, 1.05), GOAL).answer == "look"
    planner.forget()
    assert planner.choose(*grids, (0.0, 0.0), START, GOAL).answer == "look"


def test_no_way_at_all() -> None:
    chosen = _planner().choose(*_map(no_go=np.s_[20:22, :]), (0.0, 0.0), START, GOAL)
    assert chosen.answer == "blocked"
    assert chosen.length_m == math.inf
    assert chosen.path_m.shape == (0, 2)
    # a goal within reach of what is blocked
    beside = _planner().choose(*_map(no_go=np.s_[37:38, 12:13]), (0.0, 0.0), START, (3.75, 1.15))
    assert beside.answer == "blocked"


def test_leaves_what_is_too_near_but_not_through_it() -> None:
    # the robot's rim is over a thin wall that spans the field, but for a gap at its upper end
    wall = np.s_[11:12, 0:16]
    inside = _planner().choose(*_map(no_go=wall), (0.0, 0.0), (1.05, 1.05), GOAL)
    assert inside.answer == "go"
    assert inside.path_m[:, 1].max() > 1.7
    assert _planner().choose(*_map(no_go=np.s_[11:12, :]), (0.0, 0.0), (1.05, 1.05), GOAL).answer == "blocked"


def test_holds_to_a_path_until_another_is_clearly_shorter() -> None:
    planner = _planner()

    def lowest(chosen) -> float:
        return float(chosen.path_m[:, 1].min())

    # a block in the way, a cell less to go round it below than above
    first = planner.choose(*_map(no_go=np.s_[15:25, 8:14]), (0.0, 0.0), START, GOAL)
    assert lowest(first) == pytest.approx(0.65)
    # now above is shorter by a cell to either side, 2 % of the way
    shrunk = _map(no_go=np.s_[15:25, 8:12])
    assert lowest(_planner().choose(*shrunk, (0.0, 0.0), START, GOAL)) == pytest.approx(1.05)
    held = planner.choose(*shrunk, (0.0, 0.0), START, GOAL)
    assert held.path_m == pytest.approx(first.path_m)
    # from a step along it, its rest
    x, y = first.path_m[3].tolist()
    assert planner.choose(*shrunk, (0.0, 0.0), (x, y), GOAL).path_m == pytest.approx(first.path_m[3:])
    # by 7 %, and it is taken; likewise for another goal, or when the old path cannot be gone
    assert lowest(planner.choose(*_map(no_go=np.s_[15:25, 8:10]), (0.0, 0.0), START, GOAL)) == pytest.approx(1.05)
    planner.forget()
    planner.choose(*_map(no_go=np.s_[15:25, 8:14]), (0.0, 0.0), START, GOAL)
    assert lowest(planner.choose(*shrunk, (0.0, 0.0), START, (3.65, 1.05))) == pytest.approx(1.05)
    planner.choose(*_map(no_go=np.s_[15:25, 8:14]), (0.0, 0.0), START, GOAL)
    assert lowest(planner.choose(*_map(no_go=np.s_[15:25, 2:12]), (0.0, 0.0), START, GOAL)) == pytest.approx(1.05)


def test_map_may_lie_anywhere() -> None:
    grids = _map(undecided=np.s_[20:22, :])
    here = _planner().choose(*grids, (0.0, 0.0), START, GOAL)
    moved = _planner().choose(*grids, (-2.0, 1.0), (START[0] - 2, START[1] + 1), (GOAL[0] - 2, GOAL[1] + 1))
    assert moved.at_m == pytest.approx((here.at_m[0] - 2, here.at_m[1] + 1))
    assert moved.path_m == pytest.approx(here.path_m + np.array([-2.0, 1.0]))


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_looks_end_in_a_path_as_short_as_if_all_was_known(seed: int) -> None:
    rng = np.random.default_rng(seed)
    true_no_go = np.zeros(SHAPE, bool)
    for _ in range(8):
        i, j = int(rng.integers(6, 34)), int(rng.integers(0, 20))
        true_no_go[i : i + 2, j : j + 2] = True
    known = rng.random(SHAPE) < 0.3
    best = _planner().choose(~true_no_go, true_no_go, (0.0, 0.0), START, GOAL)
    planner = _planner()
    for _ in range(200):
        chosen = planner.choose(known & ~true_no_go, known & true_no_go, (0.0, 0.0), START, GOAL)
        assert chosen.length_m <= best.length_m * 1.001 + 1e-9
        if chosen.at_m is None:
            break
        i, j = (int(v / CELL_M) for v in chosen.at_m)
        assert not known[i, j]
        known[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] = True
    else:
        pytest.fail("never done looking")
    if chosen.sure_m == chosen.length_m and math.isfinite(best.length_m):
        assert chosen.length_m == pytest.approx(best.length_m, rel=2e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"robot_m": (-0.1, 1.0)}, "robot and target must be on the map"),
        ({"target_m": (4.0, 1.0)}, "robot and target must be on the map"),
        ({"free": np.ones((3, 3), bool)}, r"grids of one size, got \(3, 3\) and \(40, 20\)"),
        ({"no_go": np.ones(SHAPE, bool)}, "cannot be both free and blocked"),
    ],
)
def test_refuses(change: dict, message: str) -> None:
    free, no_go = _map()
    given = {"free": free, "no_go": no_go, "corner_m": (0.0, 0.0), "robot_m": START, "target_m": GOAL, **change}
    with pytest.raises(ArgumentError, match=message):
        _planner().choose(**given)


@pytest.mark.parametrize("values", [(0.0, 0.1, 0.1), (0.1, -1.0, 0.1), (0.1, 0.1, math.inf)])
def test_refuses_sizes(values: tuple[float, float, float]) -> None:
    with pytest.raises(ArgumentError, match="must be positive"):
        SelectiveLook(*values)
