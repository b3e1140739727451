"""Landmarks of built-in pitches: what stands, what crosses, and their symmetry."""

import numpy as np
import pytest
from hypothesis import given
from strategies import built_in_fields

from field_models import load_field
from robocup_vision.planning.gaze.field_landmarks import field_landmarks


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
