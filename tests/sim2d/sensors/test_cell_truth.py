"""The truth about a map's cells."""

import numpy as np
from map_cells import cell_centers_m

from field_models import load_field
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FreeSpaceMap
from sim2d.rendering.scene import Ball, Box, Robot, Scene
from sim2d.sensors.learning import CellTruth

FIELD = load_field("ssl_2001")
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
