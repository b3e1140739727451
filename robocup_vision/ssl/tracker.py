"""One world out of what several cameras saw: robots and ball with velocities, at any time near the last frames.

Robots are filtered by several models of motion (`motion_filter`); their angles and the ball as things that move with
constant velocity and are disturbed by accelerations. A frame counts at the time of its exposure, so that delays cost
nothing but a prediction. A detection far from where it should be is not used until the next ones agree with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.geometry import wrap_angle
from robocup_vision.ssl.motion_filter import MotionFilter, MotionFilterSettings
from robocup_vision.ssl.values.detection import DetectionBall, DetectionFrame, DetectionRobot
from robocup_vision.ssl.values.tracked import (
    TeamColor,
    TrackedBall,
    TrackedFrame,
    TrackedRobot,
    TrackedRobotId,
    Vector2,
    Vector3,
)


@dataclass(frozen=True, slots=True)
class TrackerSettings:
    """What is known of robots, ball and cameras of the small-size league.

    Parameters
    ----------
    robot : MotionFilterSettings
        How robots move.
    robot_std_rad, ball_std_m : float
        Noise of a detection: what the cameras of the league's fields show.
    robot_turn_acceleration_rps2 : float
        How hard robots speed up and brake their turning, as a standard deviation.
    ball_acceleration_mps2 : float
        The same of a ball that is dribbled or touched without being kicked.
    ball_slowing_mps2 : float
        Of a ball that rolls on carpet.
    start_speed_mps, start_turn_rps : float
        How fast something new may be, as a standard deviation.
    max_robot_jump_m, max_ball_jump_m : float
        A detection farther from its prediction is not used at once: at 60 Hz no robot goes so far between two
        frames, and no ball does unless it was kicked.
    believed_after : int
        So many detections in a row that agree with each other, and not with the track, are used.
    max_lost_s : float
        What has not been seen for so long is gone.
    """

    robot: MotionFilterSettings = MotionFilterSettings()
    robot_std_rad: float = 0.012
    ball_std_m: float = 0.0015
    robot_turn_acceleration_rps2: float = 20.0
    ball_acceleration_mps2: float = 3.0
    ball_slowing_mps2: float = 0.35
    start_speed_mps: float = 2.0
    start_turn_rps: float = 5.0
    max_robot_jump_m: float = 0.15
    max_ball_jump_m: float = 0.06
    believed_after: int = 2
    max_lost_s: float = 1.0


class _Coordinate:
    """One coordinate and its rate, with their covariance."""

    __slots__ = ("p_rate", "p_value", "p_value_rate", "rate", "value")

    def __init__(self, value: float, value_std: float, rate: float, rate_std: float) -> None:
        self.value, self.rate = value, rate
        self.p_value, self.p_value_rate, self.p_rate = value_std**2, 0.0, rate_std**2

    def predict(self, dt_s: float, acceleration_std: float) -> None:
        self.value += self.rate * dt_s
        power = acceleration_std**2 * dt_s
        self.p_value += 2 * dt_s * self.p_value_rate + dt_s**2 * self.p_rate + power * dt_s**3 / 4
        self.p_value_rate += dt_s * self.p_rate + power * dt_s**2 / 2
        self.p_rate += power * dt_s

    def update(self, innovation: float, std: float) -> None:
        """Take in a measurement that is off by an innovation."""
        total = self.p_value + std**2
        gain, rate_gain = self.p_value / total, self.p_value_rate / total
        self.value += gain * innovation
        self.rate += rate_gain * innovation
        self.p_rate -= rate_gain * self.p_value_rate
        self.p_value *= 1 - gain
        self.p_value_rate *= 1 - gain


class _Doubts:
    """Detections in a row that were not used."""

    def __init__(self) -> None:
        self.doubted: list[tuple[float, float, float]] = []

    def doubt(self, t_s: float, x: float, y: float, jump_m: float, believed_after: int) -> bool:
        """Note a detection that is not where it was predicted; return whether enough of them agree."""
        if self.doubted:
            before_s, bx, by = self.doubted[-1]
            # another place, or one so old that nothing links the two
            if math.hypot(x - bx, y - by) > 3 * jump_m or t_s - before_s > 0.1:
                self.doubted = []
        self.doubted.append((t_s, x, y))
        return len(self.doubted) >= believed_after


class _BallTrack(_Doubts):
    """The ball as it moves over the floor."""

    def __init__(self, t_s: float, x: float, y: float, s: TrackerSettings) -> None:
        super().__init__()
        self.t_s = self.seen_s = t_s
        self.x = _Coordinate(x, s.ball_std_m, 0.0, s.start_speed_mps)
        self.y = _Coordinate(y, s.ball_std_m, 0.0, s.start_speed_mps)


class _RobotTrack(_Doubts):
    """A robot: its row in the filter, and its direction."""

    def __init__(self, row: int, t_s: float, angle: float, s: TrackerSettings) -> None:
        super().__init__()
        self.row = row
        self.start(t_s, angle, s)

    def start(self, t_s: float, angle: float, s: TrackerSettings) -> None:
        self.seen_s = self.t_s = t_s
        self.angle = _Coordinate(angle, s.robot_std_rad, 0.0, s.start_turn_rps)
        self.doubted = []


RobotKey = tuple[TeamColor, int]


class OverheadTracker:
    """Follows robots and one ball.

    Parameters
    ----------
    settings : TrackerSettings
        What is known beforehand.
    """

    def __init__(self, settings: TrackerSettings = TrackerSettings()) -> None:
        self._settings = settings
        self._motion = MotionFilter(settings.robot)
        self._robots: dict[RobotKey, _RobotTrack] = {}
        self._ball: _BallTrack | None = None
        self._frames = 0

    def update(self, frame: DetectionFrame) -> None:
        """Take in what one camera saw; frames of several cameras in whatever order they come."""
        t_s = frame.t_capture_s
        if not math.isfinite(t_s):
            return
        seen = {
            (color, robot.robot_id): robot
            for color, robots in ((TeamColor.YELLOW, frame.yellow), (TeamColor.BLUE, frame.blue))
            for robot in robots
            if robot.robot_id is not None and _is_finite(robot)
        }
        if seen:
            self._update_robots(seen, t_s)
        self._update_ball([ball for ball in frame.balls if _is_finite(ball)], t_s)
        self._frames += 1

    def at(self, t_s: float) -> TrackedFrame:
        """Return the world at a time, seconds since 1970, predicted from what has been seen."""
        known = [
            (key, track)
            for key, track in sorted(self._robots.items())
            if t_s - track.seen_s <= self._settings.max_lost_s
        ]
        places, velocities = self._motion.at(np.array([track.row for _, track in known], dtype=np.int64), t_s)
        robots = tuple(
            TrackedRobot(
                TrackedRobotId(number, color),
                Vector2(*place),
                wrap_angle(track.angle.value + (t_s - track.t_s) * track.angle.rate),
                Vector2(*velocity),
                track.angle.rate,
                self._visibility(track.seen_s, t_s),
            )
            for ((color, number), track), place, velocity in zip(
                known, places.tolist(), velocities.tolist(), strict=True
            )
        )
        balls = () if self._ball is None else (self._ball_at(self._ball, t_s),)
        return TrackedFrame(self._frames, t_s, balls, robots)

    def _visibility(self, seen_s: float, t_s: float) -> float:
        return max(0.0, min(1.0, 1.0 - (t_s - seen_s) / self._settings.max_lost_s))

    def _ball_at(self, track: _BallTrack, t_s: float) -> TrackedBall:
        x, y, vx, vy = _rolled(track, t_s - track.t_s, self._settings.ball_slowing_mps2)
        return TrackedBall(Vector3(x, y, 0.0), Vector3(vx, vy, 0.0), self._visibility(track.seen_s, t_s))

    def _update_robots(self, seen: dict[RobotKey, DetectionRobot], t_s: float) -> None:
        s = self._settings
        followed = []
        for key, robot in seen.items():
            track = self._robots.get(key)
            if track is None:
                track = self._robots[key] = _RobotTrack(self._motion.add(), t_s, robot.orientation_rad or 0.0, s)
            elif t_s - track.seen_s <= s.max_lost_s:
                followed.append((track, robot))
                continue
            self._start(track, robot, t_s)
        if not followed:
            return
        rows = np.array([track.row for track, _ in followed], dtype=np.int64)
        places = np.array([(robot.x_m, robot.y_m) for _, robot in followed])
        self._motion.predict(rows, t_s)
        # of another camera's frame, exposed a moment earlier, it is compared with where it was then
        away = np.hypot(*self._motion.innovations(rows, places, t_s).T)
        near = away <= s.max_robot_jump_m
        if near.any():
            self._motion.update(rows[near], places[near], t_s)
        for (track, robot), is_near in zip(followed, near.tolist(), strict=True):
            if is_near:
                track.doubted = []
                self._turn(track, robot, t_s)
            elif track.doubt(t_s, robot.x_m, robot.y_m, s.max_robot_jump_m, s.believed_after):
                self._start(track, robot, t_s)

    def _start(self, track: _RobotTrack, robot: DetectionRobot, t_s: float) -> None:
        track.start(t_s, robot.orientation_rad or 0.0, self._settings)
        self._motion.start(track.row, t_s, robot.x_m, robot.y_m)

    def _turn(self, track: _RobotTrack, robot: DetectionRobot, t_s: float) -> None:
        """Take in a robot's direction."""
        s, angle = self._settings, track.angle
        angle.predict(max(t_s - track.t_s, 0.0), s.robot_turn_acceleration_rps2)
        track.t_s = track.seen_s = max(t_s, track.t_s)
        if robot.orientation_rad is not None:
            expected = angle.value - (track.t_s - t_s) * angle.rate
            angle.update(wrap_angle(robot.orientation_rad - expected), s.robot_std_rad)

    def _update_ball(self, balls: list[DetectionBall], t_s: float) -> None:
        s, track = self._settings, self._ball
        if not balls:
            return
        if track is None or t_s - track.seen_s > s.max_lost_s:
            best = max(balls, key=lambda ball: ball.confidence)
            self._ball = _BallTrack(t_s, best.x_m, best.y_m, s)
            return
        dt_s = max(t_s - track.t_s, 0.0)
        x, y, vx, vy = _rolled(track, dt_s, s.ball_slowing_mps2)
        track.x.predict(dt_s, s.ball_acceleration_mps2)
        track.y.predict(dt_s, s.ball_acceleration_mps2)
        track.x.value, track.x.rate, track.y.value, track.y.rate = x, vx, y, vy
        track.t_s = max(t_s, track.t_s)
        late_s = track.t_s - t_s
        x, y = x - late_s * vx, y - late_s * vy
        ball = min(balls, key=lambda ball: math.hypot(ball.x_m - x, ball.y_m - y))
        dx, dy = ball.x_m - x, ball.y_m - y
        # the longer it was hidden, the farther it may have got
        allowed_m = s.max_ball_jump_m + 3 * math.sqrt(max(track.x.p_value, track.y.p_value))
        if math.hypot(dx, dy) > allowed_m:
            if track.doubt(t_s, ball.x_m, ball.y_m, s.max_ball_jump_m, s.believed_after):
                self._ball = _restarted(track.doubted, s)
            return
        track.doubted = []
        track.seen_s = track.t_s
        track.x.update(dx, s.ball_std_m)
        track.y.update(dy, s.ball_std_m)


