"""Collects the samples for the report's plots: positions, localisation errors and cameras, ten times a second."""

from __future__ import annotations

import math
from array import array

from robocup_vision.estimates import PoseEstimate
from sim2d.report.moment import Moment

_PERIODS_PER_SAMPLE = 3


class MatchStory:
    """Collects samples of a match as it is played."""

    def __init__(self, robots: int) -> None:
        self.t_s = array("d")
        # of each robot; the error is NaN where there was no estimate
        self.x_m = [array("f") for _ in range(robots)]
        self.y_m = [array("f") for _ in range(robots)]
        self.error_m = [array("f") for _ in range(robots)]
        # how far each player believes the camera's centre to be from its file's; NaN where it does not calibrate
        self.center_moved_px = [array("f") for _ in range(robots)]
        self.ball_x_m, self.ball_y_m = array("f"), array("f")
        self._periods = 0

    @property
    def calibrates(self) -> bool:
        """Whether any player calibrates its camera."""
        return any(not math.isnan(value) for one in self.center_moved_px for value in one[-1:])

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
                calibration = robot.status.calibration
                self.center_moved_px[index].append(math.nan if calibration is None else calibration.moved_px)
        self._periods += 1
