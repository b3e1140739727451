"""The match as a PettingZoo environment: its own conformance tests, and what observations and actions mean."""

import math

import numpy as np
import pytest

pytest.importorskip("pettingzoo")

from pettingzoo.test import parallel_api_test, parallel_seed_test
from sim2d_players import SMALL_CAMERA

from field_models import load_field
from field_models.errors import ArgumentError
from sim2d.match.env import MatchEnv
from sim2d.robot_link import RobotLimits
from sim2d.sensors.faults import SenseFault

ONWARD = {"velocity": np.array([0.5, 0.0, 0.0], np.float32), "kick_mps": np.zeros(1, np.float32), "dribble": 0}


def image_env(**options):
    return MatchEnv(players=1, camera=SMALL_CAMERA, **{"seconds": 1.0, **options})


def percepts_env(**options):
    return MatchEnv(players=1, observation="percepts", **{"seconds": 1.0, **options})


def drive(env, periods, actions):
    observations = {}
    for _ in range(periods):
        observations, *_ = env.step(actions)
    return observations


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("make", [image_env, percepts_env])
def test_it_is_a_parallel_env(make):
    parallel_api_test(make(seconds=0.5), num_cycles=20)


@pytest.mark.parametrize("make", [image_env, percepts_env])
def test_the_same_seed_is_the_same_match(make):
    parallel_seed_test(lambda: make(seconds=0.3), num_cycles=9)


@pytest.mark.parametrize("make", [image_env, percepts_env])
def test_observations_lie_in_their_space(make):
    env = make(faults=[SenseFault(0, "dropped", amount=0.5), SenseFault(0, "odometry", amount=1.0)])
    observations, _ = env.reset(seed=3)
    for _ in range(8):
        for agent, observation in observations.items():
            assert env.observation_space(agent).contains(observation)
        observations, *_ = env.step({agent: env.action_space(agent).sample() for agent in env.agents})


def test_matches_without_a_seed_follow_from_the_last_seed():
    def second_match():
        env = image_env()
        env.reset(seed=4)
        return env.reset()[0]["plus_0"]["frame"]

    np.testing.assert_array_equal(second_match(), second_match())
    assert not np.array_equal(second_match(), image_env().reset(seed=4)[0]["plus_0"]["frame"])


def test_speeds_are_metres_a_second_and_odometry_is_the_way():
    env = image_env(seconds=3.0)
    env.reset(seed=0)
    before = env.state()
    way_m = sum(drive(env, 1, {"plus_0": ONWARD})["plus_0"]["odometry"][0] for _ in range(30))
    after = env.state()
    x, _, cos, sin, vx, vy, turn = after[:7]
    assert way_m == pytest.approx(x - before[0], abs=0.03)
    assert (vx, vy, turn) == pytest.approx((0.5, 0.0, 0.0), abs=0.08)
    assert x - before[0] == pytest.approx(0.5 - 0.5**2 / 2 / 1.2, abs=0.08)
    assert math.hypot(cos, sin) == pytest.approx(1.0)
    # the one without an action stood still
    np.testing.assert_allclose(after[7:14], before[7:14], atol=1e-3)
    assert after.shape == (18,)


def test_percepts_are_in_the_sides_own_frame():
    env = percepts_env()
    observations, _ = env.reset(seed=1)
    ours, theirs = observations["plus_0"], observations["minus_0"]
    x, y = env.state()[:2]
    assert ours["located"] == theirs["located"] == 1
    np.testing.assert_allclose(ours["pose"], [x, y, 1.0, 0.0], atol=0.03)
    np.testing.assert_allclose(theirs["pose"][2:], [1.0, 0.0], atol=0.03)
    assert theirs["pose"][0] < 0
    # the ball lies at the centre, straight ahead of both
    assert ours["ball_seen"] == 1
    np.testing.assert_allclose(ours["ball_m"], [-x, -y], atol=0.03)
    assert 0.2 < ours["free_range_m"].max() < 5.0
    assert [o["kick_off"] for o in (ours, theirs)] == [1, 2]


def test_nothing_is_known_without_frames():
    env = percepts_env(faults=[SenseFault(0, "dropped", amount=1.0)])
    seen = env.reset(seed=1)[0]["plus_0"]
    assert (seen["located"], seen["ball_seen"]) == (0, 0)
    assert not seen["pose"].any()
    assert not seen["free_range_m"].any()
    env = image_env(faults=[SenseFault(0, "dropped", amount=1.0)])
    seen = env.reset(seed=1)[0]["plus_0"]
    assert seen["is_fresh"] == 0
    assert not seen["frame"].any()


