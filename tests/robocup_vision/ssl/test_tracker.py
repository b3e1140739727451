"""Tracked robots and balls of the league's cameras, and the filter that they are predicted by."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robocup_vision.geometry import wrap_angle
from robocup_vision.ssl.motion_filter import MODELS, MotionFilter, MotionModel
from robocup_vision.ssl.tracker import OverheadTracker
from robocup_vision.ssl.values.detection import DetectionBall, DetectionFrame, DetectionRobot
from robocup_vision.ssl.values.simulation import Team

PERIOD_S = 1 / 60


def frame(t_s, balls=(), yellow=(), blue=(), camera=0):
    return DetectionFrame(
        1,
        t_s,
        t_s,
        camera,
        tuple(DetectionBall(1.0, *place) for place in balls),
        tuple(DetectionRobot(1.0, number, *pose) for number, *pose in yellow),
        tuple(DetectionRobot(1.0, number, *pose) for number, *pose in blue),
    )


def test_a_robot_is_predicted_to_now():
    tracker, rng = OverheadTracker(), np.random.default_rng(1)
    for k in range(120):
        t_s = k * PERIOD_S
        x, y, angle = 1.5 * t_s + rng.normal(0, 0.0013), -0.5 * t_s + rng.normal(0, 0.0013), 3.0 + 2.0 * t_s
        tracker.update(frame(t_s, yellow=[(4, x, y, wrap_angle(angle + rng.normal(0, 0.01)))]))
    now_s = t_s + 0.05
    (robot,) = tracker.at(now_s).robots
    assert (robot.robot.team, robot.robot.number) == (Team.YELLOW, 4)
    assert math.hypot(robot.position_m.x - 1.5 * now_s, robot.position_m.y + 0.5 * now_s) < 0.01
    assert (robot.velocity_mps.x, robot.velocity_mps.y) == pytest.approx((1.5, -0.5), abs=0.12)
    assert robot.turn_rps == pytest.approx(2.0, abs=0.3)
    assert abs(wrap_angle(robot.orientation_rad - 3.0 - 2.0 * now_s)) < 0.05
    assert robot.visibility == pytest.approx(0.95)


def test_robots_of_two_teams_and_cameras_are_two_however_their_frames_come():
    tracker = OverheadTracker()
    for k in range(30):
        t_s = k * PERIOD_S
        tracker.update(frame(t_s, yellow=[(1, 0.1, 0.0, 0.0)], blue=[(1, -1.0, 0.0, 1.0)]))
        # the other camera exposed a little earlier
        tracker.update(frame(t_s - 0.004, yellow=[(1, 0.102, 0.0, 0.0)], camera=1))
    yellow, blue = tracker.at(t_s).robots
    assert yellow.position_m.x == pytest.approx(0.101, abs=0.002)
    assert blue.position_m.x == pytest.approx(-1.0, abs=0.001)


def test_one_wrong_detection_is_not_believed_and_a_carried_robot_is():
    tracker = OverheadTracker()
    for k in range(30):
        tracker.update(frame(k * PERIOD_S, yellow=[(1, 0.0, 0.0, 0.0)]))
    tracker.update(frame(30 * PERIOD_S, yellow=[(1, 3.0, 2.0, 0.0)]))
    assert abs(tracker.at(30 * PERIOD_S).robots[0].position_m.x) < 0.01
    for k in (31, 32, 33):
        tracker.update(frame(k * PERIOD_S, yellow=[(1, -2.0, 1.0, 0.5)]))
    assert tracker.at(33 * PERIOD_S).robots[0].position_m.x == pytest.approx(-2.0, abs=0.01)


def test_what_is_not_seen_is_gone_after_a_while():
    tracker = OverheadTracker()
    assert tracker.at(0.0).robots == tracker.at(0.0).balls == ()
    tracker.update(frame(0.0, balls=[(0.0, 0.0)], yellow=[(1, 0.0, 0.0, 0.0)]))
    assert tracker.at(0.5).robots[0].visibility == pytest.approx(0.5)
    assert tracker.at(1.5).robots == ()
    assert tracker.at(1.5).balls[0].visibility == 0.0


def test_a_rolling_ball_is_followed_behind_a_robot_and_found_again():
    tracker, rng = OverheadTracker(), np.random.default_rng(2)
    place = lambda t_s: 2.0 * t_s - 0.35 * t_s**2 / 2  # noqa: E731
    for k in range(150):
        t_s = k * PERIOD_S
        hidden = 1.0 < t_s < 1.6
        balls = () if hidden else [(place(t_s) + rng.normal(0, 0.001), rng.normal(0, 0.001))]
        tracker.update(frame(t_s, balls=balls))
        if t_s > 0.5:
            error = abs(tracker.at(t_s).balls[0].position_m.x - place(t_s))
            assert error < (0.1 if hidden else 0.03)


def test_a_kicked_ball_is_caught_up_with_in_three_frames():
    tracker = OverheadTracker()
    for k in range(30):
        tracker.update(frame(k * PERIOD_S, balls=[(0.0, 0.0)]))
    for k in range(1, 6):
        t_s = 29 * PERIOD_S + k * PERIOD_S
        tracker.update(frame(t_s, balls=[(6.0 * k * PERIOD_S, 0.0), (3.0, 2.0)]))
    ball = tracker.at(t_s).balls[0]
    assert ball.position_m.x == pytest.approx(6.0 * 5 * PERIOD_S, abs=0.03)
    assert ball.velocity_mps.x == pytest.approx(6.0, abs=0.5)


def test_a_ball_that_lies_still_lies_still():
    tracker = OverheadTracker()
    for k in range(60):
        tracker.update(frame(k * PERIOD_S, balls=[(1.0, 1.0)]))
    ball = tracker.at(2.0).balls[0]
    assert (ball.position_m.x, ball.position_m.y) == pytest.approx((1.0, 1.0), abs=1e-3)
    assert abs(ball.velocity_mps.x) < 0.01


def test_numbers_that_are_none_are_left_out():
    tracker = OverheadTracker()
    nan = float("nan")
    tracker.update(frame(nan, balls=[(0.0, 0.0)]))
    tracker.update(frame(1.0, balls=[(nan, 0.0)], yellow=[(1, nan, 0.0, 0.0), (None, 0.0, 0.0, 0.0)]))
    tracker.update(frame(1.0, blue=[(1, 0.0, 0.0, float("inf"))]))
    assert tracker.at(1.0).robots == tracker.at(1.0).balls == ()


def run(tracker, count, start_s, camera=0, **things):
    for k in range(count):
        tracker.update(frame(start_s + k * PERIOD_S, camera=camera, **things))
    return start_s + (count - 1) * PERIOD_S


@pytest.mark.parametrize("new_s", [0.0, 4000.0, 9000.0, 5002.5])
def test_nothing_unseen_stays_when_the_clock_is_set(new_s):
    tracker = OverheadTracker()
    run(tracker, 60, 5000.0, balls=[(0.0, 0.5)], yellow=[(1, 1.0, 0.0, 0.0), (7, 2.0, 0.0, 0.0)])
    end_s = run(tracker, 90, new_s, yellow=[(1, 1.0, 0.0, 0.0)])
    world = tracker.at(end_s)
    assert [robot.robot.number for robot in world.robots] == [1]
    assert world.robots[0].visibility == 1.0
    assert world.balls[0].visibility == 0.0
    assert world.t_s == end_s


def test_one_stamp_from_the_future_is_passed_over_and_said():
    tracker = OverheadTracker()
    run(tracker, 30, 10.0, yellow=[(1, 1.0, 0.0, 0.0)])
    tracker.update(frame(1e9, yellow=[(1, 1.0, 0.0, 0.0)]))
    end_s = run(tracker, 3, 10.0 + 31 * PERIOD_S, yellow=[(1, 1.0, 0.0, 0.0)])
    assert tracker.newest_s == end_s
    assert tracker.at(end_s).robots[0].visibility == 1.0
    assert tracker.problems.take_new() == ["the clock of camera 0 has gone from 10.483 to 1000000000.000 s"]


def test_cameras_whose_clocks_are_apart_see_one_world():
    tracker = OverheadTracker()
    for k in range(60):
        t_s = k * PERIOD_S
        robot = (1, 1.5 * t_s, 0.0, 0.0)
        tracker.update(frame(50.0 + t_s, yellow=[robot]))
        tracker.update(frame(51.0 + t_s, camera=1, yellow=[robot, (2, -1.0, 0.0, 0.0)]))
    one, two = tracker.at(50.0 + t_s).robots
    assert one.position_m.x == pytest.approx(1.5 * t_s, abs=0.01)
    assert one.velocity_mps.x == pytest.approx(1.5, abs=0.1)
    assert (one.visibility, two.visibility) == (1.0, pytest.approx(1.0, abs=0.02))


def test_the_ball_nearest_to_the_field_is_the_games():
    tracker = OverheadTracker()
    t_s = run(tracker, 60, 10.0, balls=[(30.0, 40.0)])
    assert tracker.at(t_s).balls[0].position_m.x == pytest.approx(30.0)
    t_s = run(tracker, 5, t_s + PERIOD_S, balls=[(30.0, 40.0), (7.0, 0.0)])
    assert tracker.at(t_s).balls[0].position_m.x == pytest.approx(7.0)
    t_s = run(tracker, 5, t_s + PERIOD_S, balls=[(30.0, 40.0), (0.0, 0.0), (7.0, 0.0)])
    assert abs(tracker.at(t_s).balls[0].position_m.x) < 0.01


def test_of_a_number_seen_twice_the_one_on_its_track_is_followed_and_overlaps_are_said():
    tracker = OverheadTracker()
    t_s = run(tracker, 30, 10.0, yellow=[(5, -1.5, 0.0, 0.0)])
    for order in (1, -1):
        doubled = [(5, -1.5, 0.0, 0.0), (5, 1.5, 0.0, 0.0)][::order]
        t_s = run(tracker, 30, t_s + PERIOD_S, yellow=doubled, blue=[(3, -1.45, 0.05, 0.0)])
        assert tracker.at(t_s).robots[0].position_m.x == pytest.approx(-1.5, abs=0.001)
    said = " ".join(tracker.problems.take_new())
    assert "yellow 5 is seen at (1.50, 0.00) and (-1.50, 0.00) m in one frame" in said
    assert "yellow 5 and blue 3 are seen at (-1.50, 0.00) m" in said


RATE = 60.0


def follow(places, times, models=MODELS):
    """Return a filter with one row that has taken in places (N, 2) at times (N,), and its estimates after each."""
    made = MotionFilter(models)
    row = np.array([made.add()])
    made.start(0, times[0], *places[0])
    out = []
    for t_s, place in zip(times[1:], places[1:], strict=True):
        made.predict(row, t_s)
        made.update(row, place[None], t_s)
        position, velocity = made.at(row, t_s)
        out.append([*position[0], *velocity[0]])
    return made, np.array(out)


def driven(seconds, seed):
    """Return times, true places and velocities of a robot that speeds up and brakes at 4 m/s^2, as the league's do."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, seconds, 1 / RATE)
    velocity, wanted, place = np.zeros(2), np.zeros(2), np.zeros(2)
    rows = []
    for k in range(len(times)):
        if k % 90 == 0:
            wanted = rng.uniform(-1.5, 1.5, 2)
        change = wanted - velocity
        size = np.hypot(*change)
        velocity = velocity + change * min(1.0, 4.0 / RATE / max(size, 1e-9))
        place = place + velocity / RATE
        rows.append([*place, *velocity])
    return times, np.array(rows)


