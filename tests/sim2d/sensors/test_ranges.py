"""Range sensors, and what a map's cells truly hold."""

import math

import numpy as np
import pytest
from map_cells import cell_centers_m

from field_models import load_field
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FreeSpaceMap
from sim2d.rendering.scene import Ball, Box, Robot, Scene
from sim2d.sensors.learning import CellTruth
from sim2d.sensors.range_sensor import RangeSensor

FIELD = load_field("ssl_2001")
EXACT = {"noise_std_m": 0.0, "dropout_rate": 0.0}
POSE = Pose2(-0.2, 0.1, 0.5)


def scan(scene, seed=0, **options):
    return RangeSensor(**options).scan(scene, POSE, np.random.default_rng(seed))


def test_without_noise_it_measures_what_stands_higher_than_its_plane():
    scene = Scene(
        FIELD, boxes=(Box(0.3, 0.1, height_m=0.13), Box(-0.6, 0.1, height_m=0.06)), robots=(Robot(0, -0.4, 0.09),)
    )
    profile = scan(scene, **EXACT)
    high = Scene(FIELD, boxes=scene.boxes[:1], robots=scene.robots)
    np.testing.assert_allclose(profile.range_m, high.free_range_m(POSE, profile.bearing_rad))
    assert profile.hit.all()
    assert (profile.range_m > scene.free_range_m(POSE, profile.bearing_rad) + 0.05).any()


def test_a_plane_over_the_walls_meets_nothing():
    profile = scan(Scene(FIELD), height_m=0.3, reach_m=2.0, **EXACT)
    assert not profile.hit.any()
    assert (profile.range_m == 2.0).all()


@pytest.mark.parametrize(("height_m", "is_met"), [(0.01, True), (0.03, True), (0.05, False)])
def test_a_ball_is_met_where_the_plane_cuts_it(height_m, is_met):
    ball = Ball(0.2, 0.3, 0.0215)
    bare, with_ball = (scan(Scene(FIELD, ball=b), height_m=height_m, beams=720, **EXACT) for b in (None, ball))
    nearer = with_ball.range_m < bare.range_m - 0.01
    assert nearer.any() == is_met
    if is_met:
        cut = math.sqrt(0.0215**2 - (height_m - 0.0215) ** 2)
        away = math.hypot(0.2 - POSE.x_m, 0.3 - POSE.y_m)
        assert with_ball.range_m[nearer].min() == pytest.approx(away - cut, abs=2e-4)


def test_noise_and_missing_echoes_are_as_asked_for():
    scene = Scene(FIELD)
    exact = scan(scene, beams=4000, **EXACT)
    noisy = scan(scene, beams=4000, noise_std_m=0.02, dropout_rate=0.1)
    assert 1 - noisy.hit.mean() == pytest.approx(0.1, abs=0.02)
    assert (noisy.range_m[~noisy.hit] == 3.0).all()
    error = (noisy.range_m - exact.range_m)[noisy.hit]
    assert error.std() == pytest.approx(0.02, rel=0.1)
    assert abs(error.mean()) < 0.002
    again = scan(scene, beams=4000, noise_std_m=0.02, dropout_rate=0.1)
    np.testing.assert_array_equal(again.range_m, noisy.range_m)


BALL = Ball(0.05, -0.3, 0.0215)
SCENE = Scene(FIELD, boxes=(Box(0.5, 0.2, 0.0, 0.2, 0.2),), robots=(Robot(-0.5, 0.3, 0.09),), ball=BALL)


def cell_of(truth, x, y):
    return tuple(np.floor(np.array([x, y]) / truth.cell_m).astype(int) - truth.first)


def test_cells_are_occupied_where_covered_by_half_and_free_where_not_at_all():
    truth = CellTruth(SCENE, 0.04)
    centers = truth.centers_m
    assert not (truth.occupied & truth.free).any()
    assert truth.occupied[(np.abs(centers - (0.5, 0.2)) < 0.1).all(axis=-1)].all()
    away = np.linalg.norm(centers - (-0.5, 0.3), axis=-1)
    assert truth.occupied[away < 0.08].all()
    assert truth.free[(away > 0.13) & (away < 0.2)].all()
    assert truth.occupied[cell_of(truth, BALL.x_m, BALL.y_m)]
    things = np.linalg.norm(centers, axis=-1) < 0.6
    assert truth.occupied[things].sum() * 0.04**2 < 0.2**2 + 2 * np.pi * 0.09**2


def test_walls_stand_next_to_the_floor_and_nothing_is_estimated_of_what_is_behind():
    truth = CellTruth(Scene(FIELD), 0.04)
    corners = truth.centers_m[:, :, None] + 0.02 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    on_floor = FIELD.contains(corners.reshape(-1, 2)).reshape(*truth.free.shape, 4).all(axis=-1)
    assert on_floor.any()
    assert not truth.occupied[on_floor].any()
    near_wall = cell_of(truth, 0.3, FIELD.width_m / 2 + 0.02)
    assert truth.occupied[near_wall]
    # beside a goal's recess, deep behind the wall
    assert not truth.occupied[cell_of(truth, FIELD.length_m / 2 + 0.15, FIELD.width_m / 2 - 0.1)]
    assert truth.free[cell_of(truth, FIELD.length_m / 2 + 0.08, 0.0)]


def test_an_open_carpets_end_is_no_obstacle_and_a_goals_panel_is_not_free():
    assert not CellTruth(Scene(load_field("msl_6x4")), 0.05).occupied.any()
    goals = load_field("ssl_division_b")
    truth = CellTruth(Scene(goals), 0.05)
    x0, y0, x1, y1 = goals.goals[0].panels[0]
    assert not truth.free[cell_of(truth, (x0 + x1) / 2, (y0 + y1) / 2)]


def test_a_maps_window_is_cut_out_at_its_place():
    truth = CellTruth(SCENE, 0.04)
    grid = FreeSpaceMap()
    grid.move(Pose2(1.2, 0.3, 0.0))
    occupied, free = truth.window(grid)
    for i, j in np.ndindex(80, 80):
        at = np.floor(cell_centers_m(grid)[i, j] / 0.04).astype(int) - truth.first
        inside = (at >= 0).all() and (at < truth.free.shape).all()
        assert occupied[i, j] == (inside and truth.occupied[tuple(at)])
        assert free[i, j] == (inside and truth.free[tuple(at)])