def test_goals_are_rewarded_and_the_end_truncates():
    env = image_env(seconds=4.0)
    seen, _ = env.reset(seed=2)
    rewards = []
    while env.agents:
        actions = {}
        if seen["plus_0"]["kick_off"] == 0:
            # one shoots as soon as it has the ball, the other goes out of the way
            kick_mps = np.array([2.0 * seen["plus_0"]["ball_in_mouth"]], np.float32)
            actions["plus_0"] = {**ONWARD, "velocity": np.array([0.8, 0.0, 0.0]), "kick_mps": kick_mps}
            actions["minus_0"] = {**ONWARD, "velocity": np.array([0.0, 0.8, 0.0])}
        seen, reward, terminated, truncated, infos = env.step(actions)
        rewards.append(reward["plus_0"])
        assert reward["minus_0"] == -reward["plus_0"]
        assert not any(terminated.values())
    assert sum(rewards) == 1.0
    assert truncated == {"plus_0": True, "minus_0": True}
    assert (infos["plus_0"]["own_goals"], infos["minus_0"]["own_goals"]) == (1, 0)
    assert len(rewards) == 120
    assert env.step({}) == ({}, {}, {}, {}, {})


def test_it_can_be_seen_from_above():
    env = image_env(render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (560, 900, 3)
    # red, green, blue: the carpet is green, the ball orange
    assert picture[100, 300].argmax() == 1
    assert picture[280, 450].argmax() == 0
    assert image_env().render() is None


def test_a_head_has_a_pan():
    env = MatchEnv(load_field("four_legged_2007"), players=1, limits=RobotLimits(speed_mps=0.4))
    space = env.action_space("plus_0")
    assert space["pan_rad"].high == pytest.approx(math.pi / 2)
    assert space["velocity"].high == pytest.approx([0.4, 0.4, 6.0])
    env.reset(seed=0)
    seen = drive(env, 4, {"plus_0": {**ONWARD, "pan_rad": np.array([0.3])}})["plus_0"]
    assert seen["frame_pan_rad"] == pytest.approx(0.3)
    seen = drive(env, 1, {"plus_0": {**ONWARD, "pan_rad": np.array([-1.0])}})["plus_0"]
    # on its way
    assert -1.0 < seen["frame_pan_rad"][0] < 0.3
    seen = drive(env, 10, {"plus_0": {**ONWARD, "pan_rad": np.array([-1.0])}})["plus_0"]
    assert seen["frame_pan_rad"] == pytest.approx(-1.0)
    slow = MatchEnv(load_field("four_legged_2007"), players=1, limits=RobotLimits(pan_limit_rad=0.5))
    assert slow.action_space("plus_0")["pan_rad"].high == pytest.approx(0.5)
    assert slow.observation_space("plus_0")["frame_pan_rad"].low == pytest.approx(-0.5)
    assert "frame_pan_rad" not in image_env().reset(seed=0)[0]["plus_0"]


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"observation": "truth"}, "observation must be image or percepts, got 'truth'"),
        ({"render_mode": "human"}, "render_mode must be rgb_array or None, got 'human'"),
        ({"players": 0}, "players must be at least 1, got 0"),
        ({"seconds": math.inf}, "seconds must be positive, got inf"),
        ({"field": "four_legged_2007", "observation": "percepts"}, "percepts need a mirror camera"),
    ],
)
def test_what_cannot_be_played_is_refused(options, problem):
    with pytest.raises(ArgumentError, match=problem):
        MatchEnv(**options)


def test_steps_need_a_match_and_finite_actions():
    env = image_env()
    with pytest.raises(ArgumentError, match="no match has begun: call reset first"):
        env.step({})
    env.reset(seed=0)
    with pytest.raises(ArgumentError, match="forward_mps must be finite, got nan"):
        env.step({"plus_0": {**ONWARD, "velocity": np.array([math.nan, 0.0, 0.0])}})


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"velocity": np.zeros(2)}, r"the action of plus_0: velocity must have the shape \(3,\), got \(2,\)"),
        ({"velocity": np.zeros((3, 1))}, r"velocity must have the shape \(3,\), got \(3, 1\)"),
        ({"velocity": None}, "velocity must have the shape"),
        ({"velocity": "fast"}, "velocity must be numbers, got 'fast'"),
        ({"kick_mps": np.zeros(2)}, r"kick_mps must have the shape \(1,\), got \(2,\)"),
    ],
)
def test_an_action_of_another_shape_is_named(change, problem):
    env = image_env()
    env.reset(seed=0)
    with pytest.raises(ArgumentError, match=problem):
        env.step({"plus_0": {**ONWARD, **change}})


def test_an_action_or_agent_that_is_none_is_named():
    env = image_env()
    env.reset(seed=0)
    with pytest.raises(ArgumentError, match="must be a dict with the keys of its action space, got ndarray"):
        env.step({"plus_0": np.zeros(3)})
    with pytest.raises(ArgumentError, match="must be a dict with the keys of its action space, got velocity"):
        env.step({"plus_0": {"velocity": np.zeros(3)}})
    with pytest.raises(ArgumentError, match="there is no agent 'plus_9', only plus_0"):
        env.step({"plus_9": ONWARD})
    with pytest.raises(ArgumentError, match="actions must be a dict of actions by agent, got ndarray"):
        env.step(np.zeros(3))
