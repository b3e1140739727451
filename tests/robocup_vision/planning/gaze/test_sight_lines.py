"""What hides what, against places drawn at random."""

import numpy as np
import pytest
from hypothesis import given
from strategies import numbers

from robocup_vision.disc import Disc
from robocup_vision.planning.gaze.uncertainty import clear_probability

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
