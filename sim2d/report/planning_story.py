"""Collects what the planning players of a match decided, and why, for the report."""

from __future__ import annotations

import math
from array import array
from collections import Counter
from dataclasses import dataclass

from sim2d.report.moment import Moment

_PERIODS_PER_SAMPLE = 3
TOPICS = ("gap", "speed", "gaze", "shot")


@dataclass(frozen=True, slots=True)
class ChoiceRate:
    """How often a robot made one choice."""

    #: Its index.
    robot: int
    #: As in `Reason`.
    topic: str
    choice: str
    #: Part of the time in which it decided about the topic.
    rate: float
    #: How often it changed to this choice.
    times: int
    #: Reason in words, the first time.
    example: str


class PlanningStory:
    """Collects decisions of a match as it is played; stays empty where no player plans."""

    def __init__(self, robots: int) -> None:
        self.t_s = array("d")
        # of each robot, m/s; NaN while it plans no speed
        self.speed_mps = [array("f") for _ in range(robots)]
        self._periods = 0
        self._counts: list[Counter[tuple[str, str]]] = [Counter() for _ in range(robots)]
        self._times: list[Counter[tuple[str, str]]] = [Counter() for _ in range(robots)]
        self._examples: list[dict[tuple[str, str], str]] = [{} for _ in range(robots)]
        self._before: list[set[tuple[str, str]]] = [set() for _ in range(robots)]

    def add(self, moment: Moment) -> None:
        """Add a control period."""
        is_sampled = self._periods % _PERIODS_PER_SAMPLE == 0
        self._periods += 1
        if is_sampled:
            self.t_s.append(moment.state.t_s)
        for index, robot in enumerate(moment.robots):
            status = robot.status
            if is_sampled:
                self.speed_mps[index].append(math.nan if status.speed_mps is None else status.speed_mps)
            now = {(reason.topic, reason.choice): reason.text for reason in status.reasons}
            self._counts[index].update(now.keys())
            self._times[index].update(now.keys() - self._before[index])
            for key, text in now.items():
                self._examples[index].setdefault(key, text)
            self._before[index] = set(now)

    @property
    def planners(self) -> list[int]:
        """Indices of the robots that planned anything."""
        return [index for index, counts in enumerate(self._counts) if counts]

    @property
    def rates(self) -> list[ChoiceRate]:
        """Robot by robot and topic by topic, the most frequent choice first."""
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
