"""Where a player turns the head that carries its camera: to the ball, and in between to look for goals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from field_models.field import Field
from robocup_vision.belief import Track
from robocup_vision.camera import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.planning.gaze.pose_gaze import GOAL_DETECTORS, Gaze, Neck, PoseGaze, PoseGazeSettings
from sim2d.robot_link import RobotLimits

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class HeadSettings:
    """Values of `Head`.

    Attributes
    ----------
    watch_s, sweep_s : float
        The head watches the ball for so long, then looks for goals for so long, in turn.
    sweep_rad : float
        A sweep reaches so far to either side: goals seldom stand behind.
    replan_s : float
        A planned gaze is computed anew after this time.
    drift_m, drift_rad : float
        Standard deviations by which a pose drifts in a second without frames.
    gaze : PoseGazeSettings
        Of the planned gaze.
    """

    watch_s: float = 1.5
    sweep_s: float = 1.5
    sweep_rad: float = 1.4
    replan_s: float = 0.1
    drift_m: float = 0.03
    drift_rad: float = 0.05
    gaze: PoseGazeSettings = PoseGazeSettings()


class Head:
    """Turns one robot's head.

    Parameters
    ----------
    field : Field
        The pitch.
    limits : RobotLimits
        Of all robots on it.
    camera : PinholeCamera
        On the head.
    plans : bool
        Look for goals where most is to be learnt of the pose; else sweep.
    settings : HeadSettings
        See there.

    Attributes
    ----------
    pan_rad : float
        Of the last frame.
    gaze : Gaze or None
        What was planned last; None if nothing is planned now.
    """

    def __init__(
        self,
        field: Field,
        limits: RobotLimits,
        camera: PinholeCamera,
        *,
        plans: bool,
        settings: HeadSettings = HeadSettings(),
    ) -> None:
        self._limits, self._settings = limits, settings
        self._neck = Neck(min(settings.sweep_rad, limits.pan_limit_rad), limits.pan_rps)
        self._planner = (
            PoseGaze(field, camera, self._neck, detectors=GOAL_DETECTORS, settings=settings.gaze) if plans else None
        )
        self._drift = np.diag([settings.drift_m**2, settings.drift_m**2, settings.drift_rad**2])
        self.pan_rad = 0.0
        self.gaze: Gaze | None = None
        self._planned_s = -math.inf

    def observe(self, located: bool) -> None:
        """Let the planner observe whether the last frame located the robot."""
        if self._planner is not None:
            self._planner.observe(located, self.pan_rad)

    def turn(self, t_s: float, pose: PoseEstimate | NotLocated, ball: Point | None, tracks: Sequence[Track]) -> float:
        """Return the pan to command.

        Parameters
        ----------
        t_s : float
            Now.
        pose : PoseEstimate or NotLocated
            The robot, field frame.
        ball : (float, float) or None
            The ball, field frame.
        tracks : sequence of Track
            Robots that may hide goals.
        """
        settings = self._settings
        phase_s = t_s % (settings.watch_s + settings.sweep_s)
        gaze = None
        if pose and ball is not None and phase_s < settings.watch_s:
            at = pose.pose.inverse().transform(ball)
            wanted = math.atan2(at[1], at[0])
        elif ball is not None and self._planner is not None:
            gaze = self.gaze
            if gaze is None or t_s - self._planned_s >= settings.replan_s:
                gaze = self._planner.choose(pose, t_s, self.pan_rad, self._blockers(tracks), self._drift)
                self._planned_s = t_s
            wanted = gaze.pan_rad
        else:
            wanted = self._neck.sweep(phase_s, settings.sweep_s)
        self.gaze = gaze
        return max(-self._neck.limit_rad, min(self._neck.limit_rad, wanted))

    def _blockers(self, tracks: Sequence[Track]) -> list[Disc]:
        radius_m, height_m = self._limits.radius_m, self._limits.height_m
        return [Disc(t.x_m, t.y_m, radius_m, t.covariance[:2, :2], height_m=height_m) for t in tracks]
