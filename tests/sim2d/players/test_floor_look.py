"""Looks at undecided floor: towards the way, no more than twice from one place, and only where the map reaches."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robocup_vision.belief import MapPicture
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FREE, UNDECIDED
from sim2d.players.head import FloorLook, FloorLookSettings
from sim2d.robot_link import RobotLimits

HERE = Pose2(0.0, 0.0, 0.3)
TARGET = (1.2, 0.0)


def picture():
    """80 cells of 4 cm about the origin: free, but for a strip across the way."""
    state = np.full((80, 80), FREE, dtype=np.uint8)
    state[60:64, :] = UNDECIDED
    return MapPicture(state, (-1.6, -1.6), 0.04)


def look():
    return FloorLook(RobotLimits(), 0.5, FloorLookSettings())


def test_it_looks_at_the_strip_across_the_way():
    pan_rad, reason = look().choose(picture(), HERE, TARGET)
    assert pan_rad == pytest.approx(-0.3, abs=0.2)
    assert reason.startswith("look at (0.8")


def test_two_looks_from_one_place_are_enough():
    planner = look()
    for _ in range(2):
        pan_rad, _ = planner.choose(picture(), HERE, TARGET)
        planner.observe(pan_rad + 1.0)  # not there yet: no look
        planner.observe(pan_rad)
    left = planner.choose(picture(), HERE, TARGET)
    assert left is None or abs(math.remainder(left[0] - pan_rad, math.tau)) > 0.4


def test_known_floor_needs_no_look():
    free = MapPicture(np.full((80, 80), FREE, dtype=np.uint8), (-1.6, -1.6), 0.04)
    assert look().choose(free, HERE, TARGET) is None


def test_a_target_off_the_map_counts_as_on_its_rim_and_a_robot_off_it_does_not_look():
    assert look().choose(picture(), HERE, (9.0, 0.0)) is not None
    assert look().choose(picture(), Pose2(3.0, 0.0, 0.0), TARGET) is None
