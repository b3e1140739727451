"""Turns the head that carries a player's camera: to the ball, and in between to goals or undecided floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from field_models.field import Field
from robocup_vision.belief import Hypothesis, MapPicture, Track
from robocup_vision.camera import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.planning.gaze.pose_gaze import GOAL_DETECTORS, Neck, PoseGaze, PoseGazeSettings
from robocup_vision.view import View
from sim2d.players.field_half import FieldHalf, FieldHalfSettings
from sim2d.players.floor_look import FloorLook, FloorLookSettings
from sim2d.robot_link import RobotLimits

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class HeadSettings:
    """Values of `Head`."""

    #: The head watches the ball for so long, then looks for goals for so long, in turn.
    watch_s: float = 1.5
    sweep_s: float = 1.5
    #: A sweep reaches so far to either side: goals seldom stand behind.
    sweep_rad: float = 1.4
    #: Standard deviation of the heading from which on the head looks for goals though it would watch the ball: at three
    #: of them a robot is no longer located within 5 degrees.
    unsure_rad: float = 0.03
    #: As much after so many frames in a row without a pose: where robots crowd around the ball it hides everything
    #: else, and a push turns a robot by more than its odometry tells.
    unlocated_looks: int = 6
    #: A planned gaze is computed anew after this time.
    replan_s: float = 0.1
    #: Standard deviations by which a pose drifts in a second without frames.
    drift_m: float = 0.03
    drift_rad: float = 0.05
    #: Of the planned gaze.
    gaze: PoseGazeSettings = PoseGazeSettings()
    #: Of the question for the half of the field.
    half: FieldHalfSettings = FieldHalfSettings()
    #: Of looks at undecided floor.
    floor: FloorLookSettings = FloorLookSettings()


@dataclass(frozen=True, slots=True, eq=False)
class HeadView:
    """The estimates from which a head is turned, field frame."""

    #: The robot.
    pose: PoseEstimate | NotLocated
    #: Poses that it may have, most probable first.
    hypotheses: tuple[Hypothesis, ...]
    #: The ball.
    ball: Point | None
    #: Robots that may hide goals.
    tracks: tuple[Track, ...]
    #: The map of the free floor.
    floor: MapPicture | None
    #: Where the robot drives to.
    target: Point | None


@dataclass(frozen=True, slots=True)
class HeadPlan:
    """A planned pan of the head."""

    #: From straight ahead, positive to the left.
    pan_rad: float
    #: For the pose, or without a plan; for the half of the field; for undecided floor.
    choice: Literal["planned", "sweep", "half", "floor"]
    #: Why.
    reason: str


class Head:
    """Turns one robot's head.

    Parameters
    ----------
    plans : bool
        Look for goals at the pan that measures the pose best; else sweep.
    asks : bool
        Ask for the half of the field by looks at goals while it is not known.
    looks_again : bool
        Look at undecided floor on the way.

    Attributes
    ----------
    pan_rad : float
        Of the last frame.
    gaze : HeadPlan or None
        The last plan; None if nothing is planned now.
    """

    def __init__(
        self,
        field: Field,
        limits: RobotLimits,
        camera: PinholeCamera,
        *,
        plans: bool,
        asks: bool = False,
        looks_again: bool = False,
        settings: HeadSettings = HeadSettings(),
    ) -> None:
        self._limits, self._settings = limits, settings
        self._neck = Neck(min(settings.sweep_rad, limits.pan_limit_rad), limits.pan_rps)
        self._planner = (
            PoseGaze(field, camera, self._neck, detectors=GOAL_DETECTORS, settings=settings.gaze) if plans else None
        )
        self._drift = np.diag([settings.drift_m**2, settings.drift_m**2, settings.drift_rad**2])
        self.pan_rad = 0.0
        self.gaze: HeadPlan | None = None
        self._half = FieldHalf(field, camera, self._neck, settings.half) if asks else None
        half_view_rad = math.atan(camera.size_px[0] / 2 / camera.focal_px[0])
        self._floor = FloorLook(limits, half_view_rad, settings.floor) if looks_again else None
        self._planned_s = -math.inf
        # frames without a pose since the last one with
        self._unlocated = 0

    def observe(self, view: View, hypotheses: Sequence[Hypothesis]) -> None:
        """Let the planners observe the view of the last frame, with the pose filter's hypotheses before it."""
        self._unlocated = 0 if view.pose else self._unlocated + 1
        if self._planner is not None:
            self._planner.observe(bool(view.pose), self.pan_rad)
        if self._half is not None:
            self._half.observe(hypotheses, self.pan_rad, view)
        if self._floor is not None:
            self._floor.observe(self.pan_rad)

    def turn(self, t_s: float, now: HeadView) -> float:
        """Return the pan to command, from the estimates at a time (seconds)."""
        settings = self._settings
        phase_s = t_s % (settings.watch_s + settings.sweep_s)
        pose, ball = now.pose, now.ball
        gaze = self._ask(t_s, now)
        if gaze is not None:
            wanted = gaze.pan_rad
        elif pose and ball is not None and phase_s < settings.watch_s and not self._is_unsure(pose):
            at = pose.pose.inverse().transform(ball)
            wanted = math.atan2(at[1], at[0])
        elif ball is not None and self._planner is not None:
            gaze = self.gaze
            if gaze is None or gaze.choice == "half" or t_s - self._planned_s >= settings.replan_s:
                gaze = self._look_at_floor(now) or self._look_for_pose(self._planner, t_s, now)
                self._planned_s = t_s
            wanted = gaze.pan_rad
        else:
            wanted = self._neck.sweep(phase_s, settings.sweep_s)
        self.gaze = gaze
        return max(-self._neck.limit_rad, min(self._neck.limit_rad, wanted))

    def _is_unsure(self, pose: PoseEstimate) -> bool:
        settings = self._settings
        is_unsure = math.sqrt(float(pose.covariance[2, 2])) > settings.unsure_rad
        return is_unsure or self._unlocated >= settings.unlocated_looks

    def _ask(self, t_s: float, now: HeadView) -> HeadPlan | None:
        """Return a look that decides the half of the field; None if it is known, or no look decides."""
        if self._half is None or not now.pose:
            return None
        if self.gaze is not None and self.gaze.choice == "half" and t_s - self._planned_s < self._settings.replan_s:
            return self.gaze
        fixation = self._half.choose(now.hypotheses, self.pan_rad, self._blockers(now.tracks))
        if fixation is None or fixation.pan_rad is None:
            return None
        self._planned_s = t_s
        return HeadPlan(fixation.pan_rad, "half", fixation.reason)

    def _look_at_floor(self, now: HeadView) -> HeadPlan | None:
        """Return a look at undecided floor on the way, where the head reaches it."""
        if self._floor is None or not now.pose or now.floor is None or now.target is None:
            return None
        look = self._floor.choose(now.floor, now.pose.pose, now.target)
        if look is None or abs(look[0]) > self._neck.limit_rad:
            return None
        return HeadPlan(look[0], "floor", look[1])

    def _look_for_pose(self, planner: PoseGaze, t_s: float, now: HeadView) -> HeadPlan:
        gaze = planner.choose(now.pose, t_s, self.pan_rad, self._blockers(now.tracks), self._drift)
        return HeadPlan(gaze.pan_rad, "planned" if gaze.planned else "sweep", gaze.reason)

    def _blockers(self, tracks: Sequence[Track]) -> list[Disc]:
        radius_m, height_m = self._limits.radius_m, self._limits.height_m
        return [Disc(t.x_m, t.y_m, radius_m, t.covariance[:2, :2], height_m=height_m) for t in tracks]
