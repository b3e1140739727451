"""Collects the samples for the report's plots: positions and localisation errors, ten times a second."""

from __future__ import annotations

import math
from array import array

from robocup_vision.estimates import PoseEstimate
from sim2d.report.moment import Moment

_PERIODS_PER_SAMPLE = 3


class MatchStory:
    """Collects samples of a match as it is played.

    Parameters
    ----------
    robots : int
        Their number.
    """

    def __init__(self, robots: int) -> None:
        self.t_s = array("d")
        # of each robot; the error is NaN where there was no estimate
        self.x_m = [array("f") for _ in range(robots)]
        self.y_m = [array("f") for _ in range(robots)]
        self.error_m = [array("f") for _ in range(robots)]
        self.ball_x_m, self.ball_y_m = array("f"), array("f")
        self._periods = 0

    def add(self, moment: Moment) -> None:
        """Add a control period."""
        if self._periods % _PERIODS_PER_SAMPLE == 0:
            self.t_s.append(moment.state.t_s)
            if moment.state.ball is not None:
                self.ball_x_m.append(moment.state.ball.x_m)
                self.ball_y_m.append(moment.state.ball.y_m)
            for index, (truth, robot) in enumerate(zip(moment.state.robots, moment.robots, strict=True)):
                self.x_m[index].append(truth.pose.x_m)
                self.y_m[index].append(truth.pose.y_m)
                pose = robot.status.pose
                error_m = pose.pose.error_to(truth.pose)[0] if isinstance(pose, PoseEstimate) else math.nan
                self.error_m[index].append(error_m)
        self._periods += 1