def _restarted(doubted: list[tuple[float, float, float]], settings: TrackerSettings) -> _BallTrack:
    """Return the track of a ball that was kicked or carried off: its velocity is that between the detections."""
    (t0_s, x0, y0), (t1_s, x1, y1) = doubted[0], doubted[-1]
    track = _BallTrack(t1_s, x1, y1, settings)
    dt_s = t1_s - t0_s
    if dt_s > 0:
        track.x.rate, track.y.rate = (x1 - x0) / dt_s, (y1 - y0) / dt_s
        track.x.p_rate = track.y.p_rate = 2 * (settings.ball_std_m / dt_s) ** 2
    return track


def _rolled(track: _BallTrack, dt_s: float, slowing_mps2: float) -> tuple[float, float, float, float]:
    """Return place and velocity of a ball after it rolled on for a while, back in time without slowing."""
    vx, vy = track.x.rate, track.y.rate
    speed = math.hypot(vx, vy)
    if dt_s <= 0 or speed <= 0:
        return track.x.value + dt_s * vx, track.y.value + dt_s * vy, vx, vy
    rolls_s = min(dt_s, speed / slowing_mps2)
    way = rolls_s - slowing_mps2 * rolls_s**2 / (2 * speed)
    kept = max(1 - slowing_mps2 * dt_s / speed, 0.0)
    return track.x.value + way * vx, track.y.value + way * vy, kept * vx, kept * vy


def _is_finite(thing: DetectionBall | DetectionRobot) -> bool:
    angle = thing.orientation_rad if isinstance(thing, DetectionRobot) else None
    return math.isfinite(thing.x_m) and math.isfinite(thing.y_m) and (angle is None or math.isfinite(angle))
