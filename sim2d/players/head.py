"""Gaze of a player's camera: a head looks at ball, goals and undecided floor; a fixed camera turns with its robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from field_models.field import Field
from robocup_vision.belief import Hypothesis, MapPicture, Track
from robocup_vision.camera import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FREE, NO_GO
from robocup_vision.planning import (
    Fixation,
    GoalQuestion,
    Neck,
    SelectiveLook,
)
from robocup_vision.planning.gaze.field_landmarks import field_landmarks
from robocup_vision.planning.gaze.goal_question import identified_goal
from robocup_vision.planning.gaze.pose_gaze import GOAL_DETECTORS, PoseGaze
from robocup_vision.view import View
from sim2d.players.plan import Plan
from sim2d.robot_link import Point, RobotLimits

# `FieldHalf`: distance after which the search for a goal restarts, because missed goals may be visible from there.
_ELSEWHERE_M = 0.3
# `FloorLook`: greatest difference from the wanted pan at which a frame counts as a look.
_ARRIVED_RAD = 0.15
# `PoseLook`: standard deviation of the position at which the robot starts to look. On a large field errors are 1.3
# times the standard deviation, and at three times this the robot is not located within 15 cm.
UNSURE_M = 0.035
# Standard deviation at which the robot stops looking.
SURE_M = 0.0175
# Least distance of a crossing; nearer ones would soon be below the picture.
_NEAREST_CROSSING_M = 0.5
# `Head`: duration of watching the ball and, in turn with it, of looking for goals.
WATCH_S = 1.5
# Greatest pan of a sweep; goals are seldom behind.
_SWEEP_RAD = 1.4
# Standard deviation of the heading at which the head looks for goals instead of the ball: at three times this the
# robot is not located within 5 degrees.
_UNSURE_RAD = 0.03
# Number of successive frames without a pose after which the head also looks for goals: robots crowding around the ball
# hide everything else, and a push turns a robot without its odometry noticing.
UNLOCATED_LOOKS = 6
# Time after which a planned gaze is computed again.
_REPLAN_S = 0.1
# Standard deviations by which a pose drifts in a second without frames.
_DRIFT_M = 0.03
_DRIFT_RAD = 0.05


class FieldHalf:
    """Chooses looks at goals that decide the field half, while the pose filter has two modes half a turn apart."""

    def __init__(self, field: Field, camera: PinholeCamera, neck: Neck) -> None:
        self._field = field
        self._question = GoalQuestion(field, camera, neck)
        # position of the first look of the present search; None: there is none
        self._asked_m: tuple[float, float] | None = None

    def choose(self, hypotheses: Sequence[Hypothesis], pan_rad: float, blockers: Sequence[Disc]) -> Fixation | None:
        """Return a fixation; None if the half is known, or no look from here can decide it.

        Parameters
        ----------
        hypotheses : sequence of Hypothesis
            Hypotheses of the pose filter, most probable first.
        blockers : sequence of Disc
            Robots that may hide a goal, field frame of the first hypothesis.
        """
        halves = mirrored(hypotheses)
        if not halves:
            return None
        here = (halves[0].pose.x_m, halves[0].pose.y_m)
        if self._asked_m is not None:
            turned = (-here[0], -here[1])
            if min(math.dist(self._asked_m, here), math.dist(self._asked_m, turned)) > _ELSEWHERE_M:
                self.forget()
        fixation = self._question.choose(halves, pan_rad, blockers)
        if fixation.answer == "decided":
            self.forget()
        if fixation.answer != "look":
            return None
        self._asked_m = self._asked_m or here
        return fixation

    def observe(self, hypotheses: Sequence[Hypothesis], pan_rad: float, view: View) -> None:
        """Update with the view of a frame at this pan, during a search."""
        halves = mirrored(hypotheses)
        if self._asked_m is None or not halves:
            return
        measured = view.pose if view.measurement is None else view.measurement
        camera = measured.seen_from(view.camera.camera_in_robot) if measured else measured
        self._question.observe(halves, pan_rad, identified_goal(self._field, camera))

    def forget(self) -> None:
        """End the search and forget its missed goals."""
        self._question.forget()
        self._asked_m = None


def mirrored(hypotheses: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the most probable hypothesis and its half turn; empty if it has none."""
    for other in hypotheses[1:]:
        if sum(other.pose.half_turn().error_to(hypotheses[0].pose)) < 1e-6:
            return hypotheses[0], other
    return ()


