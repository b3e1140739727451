"""The free-space map: its laws, its rule, and what it refuses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from map_cells import cell_centers_m

from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.mapping.occupancy import CROSSED, HIT
from robocup_vision.mapping.occupancy import FREE, NO_GO, UNDECIDED, FreeSpaceMap, FreeSpaceMapSettings
from robocup_vision.mapping.range_profile import RangeProfile
from robocup_vision.mapping.sensor_model import SensorModel, default_sensors

WEAK = SensorModel(0.6, 0.4, reach_m=2.0)
HERE = Pose2(0.013, -0.021, 0.4)


def circle(range_m, *, hit=True, count=120, depth_m=0.0):
    bearing = (np.arange(count) + 0.5) * (math.tau / count) - math.pi
    ranges = np.broadcast_to(np.asarray(range_m, dtype=float), count)
    return RangeProfile(bearing, ranges, np.full(count, hit), depth_m)


def single(model=WEAK, **options):
    made = FreeSpaceMap({"one": model}, FreeSpaceMapSettings(cells=60, cell_m=0.05, **options))
    made.move(HERE)
    return made


def away(grid):
    return np.linalg.norm(cell_centers_m(grid) - (grid.robot.x_m, grid.robot.y_m), axis=-1)


def test_the_measured_cell_is_hit_nearer_ones_crossed_and_farther_ones_without_evidence():
    grid = single()
    evidence, distance = grid.evidence("one", circle(0.9)), away(grid)
    cell = grid.cell_m
    assert (evidence[(distance > cell) & (distance < 0.9 - cell)] == CROSSED).all()
    assert (evidence[distance > 0.9 + cell] == 0).all()
    on_ring = np.abs(distance - 0.9) < cell / 2
    assert (evidence[on_ring] == HIT).all()
    assert (np.abs(distance[evidence == HIT] - 0.9) < cell).all()


def test_a_range_without_a_hit_is_evidence_of_nearer_cells_alone():
    evidence = single().evidence("one", circle(0.9, hit=False))
    assert (evidence != HIT).all()
    assert (evidence == CROSSED).any()


def test_all_of_the_depth_may_hold_what_was_hit():
    grid = single()
    evidence, distance = grid.evidence("one", circle(0.7, depth_m=0.3)), away(grid)
    assert (evidence[(distance > 0.7) & (distance < 1.0)] == HIT).all()


@pytest.mark.parametrize("is_measured", [True, False])
def test_cells_that_a_cone_crosses_in_part_are_not_free(is_measured):
    # one wide cone that ends early, or that nobody measured, between cones that reach far
    grid = single()
    count = 36
    range_m = np.full(count, 1.4)
    range_m[count // 2] = 0.5
    profile = circle(range_m, count=count)
    known = (np.arange(count) != count // 2) | is_measured
    measured = RangeProfile(profile.bearing_rad[known], range_m[known], np.full(known.sum(), True), 0.0)
    evidence = grid.evidence("one", measured)
    low = grid.robot.theta_rad + profile.bearing_rad[count // 2] - math.pi / count
    high = low + math.tau / count
    corners = cell_centers_m(grid)[:, :, None] + grid.cell_m / 2 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    offset = corners - (grid.robot.x_m, grid.robot.y_m)
    bearing = np.arctan2(offset[..., 1], offset[..., 0])
    inside = ((bearing > low) & (bearing < high)).any(axis=-1)
    beyond = np.linalg.norm(offset, axis=-1).max(axis=-1) > 0.5
    told = inside & beyond & (np.linalg.norm(offset, axis=-1).min(axis=-1) < 1.3)
    assert told.any()
    assert (evidence[told] != CROSSED).all()


def test_bearings_without_data_tell_nothing():
    grid = single()
    grid.update("one", circle(np.nan))
    assert (grid.observations("one") == 0).all()
    assert (grid.probability("one") == 0.5).all()
    assert (grid.state == UNDECIDED).all()


def test_log_odds_follow_bayes_rule():
    grid = single(SensorModel(0.7, 0.2, reach_m=2.0))
    grid.update("one", circle(0.9))
    evidence = grid.evidence("one", circle(0.9))
    np.testing.assert_allclose(grid.probability("one")[evidence == HIT], 0.7 / (0.7 + 0.2), rtol=1e-6)
    np.testing.assert_allclose(grid.probability("one")[evidence == CROSSED], 0.3 / (0.3 + 0.8), rtol=1e-6)
    grid.update("one", circle(0.9))
    twice = 0.7**2 / (0.7**2 + 0.2**2)
    np.testing.assert_allclose(grid.probability("one")[evidence == HIT], twice, rtol=1e-6)


@given(st.floats(0.3, 0.95), st.floats(0.05, 0.9), st.floats(0.05, 0.4))
def test_so_many_crossings_as_needed_make_a_cell_free_and_no_fewer(occupied, share, free_below):
    model = SensorModel(occupied, occupied * share, reach_m=2.0)
    grid = single(model, free_below=free_below, clip=free_below / 1e4)
    needed = model.observations_needed(free_below)
    assert grid.looks_to_free == needed
    cell = np.unravel_index(np.argmin(np.abs(away(grid) - 0.5)), (60, 60))
    for _ in range(needed - 1):
        grid.update("one", circle(0.9))
    # at the threshold itself, rounding decides
    reached = math.log(free_below / (1 - free_below)) / model.crossed_step
    if abs(reached - round(reached)) > 1e-3:
        assert grid.state[cell] != FREE
        grid.update("one", circle(0.9))
        assert grid.state[cell] == FREE


def test_clipped_cells_can_be_unlearnt():
    grid = single()
    cell = np.unravel_index(np.argmin(np.abs(away(grid) - 0.5)), (60, 60))
    for _ in range(300):
        grid.update("one", circle(0.9))
    assert grid.probability("one")[cell] == pytest.approx(0.02, rel=1e-4)
    for _ in range(20):
        grid.update("one", circle(0.5))
    assert grid.state[cell] == NO_GO


# what one sensor makes of a cell at 0.5 m, in updates: circles that end there, or beyond
STORIES = {"free": [0.9] * 8, "no_go": [0.5] * 8, "undecided_often": [0.5, 0.9] * 6, "undecided_seldom": [0.9]}


@pytest.mark.parametrize("first", STORIES)
@pytest.mark.parametrize("second", STORIES)
def test_the_rule_is_the_printed_one(first, second):
    grid = FreeSpaceMap({"a": WEAK, "b": WEAK}, FreeSpaceMapSettings(cells=60, cell_m=0.05))
    grid.move(HERE)
    cell = np.unravel_index(np.argmin(np.abs(away(grid) - 0.5)), (60, 60))
    for name, story in (("a", first), ("b", second)):
        for range_m in STORIES[story]:
            grid.update(name, circle(range_m))
        alone = {"free": FREE, "no_go": NO_GO}.get(story, UNDECIDED)
        assert grid.sensor_state(name)[cell] == alone
    is_free = "free" in (first, second) and {first, second} <= {"free", "undecided_often"}
    assert (grid.state[cell] == FREE) == is_free
    assert (grid.state[cell] == NO_GO) == ("no_go" in (first, second))


@given(st.integers(-200, 200), st.integers(-200, 200), st.integers(0, 2**32 - 1))
def test_what_is_seen_does_not_depend_on_where_on_the_field(dx, dy, seed):
    rng = np.random.default_rng(seed)
    # halves are exact, so that cells lie the same way everywhere
    cell = 0.0625
    profile = circle(rng.uniform(0.2, 1.3, 120))
    states = []
    for shift in ((0.0, 0.0), (dx * cell, dy * cell)):
        grid = FreeSpaceMap({"one": WEAK}, FreeSpaceMapSettings(cells=48, cell_m=cell))
        grid.move(Pose2(shift[0] + 0.02, shift[1] + 0.01, 0.3))
        for _ in range(6):
            grid.update("one", profile)
        states.append(grid.state)
    assert (states[0] != states[1]).mean() < 1e-3


@given(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2))
def test_the_window_moves_in_whole_cells_and_keeps_what_stays_in_it(x, y):
    grid = single()
    for _ in range(8):
        grid.update("one", circle(0.9))
    before, places = grid.probability("one"), cell_centers_m(grid)
    grid.move(Pose2(HERE.x_m + x, HERE.y_m + y, 1.0))
    offset = (np.array(grid.corner_m) - (places[0, 0] - grid.cell_m / 2)) / grid.cell_m
    shift = np.rint(offset).astype(int)
    np.testing.assert_allclose(offset, shift, atol=1e-6)
    assert (np.abs(np.array(grid.center) - (grid.robot.x_m, grid.robot.y_m)) <= grid.cell_m + 1e-9).all()
    after = grid.probability("one")
    for i, j in np.ndindex(60, 60):
        a, b = i + shift[0], j + shift[1]
        expected = before[a, b] if 0 <= a < 60 and 0 <= b < 60 else 0.5
        assert after[i, j] == expected


def test_a_window_that_jumps_away_forgets_all():
    grid = single()
    grid.update("one", circle(0.9))
    grid.move(Pose2(100.0, -50.0, 0.0))
    assert (grid.observations("one") == 0).all()


def test_odometry_moves_as_the_pose_it_leads_to():
    step = Pose2(0.3, -0.1, 0.5)
    by_step, by_pose = single(), single()
    by_step.move(odometry=step)
    by_pose.move(HERE.compose(step))
    assert by_step.robot == by_pose.robot
    assert by_step.corner_m == by_pose.corner_m


def test_forget_leaves_nothing():
    grid = single()
    for _ in range(8):
        grid.update("one", circle(0.9))
    assert (grid.state != UNDECIDED).any()
    grid.forget()
    assert (grid.state == UNDECIDED).all()
    assert (grid.observations("one") == 0).all()


def test_what_moves_is_masked_and_the_way_to_it_is_still_free():
    grid = single()
    range_m = np.full(120, 1.3)
    range_m[:40] = 0.8
    profile = circle(range_m)
    direction = HERE.theta_rad + profile.bearing_rad[20]
    x, y = HERE.x_m + 0.9 * math.cos(direction), HERE.y_m + 0.9 * math.sin(direction)
    disc = np.array([[x, y, 0.15]])
    plain, masked = grid.evidence("one", profile), grid.evidence("one", profile, mask=disc)
    distance = np.linalg.norm(cell_centers_m(grid) - (x, y), axis=-1)
    assert (masked[distance < 0.15] == 0).all()
    assert (plain[distance < 0.15] == HIT).any()
    # what the profile meets within a cell of the disc is the mover itself
    assert not (masked[distance < 0.18] == HIT).any()
    changed = plain != masked
    assert (distance[changed] < 0.15 + 3 * grid.cell_m).all()
    halfway = np.linalg.norm(
        cell_centers_m(grid) - (HERE.x_m + 0.4 * math.cos(direction), HERE.y_m + 0.4 * math.sin(direction)), axis=-1
    )
    assert masked[np.unravel_index(halfway.argmin(), halfway.shape)] == CROSSED
    np.testing.assert_array_equal(grid.evidence("one", profile, mask=np.empty((0, 3))), plain)


def test_free_ranges_end_at_what_stands_and_never_beyond():
    grid = single()
    for _ in range(8):
        grid.update("one", circle(0.9))
    bearing = circle(1.0).bearing_rad
    free = grid.free_space(grid.robot, bearing, nearest_m=0.12)
    assert (free.range_m < 0.9).all()
    assert (free.range_m > 0.9 - 3 * grid.cell_m).all()
    # on from elsewhere, along each ray cells are free until there
    robot = Pose2(0.3, 0.2, -1.0)
    free = grid.free_space(robot, bearing, nearest_m=0.12)
    for angle, reach in zip(bearing + robot.theta_rad, free.range_m, strict=True):
        along = np.arange(0.0, reach - 1e-9, 0.01)[:, None] * (math.cos(angle), math.sin(angle))
        cells = np.floor((along + robot.array[:2] - grid.corner_m) / grid.cell_m).astype(int)
        assert (grid.state[cells[:, 0], cells[:, 1]] == FREE).all()
    assert not free.range_m.flags.writeable


def test_nothing_known_is_no_free_space():
    grid = single()
    assert (grid.free_space(HERE, [0.0, 1.0, 2.0]).range_m == 0).all()


def test_the_models_that_come_with_the_project_are_the_default():
    grid = FreeSpaceMap()
    assert grid.sensors == default_sensors()
    assert set(grid.sensors) == {"floor", "range"}
    assert grid.state.shape == (80, 80)
    assert not grid.state.flags.writeable


def test_impossible_uses_are_refused():
    with pytest.raises(ArgumentError, match="at least one sensor"):
        FreeSpaceMap({})
    grid = single()
    with pytest.raises(ArgumentError, match="no sensor 'sonar': they are one"):
        grid.update("sonar", circle(1.0))
    with pytest.raises(ArgumentError, match="either the robot's pose or its odometry"):
        grid.move()
    with pytest.raises(ArgumentError, match="either the robot's pose or its odometry"):
        grid.move(HERE, odometry=HERE)
    with pytest.raises(ArgumentError, match="must be finite"):
        grid.move(Pose2(math.nan, 0.0, 0.0))
    with pytest.raises(ArgumentError, match="rows x, y, radius"):
        grid.update("one", circle(1.0), mask=[[0.0, 1.0]])
    with pytest.raises(ArgumentError, match="inside the map"):
        grid.free_space(Pose2(5.0, 0.0, 0.0), [0.0])
    with pytest.raises(ArgumentError, match="ascend within one turn"):
        grid.free_space(HERE, [1.0, 0.0])
