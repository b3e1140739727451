"""Score, possession and events of a match, from states and events made by hand."""

import json

import pytest

from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from sim2d.report.match_figures import MatchLog, match_json
from sim2d.robot_link import Command, PlayerStatus, RobotLimits, Senses
from sim2d.sensors.faults import BodyFault
from sim2d.world.state import BallState, Event, RobotMoment, RobotState, WorldState

ODOMETRY = Pose2(0.0, 0.0, 0.0)


def state(index, ball=(0.0, 0.0), at=(-0.5, 0.5), events=(), score=(0, 0)):
    robots = tuple(RobotState(k, 1 - 2 * k, 0, Pose2(x, 0.0, 0.0), (0.0, 0.0), 0.0) for k, x in enumerate(at))
    return WorldState(index / 30, robots, BallState(*ball), score, "play", 1, tuple(events))


def robot(index, stopped=""):
    senses = Senses(index / 30, None, None, ODOMETRY, False, "play", False)
    return RobotMoment(senses, PlayerStatus(NotLocated("asleep"), None, "", None), Command(), stopped)


def new_log(faults=()):
    return MatchLog(state(0), RobotLimits(radius_m=0.09), 0.02, faults)


def test_possession_is_the_nearest_robots_within_reach():
    log = new_log()
    for index, ball_x in enumerate([-0.4, -0.4, -0.4, 0.38, 0.0, 0.2]):
        log.add(state(index, (ball_x, 0.0)), (robot(index), robot(index)))
    assert log.figures.possession == pytest.approx((0.75, 0.25))
    assert [r.possession for r in log.figures.robots] == pytest.approx([3 / 6, 1 / 6])
    assert new_log().figures.possession == (None, None)


def test_events_are_counted_where_they_belong():
    log = new_log()
    events = [
        Event(0.1, "kick", (0,), speed_mps=1.0),
        Event(0.1, "collision", (0, 1), speed_mps=0.3),
        Event(0.1, "collision", (1,), speed_mps=0.3),
        Event(0.1, "goal", (), side=-1),
        Event(0.1, "whistle"),
    ]
    log.add_events(state(3, events=events, score=(0, 1)))
    ours, theirs = log.figures.robots
    assert (ours.kicks, ours.collisions, ours.wall_contacts) == (1, 1, 0)
    assert (theirs.kicks, theirs.collisions, theirs.wall_contacts) == (0, 1, 1)
    assert log.figures.score == (0, 1)
    assert log.figures.goals == ((0.1, -1),)


def test_being_carried_is_no_way_driven():
    log = new_log([BodyFault(0, 1 / 30, carry_to=Pose2(0.3, 0.0, 0.0))])
    log.add(state(0), (robot(0), robot(0)))
    log.add(state(1, at=(0.3, 0.5)), (robot(1), robot(1)))
    log.add_events(state(2, events=[Event(0.1, "carried_back", (1,))]))
    log.add(state(2, at=(0.3, -1.0)), (robot(2), robot(2)))
    assert [r.distance_m for r in log.figures.robots] == [0.0, 0.0]


def test_the_file_holds_plain_numbers():
    log = new_log()
    for index in range(3):
        log.add(state(index), (robot(index), robot(index, "ValueError: no" if index else "")))
    values = match_json("ssl_2001", 1, 7, log.figures)
    assert (values["format"], values["field"], values["players"], values["seed"]) == (1, "ssl_2001", 1, 7)
    assert values["seconds"] == 0.1
    assert values["robots"][0]["median_error_m"] is None
    assert values["robots"][1]["stopped_s"] == 0.033333
    assert values["robots"][1]["stopped_reason"] == "ValueError: no"
    assert json.loads(json.dumps(values, allow_nan=False)) == values