class FloorLook:
    """Chooses looks at undecided floor for one player.

    Parameters
    ----------
    half_view_rad : float
        Half of the camera's horizontal field of view.
    """

    def __init__(self, limits: RobotLimits, half_view_rad: float) -> None:
        self._limits, self._half_view_rad = limits, half_view_rad
        self._planner: SelectiveLook | None = None
        # the last chosen look: its pan, the place looked at, and the robot's position
        self._wanted: tuple[float, Point, Point] | None = None

    def choose(self, floor: MapPicture, robot: Pose2, target: Point) -> tuple[float, str] | None:
        """Return the pan of a look and its reason; None if no look would show more of the way.

        Parameters
        ----------
        target : (float, float)
            Place to drive to, field frame; a place off the map is moved to its border.
        """
        self._wanted = None
        here = (robot.x_m, robot.y_m)
        side_m = floor.cell_m * len(floor.state)
        corner = np.array(floor.corner_m)
        inside = np.clip(target, corner + 0.5 * floor.cell_m, corner + side_m - 0.5 * floor.cell_m)
        if not ((corner <= here) & (corner + side_m > here)).all():
            return None
        if self._planner is None:
            radius_m = self._limits.radius_m
            self._planner = SelectiveLook(floor.cell_m, radius_m, self._half_view_rad)
        free, no_go = floor.state == FREE, floor.state == NO_GO
        # the floor under the robot is free, but not visible to its camera
        x, y = (corner[k] + floor.cell_m * (np.arange(len(floor.state)) + 0.5) for k in (0, 1))
        free |= np.hypot(x[:, None] - here[0], y - here[1]) < 2.0 * self._limits.radius_m
        chosen = self._planner.choose(free, no_go & ~free, floor.corner_m, here, (float(inside[0]), float(inside[1])))
        if chosen.at_m is None:
            return None
        at = robot.inverse().transform(chosen.at_m)
        pan_rad = math.atan2(at[1], at[0])
        self._wanted = (pan_rad, chosen.at_m, here)
        return pan_rad, chosen.reason

    def observe(self, pan_rad: float) -> None:
        """Update with a frame at this pan."""
        if self._planner is None or self._wanted is None:
            return
        wanted_rad, at_m, from_m = self._wanted
        if abs(pan_rad - wanted_rad) < _ARRIVED_RAD:
            self._planner.observe(at_m, from_m)
            self._wanted = None


class PoseLook:
    """Chooses directions for a robot with a fixed camera."""

    def __init__(self, field: Field) -> None:
        self._crossings = [(mark.x_m, mark.y_m) for mark in field_landmarks(field) if mark.kind == "crossing"]
        self._looks = False

    def direction_rad(self, robot: PoseEstimate) -> float | None:
        """Return the direction to face, field frame; None if the position is accurate, or no crossing is far enough.

        Two crossing lines determine a pose completely, and the nearest ones most accurately.
        """
        x_m, y_m = robot.pose.x_m, robot.pose.y_m
        self._looks = max(robot.std[:2]) > (SURE_M if self._looks else UNSURE_M)
        if not self._looks:
            return None
        ways = [(x - x_m, y - y_m) for x, y in self._crossings]
        ahead = [way for way in ways if math.hypot(*way) > _NEAREST_CROSSING_M]
        if not ahead:
            return None
        x, y = min(ahead, key=lambda way: math.hypot(*way))
        return math.atan2(y, x)

    def on_the_way(self, plan: Plan, robot: PoseEstimate, attacks: int) -> Plan:
        """Return the plan with the heading for a look, unless the ball is close; `attacks` as in the setup."""
        look_rad = self.direction_rad(robot)
        if look_rad is None or plan.close or plan.holding:
            return plan
        return replace(plan, heading_rad=look_rad if attacks > 0 else look_rad + math.pi, looks=True)


@dataclass(frozen=True, slots=True, eq=False)
class HeadView:
    """The estimates for a head's gaze, field frame."""

    #: Pose of the robot.
    pose: PoseEstimate | NotLocated
    #: Hypotheses of its pose, most probable first.
    hypotheses: tuple[Hypothesis, ...]
    #: Position of the ball.
    ball: Point | None
    #: Robots that may hide goals.
    tracks: tuple[Track, ...]
    #: The map of the free floor.
    floor: MapPicture | None
    #: Target of the robot's drive.
    target: Point | None


