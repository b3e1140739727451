"""One world out of what several cameras saw: robots and ball with velocities, at any time near the last frames.

Robots are filtered by several models of motion (`motion_filter`); their angles and the ball as things that move with
constant velocity and are disturbed by accelerations. A frame counts at the time of its exposure, so that delays cost
nothing but a prediction. A detection far from where it should be is not used until the next ones agree with it.

Clocks of vision systems step, restart and differ from camera to camera. Tracks are kept by a time of their own that
only goes on (`SteadyClock`); each camera's stamps are converted to it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robocup_vision.geometry import wrap_angle
from robocup_vision.ssl.field import ROBOT_RADIUS_M
from robocup_vision.ssl.motion_filter import START_SPEED_MPS, MotionFilter
from robocup_vision.ssl.problems import Problems
from robocup_vision.ssl.steady_clock import SteadyClock
from robocup_vision.ssl.values.detection import DetectionBall, DetectionFrame, DetectionRobot, finite_frame
from robocup_vision.ssl.values.simulation import Team
from robocup_vision.ssl.values.tracked import (
    TrackedBall,
    TrackedFrame,
    TrackedRobot,
    TrackedRobotId,
    Vector2,
    Vector3,
)

# the league's go up to 15; a sender must not fill the memory
_MAX_NUMBER = 63
# noise of a detection: what the cameras of the league's fields show
_ROBOT_STD_RAD, _BALL_STD_M = 0.012, 0.0015
# standard deviations of the robots' angular acceleration, and of the acceleration of a dribbled or touched ball
_TURN_ACCELERATION_RPS2, _BALL_ACCELERATION_MPS2 = 20.0, 3.0
# deceleration of a ball that rolls on carpet
_BALL_SLOWING_MPS2 = 0.35
# standard deviation of the turning rate of something new
_START_TURN_RPS = 5.0
# a detection farther from its prediction is not used at once: at 60 Hz no robot goes so far between two frames, and no
# ball does unless it was kicked
_MAX_ROBOT_JUMP_M, _MAX_BALL_JUMP_M = 0.15, 0.06
# time without a detection after which a track ends
_MAX_LOST_S = 1.0
# robots of two numbers nearer to each other than a robot's radius cannot be two
_MIN_APART_M = ROBOT_RADIUS_M
# reach of the league's largest field from its centre
_REACH_M = (6.3, 4.8)


class _Coordinate:
    """One coordinate and its rate, with their covariance: a Kalman filter."""

    __slots__ = ("p_rate", "p_value", "p_value_rate", "rate", "value")

    def __init__(self, value: float, value_std: float, rate_std: float) -> None:
        self.value, self.rate = value, 0.0
        self.p_value, self.p_value_rate, self.p_rate = value_std**2, 0.0, rate_std**2

    def predict(self, dt_s: float, acceleration_std: float) -> None:
        self.value += self.rate * dt_s
        power = acceleration_std**2 * dt_s
        self.p_value += 2 * dt_s * self.p_value_rate + dt_s**2 * self.p_rate + power * dt_s**3 / 4
        self.p_value_rate += dt_s * self.p_rate + power * dt_s**2 / 2
        self.p_rate += power * dt_s

    def update(self, innovation: float, std: float) -> None:
        """Update by a measurement's innovation, whose measurement noise is `std`."""
        total = self.p_value + std**2
        gain, rate_gain = self.p_value / total, self.p_value_rate / total
        self.value += gain * innovation
        self.rate += rate_gain * innovation
        self.p_rate -= rate_gain * self.p_value_rate
        self.p_value *= 1 - gain
        self.p_value_rate *= 1 - gain


class _Track:
    """The times of a track, and the last detection, as time, x and y, if it was far from its prediction."""

    def __init__(self, t_s: float) -> None:
        self.t_s = self.seen_s = t_s
        self._doubted: tuple[float, float, float] | None = None

    def trust(self) -> None:
        """Forget the unconfirmed detection."""
        self._doubted = None

    def doubt(self, t_s: float, x: float, y: float, jump_m: float) -> tuple[float, float, float] | None:
        """Keep a detection that is far from its prediction; return the one before it if the two agree."""
        before, self._doubted = self._doubted, (t_s, x, y)
        if before is None:
            return None
        before_s, bx, by = before
        # two detections agree if they are near in place and within 0.1 s
        return None if math.hypot(x - bx, y - by) > 3 * jump_m or t_s - before_s > 0.1 else before


