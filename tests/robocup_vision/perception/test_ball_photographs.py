"""Balls in photographs from robots, and in photographs of other things, where the folder beside the project is."""

import pytest

from benchmarks.scores import photograph_balls as balls
from benchmarks.scores.photograph_rows import REAL

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (REAL / "ball_onboard").is_dir(), reason="the photographs are not here"),
]


def counts(row):
    hits, of = row.measured.split(",")[0].split()[0].split("/")
    return int(hits), int(of)


def test_a_ball_under_a_teal_cast_is_found_in_each_frame_alone():
    """Only this finds a hue that a camera's cast carries away."""
    row = balls.onboard_sequence(alone=True)
    hits, frames = counts(row)
    reported = int(row.measured.split(";")[0].rsplit("/", 1)[1])
    assert hits >= 0.9 * frames
    # one ball cut by the picture has its centre outside of what is shown of it
    assert reported - hits <= 1


def test_a_ball_under_a_teal_cast_is_followed_where_it_is_pale():
    """Only this finds a pale ball that is lost between clear frames."""
    assert balls.onboard_sequence(alone=False).is_met


def test_a_ball_before_black_boards_is_found_and_nothing_else():
    """Only this finds dark boards that cost a ball, or pass for one."""
    assert balls.before_boards().is_met


def test_a_ball_burnt_out_or_amid_noise_in_a_mirror_is_found():
    """Only this finds a ball that a real mirror's noise or light costs."""
    assert balls.noisy_mirrors().is_met


def test_hardly_any_photograph_of_another_thing_shows_a_ball():
    """Only this finds real things of all kinds that pass for balls."""
    false, looks = counts(balls.other_things())
    assert false <= 1 / 200 * looks
