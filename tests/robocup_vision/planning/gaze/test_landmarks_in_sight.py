"""Landmarks of a field, lines of sight to them past others, and poses drawn for an unsure robot."""

import math

import numpy as np
import pytest
from hypothesis import given
from strategies import built_in_fields, covariances, numbers, poses

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.disc import Disc
from robocup_vision.geometry import Pose2
from robocup_vision.planning.gaze.field_landmarks import field_landmarks
from robocup_vision.planning.gaze.uncertainty import clear_probability, sigma_points


def _places(name: str, kind: str) -> set[tuple[float, float]]:
    return {(round(m.x_m, 3), round(m.y_m, 3)) for m in field_landmarks(load_field(name)) if m.kind == kind}


def test_four_legged_field_has_posts_beacons_and_crossings() -> None:
    field = load_field("four_legged_2007")
    assert _places("four_legged_2007", "post") == {(x, y) for x in (2.7, -2.7) for y in (0.45, -0.45)}
    assert _places("four_legged_2007", "beacon") == {(b.x_m, b.y_m) for b in field.beacons}
    crossings = _places("four_legged_2007", "crossing")
    # corners of field and penalty areas, halfway line with touch lines and circle
    assert {(2.7, 1.8), (0.0, -1.8), (2.05, 0.65), (-2.7, -0.65), (0.0, 0.18)} <= crossings
    assert len(crossings) == 16


def test_panelled_goals_give_their_four_corners() -> None:
    field = load_field("ssl_2001")
    goal = field.goals[0]
    corners = _places("ssl_2001", "goal corner")
    assert {(round(x, 3), round(y, 3)) for x in (goal.line_x_m, goal.back_x_m) for y in (0.3, -0.3)} <= corners
    assert not _places("ssl_2001", "post")


def test_upright_landmarks_have_foot_and_top() -> None:
    posts = [m for m in field_landmarks(load_field("spl_2020")) if m.kind == "post"]
    assert sorted({m.height_m for m in posts}) == [0.0, 0.85]


@given(built_in_fields())
def test_landmarks_of_a_symmetric_pitch_turn_into_each_other(field) -> None:
    places = np.array([[m.x_m, m.y_m, m.height_m] for m in field_landmarks(field)])
    assert len(places)
    for turn in (-1.0, 1.0):  # a half turn, and a mirror image
        turned = places * (-1.0, turn, 1.0)
        apart = np.linalg.norm(turned[:, None] - places[None], axis=-1)
        assert apart.min(axis=1).max() < 1e-6


@given(built_in_fields())
def test_crossings_lie_on_two_pieces_of_line(field) -> None:
    points = field.line_points(0.01)
    for mark in field_landmarks(field):
        if mark.kind == "crossing":
            near = points[np.hypot(*(points - (mark.x_m, mark.y_m)).T) < 0.1] - (mark.x_m, mark.y_m)
            # painted floor around it in more than one direction
            assert np.linalg.svd(near, compute_uv=False)[1] == pytest.approx(0, abs=1e-9) or len(near) > 10
            assert np.linalg.svd(near, compute_uv=False)[1] > 0.01


EYE = (0.0, 0.0, 0.2)
SURE = 1e-10 * np.eye(2)


@pytest.mark.parametrize(
    ("blocker", "expected"),
    [
        (Disc(1.0, 0.0, 0.15, SURE), 0.0),
        (Disc(1.0, 0.2, 0.15, SURE), 1.0),
        (Disc(3.0, 0.0, 0.15, SURE), 1.0),  # behind the point
        (Disc(-1.0, 0.0, 0.15, SURE), 1.0),  # behind the camera
        (Disc(1.0, 0.0, 0.15, SURE, height_m=0.05), 1.0),  # the sight line passes over it
        (Disc(1.0, 0.15, 0.15, 1e-4 * np.eye(2)), 0.5),  # its rim on the sight line
    ],
)
def test_one_blocker(blocker: Disc, expected: float) -> None:
    assert clear_probability(EYE, [[2.0, 0.0, 0.0]], [blocker]) == pytest.approx([expected], abs=1e-6)


def test_sight_line_falls_to_a_point_on_the_floor() -> None:
    points = [[2.0, 0.0, 0.0], [2.0, 0.0, 0.45]]
    # at 1 m the sight lines are 0.1 m and 0.325 m high
    assert clear_probability(EYE, points, [Disc(1.0, 0.0, 0.15, SURE, height_m=0.28)]) == pytest.approx([0.0, 1.0])


@given(numbers(0.2, 1.8), numbers(-0.5, 0.5), numbers(0.001, 0.3), numbers(0.05, 0.2))
def test_ratio_is_that_of_drawn_places(x: float, y: float, std: float, radius: float) -> None:
    share = clear_probability(EYE, [[2.0, 0.0, 0.0]], [Disc(x, y, radius, std**2 * np.eye(2))])
    aside = y + std * np.random.default_rng(0).standard_normal(20_000)
    assert share[0] == pytest.approx(float((np.abs(aside) >= radius).mean()), abs=0.02)


def test_blockers_are_independent() -> None:
    half = Disc(1.0, 0.15, 0.15, 1e-4 * np.eye(2))
    assert clear_probability(EYE, [[2.0, 0.0, 0.0]], [half, half]) == pytest.approx([0.25], abs=1e-6)


@given(poses(), covariances())
def test_mean_and_covariance(pose: Pose2, covariance: np.ndarray) -> None:
    points = sigma_points(pose, covariance)
    assert points.mean(axis=0) == pytest.approx(pose.array)
    off = points - pose.array
    assert off.T @ off / len(points) == pytest.approx(covariance, abs=1e-9)


def test_certain_pose_has_no_spread() -> None:
    assert sigma_points(Pose2(1.0, 2.0, 0.5), np.zeros((3, 3))) == pytest.approx(np.tile([1.0, 2.0, 0.5], (6, 1)))


@pytest.mark.parametrize("covariance", [np.eye(2), np.full((3, 3), math.nan)])
def test_refuses(covariance: np.ndarray) -> None:
    with pytest.raises(ArgumentError, match="covariance must be finite"):
        sigma_points(Pose2(0.0, 0.0, 0.0), covariance)