class _BallTrack(_Track):
    """The ball's position and velocity on the floor."""

    def __init__(self, t_s: float, x: float, y: float) -> None:
        super().__init__(t_s)
        self.x = _Coordinate(x, _BALL_STD_M, START_SPEED_MPS)
        self.y = _Coordinate(y, _BALL_STD_M, START_SPEED_MPS)


class _RobotTrack(_Track):
    """A robot's angle, and its row in the filter of positions."""

    def __init__(self, row: int, t_s: float, angle: float) -> None:
        super().__init__(t_s)
        self.row = row
        self.angle = _Coordinate(angle, _ROBOT_STD_RAD, _START_TURN_RPS)


RobotKey = tuple[Team, int]


class OverheadTracker:
    """Tracks robots and one ball.

    Parameters
    ----------
    reach_m : (float, float)
        Greatest distance of the ball in play from the field's centre, along x and y. Of two balls, the one inside, or
        nearer to it, is tracked.
    """

    def __init__(self, reach_m: tuple[float, float] = _REACH_M) -> None:
        self._reach_m = reach_m
        self._motion = MotionFilter()
        self._robots: dict[RobotKey, _RobotTrack] = {}
        self._ball: _BallTrack | None = None
        self._frames = 0
        self.problems = Problems()
        self._clock = SteadyClock(_MAX_LOST_S, self.problems)

    @property
    def newest_s(self) -> float:
        """Steady time of the newest frame, equal to vision's clock until that jumps; minus infinity before any."""
        return self._clock.newest_s

    def update(self, frame: DetectionFrame) -> None:
        """Update by one camera's frame; frames of several cameras may come in any order."""
        t_s = self._clock.steady_s(frame.camera_id, frame.t_capture_s)
        if t_s is None:
            return
        frame, left_out = finite_frame(frame)
        for words in left_out:
            self.problems.add(f"camera {frame.camera_id} sends what is no number", words)
        seen: dict[RobotKey, DetectionRobot] = {}
        for color, robots in ((Team.YELLOW, frame.yellow), (Team.BLUE, frame.blue)):
            for robot in robots:
                if robot.robot_id is None:
                    continue
                if robot.robot_id > _MAX_NUMBER:
                    self.problems.add(f"there is no robot of a number over {_MAX_NUMBER}", f"robot {robot.robot_id}")
                else:
                    key = color, robot.robot_id
                    seen[key] = self._likelier(key, seen[key], robot, t_s) if key in seen else robot
        if seen:
            self._report_overlaps(seen)
            self._update_robots(seen, t_s)
        self._update_ball(frame.balls, t_s)
        self._frames += 1

    def at(self, t_s: float) -> TrackedFrame:
        """Return the world predicted to a time of vision's present clock."""
        return replace(self.at_steady(t_s - self._clock.offset_s), t_s=t_s)

    def at_steady(self, t_s: float) -> TrackedFrame:
        """Return the world predicted to a steady time."""
        known = [(key, track) for key, track in sorted(self._robots.items()) if t_s - track.seen_s <= _MAX_LOST_S]
        places, velocities = self._motion.at(np.array([track.row for _, track in known], dtype=np.int64), t_s)
        robots = tuple(
            TrackedRobot(
                TrackedRobotId(number, color),
                Vector2(*place),
                wrap_angle(track.angle.value + (t_s - track.t_s) * track.angle.rate),
                Vector2(*velocity),
                track.angle.rate,
                _visibility(track.seen_s, t_s),
            )
            for ((color, number), track), place, velocity in zip(
                known, places.tolist(), velocities.tolist(), strict=True
            )
        )
        balls = () if self._ball is None else (_ball_at(self._ball, t_s),)
        return TrackedFrame(self._frames, t_s, balls, robots)

    def _likelier(self, key: RobotKey, one: DetectionRobot, other: DetectionRobot, t_s: float) -> DetectionRobot:
        """Choose between two detections with one number in a frame: nearer to the track, else more confident."""
        color, number = key
        self.problems.add(
            f"{color.name.lower()} {number} is seen twice",
            f"{color.name.lower()} {number} is seen at ({one.x_m:.2f}, {one.y_m:.2f}) and "
            f"({other.x_m:.2f}, {other.y_m:.2f}) m in one frame",
        )
        track = self._robots.get(key)
        if track is None or t_s - track.seen_s > _MAX_LOST_S:
            return max(one, other, key=lambda robot: robot.confidence)
        places = np.array([(one.x_m, one.y_m), (other.x_m, other.y_m)])
        away = np.hypot(*self._motion.innovations(np.array([track.row, track.row]), places, t_s).T)
        return one if away[0] <= away[1] else other

    def _report_overlaps(self, seen: dict[RobotKey, DetectionRobot]) -> None:
        """Report a problem for robots that are seen at one place: the pattern of one has been misread."""
        by_x = sorted(seen.items(), key=lambda entry: entry[1].x_m)
        for index, ((color, number), robot) in enumerate(by_x):
            for (other_color, other_number), other in by_x[index + 1 :]:
                if other.x_m - robot.x_m >= _MIN_APART_M:
                    break
                if abs(other.y_m - robot.y_m) < _MIN_APART_M:
                    pair = f"{color.name.lower()} {number} and {other_color.name.lower()} {other_number}"
                    self.problems.add(
                        f"{pair} are seen at one place", f"{pair} are seen at ({robot.x_m:.2f}, {robot.y_m:.2f}) m"
                    )

    def _update_robots(self, seen: dict[RobotKey, DetectionRobot], t_s: float) -> None:
        followed = []
        for key, robot in seen.items():
            track = self._robots.get(key)
            if track is not None and t_s - track.seen_s <= _MAX_LOST_S:
                followed.append((key, track, robot))
            else:
                self._start(key, self._motion.add() if track is None else track.row, robot, t_s)
        if not followed:
            return
        rows = np.array([track.row for _, track, _ in followed], dtype=np.int64)
        places = np.array([(robot.x_m, robot.y_m) for _, _, robot in followed])
        self._motion.predict(rows, t_s)
        # `innovations` compares with the position at t_s, even if another camera's frame has moved the filter beyond it
        away = np.hypot(*self._motion.innovations(rows, places, t_s).T)
        near = away <= _MAX_ROBOT_JUMP_M
        if near.any():
            self._motion.update(rows[near], places[near], t_s)
        for (key, track, robot), is_near in zip(followed, near.tolist(), strict=True):
            if is_near:
                track.trust()
                _turn(track, robot, t_s)
            elif track.doubt(t_s, robot.x_m, robot.y_m, _MAX_ROBOT_JUMP_M):
                self._start(key, track.row, robot, t_s)

    def _start(self, key: RobotKey, row: int, robot: DetectionRobot, t_s: float) -> None:
        self._robots[key] = _RobotTrack(row, t_s, robot.orientation_rad or 0.0)
        self._motion.start(row, t_s, robot.x_m, robot.y_m)

    def _update_ball(self, balls: Sequence[DetectionBall], t_s: float) -> None:
        track = self._ball
        if not balls:
            return
        if track is None or t_s - track.seen_s > _MAX_LOST_S:
            best = min(balls, key=lambda ball: (self._outside_m(ball.x_m, ball.y_m), -ball.confidence))
            self._ball = _BallTrack(t_s, best.x_m, best.y_m)
            return
        dt_s = max(t_s - track.t_s, 0.0)
        x, y, vx, vy = _rolled(track, dt_s)
        track.x.predict(dt_s, _BALL_ACCELERATION_MPS2)
        track.y.predict(dt_s, _BALL_ACCELERATION_MPS2)
        track.x.value, track.x.rate, track.y.value, track.y.rate = x, vx, y, vy
        track.t_s = max(t_s, track.t_s)
        late_s = track.t_s - t_s
        x, y = x - late_s * vx, y - late_s * vy
        if self._outside_m(x, y) > 0:
            # the tracked ball is outside the field and may be a spare one: prefer balls inside
            nearest_m = min(self._outside_m(ball.x_m, ball.y_m) for ball in balls)
            balls = [ball for ball in balls if self._outside_m(ball.x_m, ball.y_m) <= nearest_m + _MAX_BALL_JUMP_M]
        ball = min(balls, key=lambda ball: math.hypot(ball.x_m - x, ball.y_m - y))
        dx, dy = ball.x_m - x, ball.y_m - y
        # the prediction's uncertainty grows while the ball is hidden
        allowed_m = _MAX_BALL_JUMP_M + 3 * math.sqrt(max(track.x.p_value, track.y.p_value))
        if math.hypot(dx, dy) > allowed_m:
            before = track.doubt(t_s, ball.x_m, ball.y_m, _MAX_BALL_JUMP_M)
            if before is not None:
                self._ball = _restarted(before, (t_s, ball.x_m, ball.y_m))
            return
        track.trust()
        track.seen_s = track.t_s
        track.x.update(dx, _BALL_STD_M)
        track.y.update(dy, _BALL_STD_M)

    def _outside_m(self, x_m: float, y_m: float) -> float:
        """Return the distance of a place from the area of play, `reach_m`; 0 inside."""
        half_x, half_y = self._reach_m
        return math.hypot(max(abs(x_m) - half_x, 0.0), max(abs(y_m) - half_y, 0.0))


