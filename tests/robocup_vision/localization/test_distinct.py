"""Tests of the choice of poses that are places of their own."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.geometry import Pose2
from robocup_vision.localization.distinct import Apart

coordinates = st.floats(-0.4, 0.4)
poses = st.lists(st.tuples(coordinates, coordinates, st.floats(-7.0, 7.0)), max_size=25)


@given(poses, st.integers(1, 25), st.booleans())
def test_chosen_poses_are_apart_and_each_other_one_is_near_one_that_comes_before_it(
    rows: list[tuple[float, float, float]], most: int, twins: bool
) -> None:
    apart = Apart(0.2, 0.5, twins)
    chosen = apart.first(np.array(rows).reshape(-1, 3), most)
    assert chosen == sorted(chosen)
    assert len(chosen) <= most
    every = [Pose2(*row) for row in rows]
    for k, index in enumerate(chosen):
        assert not any(apart.is_one(every[index], every[other]) for other in chosen[:k])
    seen = every if len(chosen) < most else every[: chosen[-1]]
    for index, pose in enumerate(seen):
        assert any(apart.is_one(pose, every[other]) for other in chosen if other <= index)


@pytest.mark.parametrize("twins", [True, False])
def test_a_half_turn_is_the_same_place_only_where_it_is_said_to_be(twins: bool) -> None:
    pose = Pose2(1.0, -0.5, 0.3)
    assert Apart(0.1, 0.1, twins).is_one(pose, pose.half_turn()) == twins
    assert len(Apart(0.1, 0.1, twins).first(np.array([pose.array, pose.half_turn().array]), 2)) == 2 - twins


def test_without_an_angle_places_count_whatever_the_heading_is() -> None:
    assert Apart(0.1).is_one(Pose2(0.0, 0.0, 0.0), Pose2(0.05, 0.0, math.pi))