@dataclass(frozen=True, slots=True)
class HeadPlan:
    """A planned pan of the head."""

    #: Angle from straight ahead, positive to the left.
    pan_rad: float
    #: Purpose: "planned" for the pose, "sweep" without a plan, "half" for the field half, "floor" for undecided floor.
    choice: Literal["planned", "sweep", "half", "floor"]
    #: Reason of the choice.
    reason: str


class Head:
    """Turns one robot's head.

    Parameters
    ----------
    plans : bool
        Whether to look for goals at the pan that measures the pose best; otherwise it sweeps.
    asks : bool
        Whether to look for goals that decide the half of the field while it is unknown.
    looks_again : bool
        Whether to look at undecided floor on the way.

    Attributes
    ----------
    pan_rad : float
        Pan of the last frame.
    gaze : HeadPlan or None
        The last plan; None if there is none.
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
    ) -> None:
        self._limits = limits
        self._neck = Neck(min(_SWEEP_RAD, limits.pan_limit_rad), limits.pan_rps)
        self._planner = PoseGaze(field, camera, self._neck, detectors=GOAL_DETECTORS) if plans else None
        self._drift = np.diag([_DRIFT_M**2, _DRIFT_M**2, _DRIFT_RAD**2])
        self.pan_rad = 0.0
        self.gaze: HeadPlan | None = None
        self._half = FieldHalf(field, camera, self._neck) if asks else None
        half_view_rad = math.atan(camera.size_px[0] / 2 / camera.focal_px[0])
        self._floor = FloorLook(limits, half_view_rad) if looks_again else None
        self._planned_s = -math.inf
        # number of frames since the last one with a pose
        self._unlocated = 0

    def observe(self, view: View, hypotheses: Sequence[Hypothesis]) -> None:
        """Update with the view of the last frame, and the pose filter's hypotheses before it."""
        self._unlocated = 0 if view.pose else self._unlocated + 1
        if self._planner is not None:
            self._planner.observe(bool(view.pose), self.pan_rad)
        if self._half is not None:
            self._half.observe(hypotheses, self.pan_rad, view)
        if self._floor is not None:
            self._floor.observe(self.pan_rad)

    def turn(self, t_s: float, now: HeadView) -> float:
        """Return the pan to command, from the estimates at a time (seconds)."""
        phase_s = t_s % (2 * WATCH_S)
        pose, ball = now.pose, now.ball
        gaze = self._ask(t_s, now)
        if gaze is not None:
            wanted = gaze.pan_rad
        elif pose and ball is not None and phase_s < WATCH_S and not self._is_unsure(pose):
            at = pose.pose.inverse().transform(ball)
            wanted = math.atan2(at[1], at[0])
        elif ball is not None and self._planner is not None:
            gaze = self.gaze
            if gaze is None or gaze.choice == "half" or t_s - self._planned_s >= _REPLAN_S:
                gaze = self._look_at_floor(now) or self._look_for_pose(self._planner, t_s, now)
                self._planned_s = t_s
            wanted = gaze.pan_rad
        else:
            wanted = self._neck.sweep(phase_s, WATCH_S)
        self.gaze = gaze
        return max(-self._neck.limit_rad, min(self._neck.limit_rad, wanted))

    def _is_unsure(self, pose: PoseEstimate) -> bool:
        is_unsure = math.sqrt(float(pose.covariance[2, 2])) > _UNSURE_RAD
        return is_unsure or self._unlocated >= UNLOCATED_LOOKS

    def _ask(self, t_s: float, now: HeadView) -> HeadPlan | None:
        """Return a look that decides the half of the field; None if it is known or no look decides."""
        if self._half is None or not now.pose:
            return None
        if self.gaze is not None and self.gaze.choice == "half" and t_s - self._planned_s < _REPLAN_S:
            return self.gaze
        fixation = self._half.choose(now.hypotheses, self.pan_rad, self._blockers(now.tracks))
        if fixation is None or fixation.pan_rad is None:
            return None
        self._planned_s = t_s
        return HeadPlan(fixation.pan_rad, "half", fixation.reason)

    def _look_at_floor(self, now: HeadView) -> HeadPlan | None:
        """Return a look at undecided floor on the way; None if the head cannot reach it."""
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
