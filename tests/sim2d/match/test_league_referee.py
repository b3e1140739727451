"""The small-size league's rules of a match and of its places."""

# ruff: noqa: D102
from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.geometry import Pose2
from sim2d.match.league_referee import LeagueReferee
from sim2d.match.pitch_rules import PitchRules, defence_area
from sim2d.world.state import BallState, RobotState

FIELD = load_field("ssl_division_b")
PERIOD_S = 1 / 30
FAR = {(1, 0): (-4.3, 0.0), (-1, 0): (4.3, 0.0)}


class Match:
    """Robots and a ball that stand where they are put, judged by the rules."""

    def __init__(self):
        self.referee = LeagueReferee(FIELD, 0.09)
        self.t_s = 0.0
        self.ball = BallState(0.0, 0.0)
        self.places = dict(FAR)
        self.velocity = (0.0, 0.0)
        self.told = []

    def go(self, seconds):
        for _ in range(round(seconds / PERIOD_S)):
            self.t_s += PERIOD_S
            robots = [
                RobotState(index, side, number, Pose2(*place, 0.0), self.velocity, 0.0)
                for index, ((side, number), place) in enumerate(self.places.items())
            ]
            for ruling in self.referee.judge(self.t_s, robots, self.ball):
                if ruling.ball_at is not None:
                    self.ball = BallState(*ruling.ball_at)
            command = self.referee.command, self.referee.command_side
            if not self.told or self.told[-1] != command:
                self.told.append(command)
        return self

    def until(self, command):
        for _ in range(1500):
            if self.referee.command == command:
                return self
            self.go(PERIOD_S)
        raise AssertionError(f"no {command}: {self.told}")


def in_play():
    match = Match().until("normal_start")
    match.ball = BallState(0.3, 0.0)
    return match.go(0.1)


def test_it_begins_with_a_kick_off_that_is_a_free_kick_until_the_ball_has_moved():
    match = Match().until("normal_start")
    assert [command for command, _ in match.told] == ["halt", "stop", "prepare_kick_off", "normal_start"]
    assert (match.referee.phase, match.referee.kick_off_side) == ("free_kick", 1)
    match.ball = BallState(0.3, 0.0)
    assert match.go(0.1).referee.phase == "play"


def test_a_kick_off_that_nobody_takes_is_everybodys():
    match = Match().until("normal_start").go(10.2)
    assert match.told[-1] == ("stop", 0)
    assert match.until("force_start").referee.phase == "play"


def test_a_goal_counts_and_the_other_side_kicks_off():
    match = in_play()
    match.ball = BallState(4.56, 0.1)
    match.go(0.1)
    assert match.referee.score == {1: 1, -1: 0}
    match.until("prepare_kick_off")
    assert match.referee.command_side == -1
    assert (match.ball.x_m, match.ball.y_m) == (0.0, 0.0)


def test_a_chip_over_the_goal_is_none():
    match = in_play()
    match.ball = BallState(4.56, 0.1, 0.0, 0.0, 0.5)
    assert match.go(0.1).referee.score == {1: 0, -1: 0}


@pytest.mark.parametrize(
    ("last", "out", "side", "place"),
    [
        ((1, 1), (1.0, 3.1), -1, (1.0, 2.8)),
        ((-1, 1), (-2.0, -3.1), 1, (-2.0, -2.8)),
        ((-1, 1), (4.6, 2.0), 1, (4.3, 2.8)),
        ((1, 1), (4.6, -2.0), -1, (3.5, -2.8)),
    ],
)
def test_a_ball_out_is_the_others_throw_in_corner_or_goal_kick(last, out, side, place):
    match = in_play()
    match.places[last] = (0.4, 0.0)
    match.go(0.1)
    match.ball = BallState(*out)
    match.places[last] = (-3.0, -2.0)
    match.until("ball_placement")
    assert match.referee.command_side == side
    assert match.referee.placement_m == pytest.approx(place)
    match.ball = BallState(*place)
    assert match.until("direct_free").referee.command_side == side


def test_a_ball_that_is_not_placed_is_put_there_by_hand():
    match = in_play()
    match.ball = BallState(1.0, 3.1)
    match.until("ball_placement").go(31)
    side = match.told[-2][1]
    assert match.referee.placement_failures[side] == 1
    match.until("direct_free")
    assert (match.ball.x_m, match.ball.y_m) == pytest.approx((1.0, 2.8))


@pytest.mark.parametrize("another_touches", [False, True])
def test_who_kicks_off_may_touch_the_ball_again_only_after_another_robot_has(another_touches):
    match = Match().until("normal_start")
    match.places[1, 1] = (-0.115, 0.0)
    match.go(0.2)
    match.ball = BallState(0.5, 0.0)
    match.go(0.2)
    if another_touches:
        match.places[-1, 1] = (0.61, 0.0)
        match.go(0.1)
        match.places[-1, 1] = (2.0, 0.0)
    match.places[1, 1] = (0.39, 0.0)
    match.go(0.2)
    assert [foul.kind for foul in match.referee.fouls] == ([] if another_touches else ["double_touch"])
    assert another_touches or match.until("direct_free").referee.command_side == -1


