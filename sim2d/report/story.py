"""Collects the contents of a match's report: samples of its course, and the decisions of planning players."""

from __future__ import annotations

import math
from array import array
from collections import Counter
from dataclasses import dataclass

from robocup_vision.estimates import PoseEstimate
from sim2d.world.state import Moment

# ten samples per second
_PERIODS_PER_SAMPLE = 3
TOPICS = ("gap", "speed", "gaze", "shot")


@dataclass(frozen=True, slots=True)
class ChoiceRate:
    """How often a robot made one choice."""

    #: Index of the robot.
    robot: int
    #: Topic and choice, as in `Reason`.
    topic: str
    choice: str
    #: Fraction of the time in which it decided about the topic.
    rate: float
    #: Number of times that it changed to this choice.
    times: int
    #: Text of the reason the first time.
    example: str


class MatchStory:
    """Collects samples and decisions of a match as it is played."""

    def __init__(self, robots: int) -> None:
        self.t_s = array("d")
        # for each robot; the error is NaN without an estimate
        self.x_m = [array("f") for _ in range(robots)]
        self.y_m = [array("f") for _ in range(robots)]
        self.error_m = [array("f") for _ in range(robots)]
        # distance of each player's estimate of the camera's centre from its file's; NaN if it does not calibrate
        self.center_moved_px = [array("f") for _ in range(robots)]
        # NaN while it plans no speed
        self.speed_mps = [array("f") for _ in range(robots)]
        self.ball_x_m, self.ball_y_m = array("f"), array("f")
        self._periods = 0
        self._counts: list[Counter[tuple[str, str]]] = [Counter() for _ in range(robots)]
        self._times: list[Counter[tuple[str, str]]] = [Counter() for _ in range(robots)]
        self._examples: list[dict[tuple[str, str], str]] = [{} for _ in range(robots)]
        self._before: list[set[tuple[str, str]]] = [set() for _ in range(robots)]

    @property
    def calibrates(self) -> bool:
        """Whether any player calibrates its camera."""
        return any(not math.isnan(value) for one in self.center_moved_px for value in one[-1:])

    def add(self, moment: Moment) -> None:
        """Add a control period."""
        if self._periods % _PERIODS_PER_SAMPLE == 0:
            self._sample(moment)
        self._periods += 1
        for index, robot in enumerate(moment.robots):
            now = {(reason.topic, reason.choice): reason.text for reason in robot.status.reasons}
            self._counts[index].update(now.keys())
            self._times[index].update(now.keys() - self._before[index])
            for key, text in now.items():
                self._examples[index].setdefault(key, text)
            self._before[index] = set(now)

    def _sample(self, moment: Moment) -> None:
        self.t_s.append(moment.state.t_s)
        if moment.state.ball is not None:
            self.ball_x_m.append(moment.state.ball.x_m)
            self.ball_y_m.append(moment.state.ball.y_m)
        for index, (truth, robot) in enumerate(zip(moment.state.robots, moment.robots, strict=True)):
            self.x_m[index].append(truth.pose.x_m)
            self.y_m[index].append(truth.pose.y_m)
            pose, calibration, speed_mps = robot.status.pose, robot.status.calibration, robot.status.speed_mps
            error_m = pose.pose.error_to(truth.pose)[0] if isinstance(pose, PoseEstimate) else math.nan
            self.error_m[index].append(error_m)
            self.center_moved_px[index].append(math.nan if calibration is None else calibration.moved_px)
            self.speed_mps[index].append(math.nan if speed_mps is None else speed_mps)

    @property
    def planners(self) -> list[int]:
        """Indices of the robots that planned anything."""
        return [index for index, counts in enumerate(self._counts) if counts]

    @property
    def rates(self) -> list[ChoiceRate]:
        """Choices ordered by robot and topic, the most frequent one first."""
        rows = []
        for index in self.planners:
            counts = self._counts[index]
            for topic in TOPICS:
                of_topic = [(key, count) for key, count in counts.most_common() if key[0] == topic]
                total = sum(count for _, count in of_topic)
                rows += [
                    ChoiceRate(index, *key, count / total, self._times[index][key], self._examples[index][key])
                    for key, count in of_topic
                ]
        return rows