@pytest.mark.slow
def test_several_models_are_better_than_detections_and_than_each_alone():
    """Only this finds a mixture of motions that is worse than one of them."""
    times, true = driven(20.0, 5)
    noisy = true[:, :2] + np.random.default_rng(6).normal(0.0, 0.0013, (len(times), 2))

    def errors(models):
        _, found = follow(noisy, times, models)
        rest = (found - true[1:])[60:]
        return math.sqrt(np.mean(rest[:, :2] ** 2)), math.sqrt(np.mean(rest[:, 2:] ** 2))

    place, velocity = errors(MODELS)
    assert place < 0.8 * 0.0013
    assert velocity < 0.05
    for model in MODELS:
        alone = errors((model,))
        assert place < alone[0] or velocity < alone[1]
    straight = errors((MotionModel(0.0, 0.1),))
    assert velocity < straight[1]


def test_a_frame_that_comes_late_counts_for_its_own_time():
    times = np.arange(0.0, 0.5, 1 / RATE)
    made, _ = follow(np.stack([2.0 * times, 0.0 * times], axis=1), times)
    row, late_s = np.array([0]), times[-1] - 0.01
    assert made.innovations(row, np.array([[2.0 * late_s, 0.0]]), late_s) == pytest.approx(np.zeros((1, 2)), abs=2e-3)
    made.predict(row, late_s)
    made.update(row, np.array([[2.0 * late_s, 0.0]]), late_s)
    assert made.at(row, times[-1])[0][0] == pytest.approx([2.0 * times[-1], 0.0], abs=2e-3)


def test_nobody_is_foretold_to_speed_up_for_ever():
    times = np.arange(0.0, 0.5, 1 / RATE)
    made, _ = follow(np.stack([2.0 * times**2, 0.0 * times], axis=1), times)
    _, soon = made.at(np.array([0]), times[-1] + 0.2)
    _, late = made.at(np.array([0]), times[-1] + 5.0)
    assert late[0] == pytest.approx(soon[0], abs=1e-2)