def test_a_defender_in_its_area_gives_a_penalty_and_an_attacker_there_a_free_kick():
    area = defence_area(FIELD)
    assert (area.depth_m, area.width_m) == (1.0, 2.0)
    match = in_play()
    match.places[1, 2] = (-4.0, 0.3)
    match.ball = BallState(-3.9, 0.3)
    match.go(0.1)
    assert match.referee.fouls[0].kind == "own_area"
    match.until("ball_placement")
    assert match.referee.command_side == -1
    assert match.referee.placement_m == pytest.approx((1.5, 0.0))
    attack = in_play()
    attack.places[1, 2] = (4.0, 0.3)
    attack.ball = BallState(3.9, 0.3)
    attack.go(0.1)
    assert attack.referee.fouls[0].kind == "their_area"


def test_in_a_stop_speed_and_distance_are_limited_and_three_fouls_are_a_card():
    match = in_play()
    match.ball = BallState(1.0, 3.1)
    match.go(0.1)
    match.places[1, 1], match.places[1, 2] = (1.0, 2.6), (0.0, 0.0)
    match.velocity = (0.0, 1.6)
    match.go(2.7)
    kinds = [(foul.side, foul.number, foul.kind) for foul in match.referee.fouls]
    assert (1, 1, "near_ball") in kinds
    assert (1, 2, "fast_in_stop") in kinds
    assert match.referee.robots_allowed(1, 6) == 5
    assert match.referee.card_count(1) == len([kind for kind in kinds if kind[0] == 1]) // 3
    match.go(121)
    assert match.referee.robots_allowed(1, 6) <= 6


def test_a_fast_kick_and_a_ball_that_lies_stop_the_game():
    match = in_play()
    match.places[1, 1] = (0.2, 0.0)
    match.go(0.1)
    match.ball = BallState(0.4, 0.0, 7.0, 0.0)
    match.go(0.1)
    assert match.referee.fouls[0].kind == "fast_ball"
    lying = in_play().go(10.2)
    assert lying.told[-1] == ("stop", 0)
    assert lying.until("force_start").referee.fouls == []


def test_halves_end_and_then_the_match():
    match = Match()
    match.referee.stage_end_s = 20.0
    match.go(45)
    assert match.referee.stage == "second_half"
    match.referee.stage_end_s = match.t_s + 1
    match.go(30)
    assert match.referee.stage == "post_game"
    assert match.referee.phase == "halt"


def test_a_person_halts_the_game_and_it_goes_on_where_it_was():
    match = in_play()
    match.referee.halt(match.t_s, match.ball)
    assert match.referee.phase == "halt"
    match.until("force_start")
    assert (match.ball.x_m, match.ball.y_m) == pytest.approx((0.3, 0.0))


def test_who_makes_room_for_a_ball_that_is_placed_commits_no_foul_and_who_stays_does():
    match = in_play()
    match.ball = BallState(1.0, 3.1)
    match.until("ball_placement").go(2.5)
    other = -match.referee.command_side
    match.places[other, 3] = (1.2, 2.9)
    match.go(1.5)
    match.places[other, 3] = (3.0, 0.0)
    match.go(0.5)
    match.places[other, 3] = (1.2, 2.9)
    match.go(1.5)
    assert match.referee.fouls == []
    match.go(1.0)
    assert [(foul.side, foul.kind) for foul in match.referee.fouls] == [(other, "near_ball")]


def test_a_ball_that_is_put_elsewhere_in_a_stop_leaves_time_to_keep_away():
    match = in_play()
    match.ball = BallState(-4.0, 0.2)
    match.referee.halt(match.t_s, match.ball)
    match.until("stop").go(0.7)
    place = (match.ball.x_m, match.ball.y_m)
    assert place[0] > -3.5
    match.places[1, 5] = (place[0] + 0.3, place[1])
    match.go(1.0)
    match.places[1, 5] = (0.0, 2.0)
    assert match.until("force_start").referee.fouls == []


RADIUS_M = 0.09
RULES = PitchRules(FIELD, RADIUS_M)
HALF_X_M, HALF_Y_M = FIELD.length_m / 2, FIELD.width_m / 2
places = st.tuples(st.floats(-1.5 * HALF_X_M, 1.5 * HALF_X_M), st.floats(-1.5 * HALF_Y_M, 1.5 * HALF_Y_M))
sides = st.sampled_from((1, -1))


@given(places)
def test_a_free_kick_is_clear_of_lines_and_defence_areas(place):
    x, y = RULES.legal_place(place)
    assert abs(x) <= HALF_X_M - 0.2
    assert abs(y) <= HALF_Y_M - 0.2
    assert not any(RULES.area.holds(side, x, y, 0.2 + RADIUS_M) for side in (1, -1))


@given(places)
def test_a_legal_place_stays(place):
    legal = RULES.legal_place(place)
    assert RULES.legal_place(legal) == legal


@given(places, sides)
def test_a_ball_that_is_out_is_the_other_sides(place, last_side):
    ball = BallState(*place)
    after = RULES.after_out(last_side, ball)
    assert after.kind == "free_kick"
    assert after.side == -last_side
    assert not RULES.is_out(BallState(*after.place_m))


@given(places)
def test_a_ball_in_a_goal_is_out_and_one_on_the_field_is_in_none(place):
    ball = BallState(*place)
    assert not RULES.goal_of(ball) or RULES.is_out(ball)


def test_a_ball_behind_the_line_between_the_posts_is_a_goal_under_the_bar_alone():
    goal = next(goal for goal in FIELD.goals if goal.side == 1)
    x = goal.line_x_m + 2 * FIELD.ball_radius_m
    assert RULES.goal_of(BallState(x, 0.0)) == 1
    assert RULES.goal_of(BallState(x, goal.width_m)) == 0
    assert RULES.goal_of(BallState(x, 0.0, z_m=2 * goal.height_m)) == 0
