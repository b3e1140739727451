"""Where a match goes on: laws for every place of the ball."""

from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from sim2d.match.pitch_rules import PitchRules
from sim2d.world.state import BallState

FIELD = load_field("ssl_division_b")
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


def test_a_corner_kick_follows_the_defenders_touch_and_a_goal_kick_the_attackers():
    ball = BallState(HALF_X_M + 0.1, 1.0)
    corner, goal_kick = RULES.after_out(-1, ball), RULES.after_out(1, ball)
    assert corner.side == 1
    assert corner.place_m[0] > goal_kick.place_m[0]
    assert goal_kick.side == -1


def test_a_foul_in_the_own_area_is_a_penalty_before_that_goal():
    after = RULES.after_foul(-1, "own_area", BallState(HALF_X_M - 0.3, 0.0))
    assert after.kind == "penalty"
    assert after.side == 1
    # side -1 defends the goal at +x: two thirds of the field before it
    assert after.place_m == (-FIELD.length_m / 6, 0.0)
