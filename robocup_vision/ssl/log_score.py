"""Scores a tracker on a log: its errors and those of the last detections, against the log's tracker packets.

At each tracker packet, both use only what was received before it, so that the delay of vision counts, too. At each
exposure, the tracker's positions by that frame and those before are compared, as are the frame's own detections. The
tracker packets of sim2d are the truth; those of another tracker are only estimates.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, fields

from field_models.errors import ArgumentError
from robocup_vision.geometry import wrap_angle
from robocup_vision.ssl.field import ROBOT_RADIUS_M
from robocup_vision.ssl.log import LogEntry, Unreadable, readable
from robocup_vision.ssl.tracker import OverheadTracker
from robocup_vision.ssl.values.detection import DetectionFrame, VisionPacket
from robocup_vision.ssl.values.simulation import Team
from robocup_vision.ssl.values.tracked import TrackedFrame, TrackedRobot, TrackerPacket, Vector2, Vector3

# a ball without a detection for this time is hidden
_HIDDEN_S = 0.1
# errors are not counted during this time, since the first frames hardly determine the velocity
_SETTLING_S = 0.5
# a true frame is extrapolated by its velocities to an exposure within this time: less than half a frame at 60 Hz
_SAME_TIME_S = 0.008
# number of true frames that are kept: vision arrives no later than this many frames after the truth of its exposure
_KEPT_TRUTHS = 60


@dataclass(slots=True)
class _Squares:
    """Sums of squares of errors."""

    total: float = 0.0
    count: int = 0

    def add(self, square: float) -> None:
        self.total += square
        self.count += 1

    @property
    def rms(self) -> float | None:
        return math.sqrt(self.total / self.count) if self.count else None


@dataclass(frozen=True, slots=True)
class TrackerScore:
    """The errors of a tracker on a log; None if there was nothing to compare."""

    source: str  #: the source of the tracker packets that it was compared with
    frames: int  #: number of these packets
    #: RMS error of a robot's position: of the tracker, and of the last detection
    robot_rms_m: float | None
    robot_last_rms_m: float | None
    #: the same for its orientation
    robot_rms_rad: float | None
    robot_last_rms_rad: float | None
    robot_velocity_rms_mps: float | None  #: RMS error of a robot's velocity
    #: the same at the times of the exposures: position by the tracker, position by the frame itself, and velocity
    exposed_rms_m: float | None
    exposed_last_rms_m: float | None
    exposed_velocity_rms_mps: float | None
    #: the same for the ball, at the packets
    ball_rms_m: float | None
    ball_last_rms_m: float | None
    ball_velocity_rms_mps: float | None
    ball_hidden: int  #: how often no camera saw the ball for more than a tenth of a second
    ball_refound_s: float | None  #: longest time from its next detection until the tracker was right again


def score_log(
    entries: Iterable[LogEntry], tracker: OverheadTracker | None = None, unreadable: Unreadable | None = None
) -> TrackerScore:
    """Score a tracker.

    Parameters
    ----------
    entries : iterable of LogEntry
        The log's entries, in the order of their reception.
    tracker : OverheadTracker, optional
        The tracker to score; by default a new one.
    unreadable : Unreadable, optional
        Collects entries that cannot be read; they are ignored.

    Raises
    ------
    ArgumentError
        If there are no tracker packets, or no detections before them.
    """
    run = _Run(OverheadTracker() if tracker is None else tracker)
    for _, _, value in readable(entries, Unreadable() if unreadable is None else unreadable):
        if isinstance(value, VisionPacket) and value.detection is not None:
            run.see(value.detection)
        elif isinstance(value, TrackerPacket) and value.frame is not None:
            run.compare(value, value.frame)
    if run.uuid is None:
        raise ArgumentError("the log has no tracker packets to score against")
    if not run.frames:
        raise ArgumentError("the log has no detections in the time of its tracker packets")
    return run.score


class _Run:
    def __init__(self, tracker: OverheadTracker) -> None:
        self._tracker = tracker
        self._sums: dict[str, _Squares] = defaultdict(_Squares)
        self._robots: dict[tuple[Team, int], tuple[float, float, float]] = {}
        self._ball: tuple[float, float] | None = None
        self._begin_s: float | None = None
        self._ball_seen_s = -math.inf
        self._refinding_since_s: float | None = None
        self._hidden = 0
        self._refound_s: float | None = None
        self._truths: deque[TrackedFrame] = deque(maxlen=_KEPT_TRUTHS)
        self._source = ""
        # identifies the first tracker in the log; packets of others are ignored
        self.uuid: str | None = None
        self.frames = 0

    def see(self, frame: DetectionFrame) -> None:
        if self._begin_s is None:
            self._begin_s = frame.t_capture_s
        self._tracker.update(frame)
        if self._truths and frame.t_capture_s - self._begin_s > _SETTLING_S:
            truth = min(self._truths, key=lambda known: abs(known.t_s - frame.t_capture_s))
            if abs(truth.t_s - frame.t_capture_s) < _SAME_TIME_S:
                self._compare_exposure(frame, truth)
        for color, robots in ((Team.YELLOW, frame.yellow), (Team.BLUE, frame.blue)):
            for robot in robots:
                if robot.robot_id is not None:
                    self._robots[color, robot.robot_id] = (robot.x_m, robot.y_m, robot.orientation_rad or 0.0)
        for ball in frame.balls:
            self._ball = (ball.x_m, ball.y_m)
            if self._ball_seen_s + _HIDDEN_S < frame.t_capture_s and math.isfinite(self._ball_seen_s):
                self._hidden += 1
                self._refinding_since_s = frame.t_capture_s
            self._ball_seen_s = max(self._ball_seen_s, frame.t_capture_s)

    def compare(self, packet: TrackerPacket, truth: TrackedFrame) -> None:
        if self.uuid is None:
            self.uuid, self._source = packet.uuid, packet.source_name or packet.uuid
        if packet.uuid == self.uuid:
            self._truths.append(truth)
        if packet.uuid != self.uuid or self._begin_s is None or truth.t_s - self._begin_s < _SETTLING_S:
            return
        self.frames += 1
        ours = self._tracker.at(truth.t_s)
        known = _by_number(ours)
        for robot in truth.robots:
            key = robot.robot.team, robot.robot.number
            if key in known and key in self._robots:
                self._compare_robot(robot, known[key], self._robots[key])
        if truth.balls and ours.balls and self._ball is not None:
            self._compare_ball(truth, ours, self._ball)

    def _compare_exposure(self, frame: DetectionFrame, truth: TrackedFrame) -> None:
        sums, past_s = self._sums, frame.t_capture_s - truth.t_s
        true = _by_number(truth)
        ours = _by_number(self._tracker.at(frame.t_capture_s))
        for color, robots in ((Team.YELLOW, frame.yellow), (Team.BLUE, frame.blue)):
            for robot in robots:
                key = color, robot.robot_id or 0
                known, moving = ours.get(key), true.get(key)
                if robot.robot_id is None or known is None or moving is None or moving.velocity_mps is None:
                    continue
                x = moving.position_m.x + past_s * moving.velocity_mps.x
                y = moving.position_m.y + past_s * moving.velocity_mps.y
                sums["exposed_rms_m"].add((known.position_m.x - x) ** 2 + (known.position_m.y - y) ** 2)
                sums["exposed_last_rms_m"].add((robot.x_m - x) ** 2 + (robot.y_m - y) ** 2)
                if known.velocity_mps is not None:
                    sums["exposed_velocity_rms_mps"].add(_gap2(known.velocity_mps, moving.velocity_mps))

    def _compare_robot(self, truth: TrackedRobot, ours: TrackedRobot, last: tuple[float, float, float]) -> None:
        sums, place = self._sums, truth.position_m
        sums["robot_rms_m"].add(_gap2(ours.position_m, place))
        sums["robot_last_rms_m"].add((last[0] - place.x) ** 2 + (last[1] - place.y) ** 2)
        sums["robot_rms_rad"].add(wrap_angle(ours.orientation_rad - truth.orientation_rad) ** 2)
        sums["robot_last_rms_rad"].add(wrap_angle(last[2] - truth.orientation_rad) ** 2)
        if truth.velocity_mps is not None and ours.velocity_mps is not None:
            sums["robot_velocity_rms_mps"].add(_gap2(ours.velocity_mps, truth.velocity_mps))

    def _compare_ball(self, truth: TrackedFrame, ours: TrackedFrame, last: tuple[float, float]) -> None:
        sums, there, here = self._sums, truth.balls[0], ours.balls[0]
        place = there.position_m
        error2 = _gap2(here.position_m, place)
        if self._refinding_since_s is not None and error2 < ROBOT_RADIUS_M**2:
            took_s = truth.t_s - self._refinding_since_s
            self._refound_s = max(self._refound_s or 0.0, took_s)
            self._refinding_since_s = None
        if truth.t_s - self._ball_seen_s > _HIDDEN_S:
            return
        sums["ball_rms_m"].add(error2)
        sums["ball_last_rms_m"].add((last[0] - place.x) ** 2 + (last[1] - place.y) ** 2)
        if there.velocity_mps is not None and here.velocity_mps is not None:
            sums["ball_velocity_rms_mps"].add(_gap2(here.velocity_mps, there.velocity_mps))

    @property
    def score(self) -> TrackerScore:
        errors = {key.name: self._sums[key.name].rms for key in fields(TrackerScore) if "_rms_" in key.name}
        return TrackerScore(
            source=self._source,
            frames=self.frames,
            ball_hidden=self._hidden,
            ball_refound_s=self._refound_s,
            **errors,
        )


def _by_number(frame: TrackedFrame) -> dict[tuple[Team, int], TrackedRobot]:
    return {(robot.robot.team, robot.robot.number): robot for robot in frame.robots}


def _gap2(one: Vector2 | Vector3, other: Vector2 | Vector3) -> float:
    """Return the square of the distance along the floor."""
    return (one.x - other.x) ** 2 + (one.y - other.y) ** 2