def _visibility(seen_s: float, t_s: float) -> float:
    return max(0.0, min(1.0, 1.0 - (t_s - seen_s) / _MAX_LOST_S))


def _ball_at(track: _BallTrack, t_s: float) -> TrackedBall:
    x, y, vx, vy = _rolled(track, t_s - track.t_s)
    return TrackedBall(Vector3(x, y, 0.0), Vector3(vx, vy, 0.0), _visibility(track.seen_s, t_s))


def _turn(track: _RobotTrack, robot: DetectionRobot, t_s: float) -> None:
    """Update a robot's angle by a detection."""
    angle = track.angle
    angle.predict(max(t_s - track.t_s, 0.0), _TURN_ACCELERATION_RPS2)
    track.t_s = track.seen_s = max(t_s, track.t_s)
    if robot.orientation_rad is not None:
        expected = angle.value - (track.t_s - t_s) * angle.rate
        angle.update(wrap_angle(robot.orientation_rad - expected), _ROBOT_STD_RAD)


def _restarted(before: tuple[float, float, float], now: tuple[float, float, float]) -> _BallTrack:
    """Start a track of a ball that was kicked or carried off, with the velocity between its two detections."""
    (t0_s, x0, y0), (t1_s, x1, y1) = before, now
    track = _BallTrack(t1_s, x1, y1)
    dt_s = t1_s - t0_s
    if dt_s > 0:
        track.x.rate, track.y.rate = (x1 - x0) / dt_s, (y1 - y0) / dt_s
        track.x.p_rate = track.y.p_rate = 2 * (_BALL_STD_M / dt_s) ** 2
    return track


def _rolled(track: _BallTrack, dt_s: float) -> tuple[float, float, float, float]:
    """Return x, y, vx, vy of a ball after it has rolled for `dt_s`; for a negative `dt_s` without deceleration."""
    vx, vy = track.x.rate, track.y.rate
    speed = math.hypot(vx, vy)
    if dt_s <= 0 or speed <= 0:
        return track.x.value + dt_s * vx, track.y.value + dt_s * vy, vx, vy
    rolls_s = min(dt_s, speed / _BALL_SLOWING_MPS2)
    way_s = rolls_s - _BALL_SLOWING_MPS2 * rolls_s**2 / (2 * speed)  # distance divided by the initial speed
    speed_ratio = max(1 - _BALL_SLOWING_MPS2 * dt_s / speed, 0.0)
    return track.x.value + way_s * vx, track.y.value + way_s * vy, speed_ratio * vx, speed_ratio * vy
