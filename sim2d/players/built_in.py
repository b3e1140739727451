"""The built-in player: from camera frames and odometry alone to commands for one robot.

What it believes comes from `Vision` and `Memory`; what it wants from `player_tactics`, in its team's frame; how it
gets there from `player_motion`; by which way and how fast, if it plans, from `player_planning`.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.avoidance.steady_free_space import SteadyFreeSpace, carry_free_space
from robocup_vision.belief import Track
from robocup_vision.camera import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.memory import Memory
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.planning.gaze.pose_gaze import GOAL_DETECTORS, Gaze, Neck, PoseGaze
from robocup_vision.planning.shots.shot_planner import ShotPlan
from robocup_vision.view import View
from robocup_vision.vision import Vision
from sim2d.kick_off import kick_off_pose
from sim2d.players.ball_memory import BallMemory, HiddenBall, Point, block_ball, is_in_sight
from sim2d.players.driving.motion import Motion
from sim2d.players.driving.travel import Travel, TravelPlanner
from sim2d.players.plan import Plan, Situation
from sim2d.players.shot import Shooter
from sim2d.players.surroundings import Surroundings
from sim2d.players.tactics.tactics import Tactics
from sim2d.robot_link import CONTROL_PERIOD_S, Command, PlayerSetup, PlayerStatus, Reason, Senses

# what was seen is driven by for so long; after that the robot stops until it sees again
_SIGHT_S = 0.4
# a ball that has not been seen for so long where nothing hides it is gone
_MISSED_S = 0.5
# a ball unseen for so long is hidden by who had it
_HIDDEN_S = 0.15
# a head looks at the ball, then sweeps for goals: seconds of each, and how far it sweeps
_WATCH_S, _SWEEP_S, _SWEEP_RAD = 1.5, 1.5, 1.4
# how fast a robot turns that does not know where it is
_LOST_RPS = 1.0
_NOWHERE = Pose2(0.0, 0.0, 0.0)
# where to look is planned anew so often; how a pose's covariance grows in a second without frames
_GAZE_S = 0.1
_DRIFT = np.diag([0.03**2, 0.03**2, 0.05**2])


class BuiltInPlayer:
    """Plays one robot; satisfies `sim2d.robot_link.Player`.

    Parameters
    ----------
    setup : PlayerSetup
        What it knows before the match.
    remembers : bool
        Follow who moves on the field and keep a map of the floor: steering then keeps clear of where others will be.
    plans : bool
        Choose ways between others, speeds and, for a head that turns, where to look by what is believed. It remembers
        then, too.
    """

    def __init__(self, setup: PlayerSetup, *, remembers: bool = False, plans: bool = False) -> None:
        self._setup = setup
        camera = setup.camera
        self._head: PinholeCamera | None = None
        if isinstance(camera, PinholeCamera):
            self._head = camera
        self._memory = Memory.of_everything(setup.field) if remembers or plans else Memory(setup.field)
        self._vision = Vision(setup.field, camera, memory=self._memory)
        self._filter = self._memory.poses
        # the rules say where it begins, up to what a frame has to say
        self._filter.expect(
            kick_off_pose(setup.field, setup.attacks, setup.number, setup.players, setup.limits.radius_m)
        )
        self._tactics = Tactics(setup.field, setup.limits, setup.number, setup.players)
        self._motion = Motion(setup.limits, np.random.default_rng(setup.seed))
        self._ball = BallMemory()
        self._reach_m = setup.limits.radius_m + setup.field.ball_radius_m
        self._hidden: HiddenBall | None = None
        self._view: View | None = None
        self._view_t_s = -math.inf
        self._floor = SteadyFreeSpace()
        self._free_space: FreeSpace | None = None
        self._last_frame: UInt8Array | None = None
        self._last_t_s: float | None = None
        self._held_since_s: float | None = None
        # of the last frame
        self._pan_rad = 0.0
        self._neck = Neck(min(_SWEEP_RAD, setup.limits.pan_limit_rad), setup.limits.pan_rps)
        self._intent = "wait"
        self._why: Reason | None = None
        self._planner: TravelPlanner | None = None
        self._shooter: Shooter | None = None
        self._gaze_planner: PoseGaze | None = None
        if plans and self._memory.free_map is not None:
            self._hidden = HiddenBall(self._reach_m)
            self._planner = TravelPlanner(setup.field, setup.limits, self._memory.free_map.looks_to_free)
            # a keeper does not shoot
            if setup.field.goals and not self._tactics.is_keeper:
                self._shooter = Shooter(setup.field, setup.limits, setup.attacks)
            if self._head is not None:
                self._gaze_planner = PoseGaze(setup.field, self._head, self._neck, detectors=GOAL_DETECTORS)
        self._travel: Travel | None = None
        self._gaze: Gaze | None = None
        self._gaze_s = -math.inf

    @property
    def status(self) -> PlayerStatus:
        """Estimates and plans after the last `act`."""
        place = None if self._last_t_s is None else self._ball.place(self._last_t_s)
        travel, gaze = self._travel, self._gaze
        reasons = () if travel is None else travel.reasons
        if self._why is not None:
            reasons += (self._why,)
        if gaze is not None:
            reasons += (Reason("gaze", "planned" if gaze.planned else "sweep", gaze.reason),)
        return PlayerStatus(
            self._filter.belief,
            place,
            self._intent,
            self._view,
            reasons,
            None if travel is None else travel.waypoint,
            None if travel is None else travel.gap,
            None if travel is None else travel.speed_mps,
            gaze.pan_rad if gaze is not None else None,
        )

    def act(self, senses: Senses) -> Command:
        """Return what the robot shall do until the next senses come."""
        self._travel = self._why = None
        self._update(senses)
        self._look(senses)
        command = self._decide(senses)
        pan = self._turn_head(senses.t_s) if self._head is not None else None
        numbers = (command.forward_mps, command.left_mps, command.turn_rps, command.kick_mps)
        if not all(map(math.isfinite, numbers)):
            return Command(pan_rad=pan)
        return dataclasses.replace(command, pan_rad=pan)

    def _update(self, senses: Senses) -> None:
        odometry = senses.odometry
        if not all(map(math.isfinite, (odometry.x_m, odometry.y_m, odometry.theta_rad))):
            odometry = _NOWHERE
        self._filter.predict(odometry, senses.t_s)
        self._motion.update(odometry, senses.t_s)
        self._last_t_s = senses.t_s
        if not senses.ball_in_mouth:
            self._held_since_s = None
        elif self._held_since_s is None:
            self._held_since_s = senses.t_s

    def _look(self, senses: Senses) -> None:
        """See the frame, unless there is none or it is the last one again: then the camera stands still."""
        frame, frame_t_s = senses.frame, senses.frame_t_s
        if frame is None or frame_t_s is None:
            return
        if self._last_frame is not None and np.array_equal(frame, self._last_frame):
            return
        self._last_frame = frame.copy()
        if senses.frame_pan_rad is not None:
            self._pan_rad = senses.frame_pan_rad
        view = self._vision.look(frame, frame_t_s, pan_rad=None if self._head is None else self._pan_rad)
        if self._gaze_planner is not None:
            self._gaze_planner.observe(bool(view.pose), self._pan_rad)
        self._view = view
        if view.polar is None or not view.marks.any():
            return
        belief, motion = self._filter.belief, self._filter.motion_since(frame_t_s)
        before = self._filter.motion_since(self._view_t_s)
        if before is None or motion is None:
            self._floor = SteadyFreeSpace()
        moved = _NOWHERE if before is None or motion is None else before.compose(motion.inverse())
        self._free_space = view.free_space if self._head else self._floor.update(view.free_space, moved)
        self._view_t_s = frame_t_s
        if belief and motion is not None and view.ball is not None:
            ball = belief.pose.compose(motion.inverse()).compose(Pose2(view.ball.x_m, view.ball.y_m, 0.0))
            self._ball.update((ball.x_m, ball.y_m), frame_t_s)
            if self._hidden is not None:
                self._hidden.update((ball.x_m, ball.y_m), *self._tracks(frame_t_s))

    def _decide(self, senses: Senses) -> Command:
        belief = self._filter.belief
        motion = self._filter.motion_since(self._view_t_s)
        if (
            not belief
            or motion is None
            or senses.t_s - self._view_t_s > _SIGHT_S
            or self._view is None
            or not self._free_space
        ):
            self._intent = "look around" if self._view is not None else "wait"
            blind = senses.t_s - self._view_t_s > _SIGHT_S
            return Command(turn_rps=0.0 if blind or self._head is not None else _LOST_RPS)
        pose = belief.pose
        free_space = self._free_space_now(self._free_space, motion)
        seen_from = pose.compose(motion.inverse())
        # nothing but the ball has room so near
        nearest = self._setup.limits.radius_m + 2 * self._setup.field.ball_radius_m
        things = [seen_from.compose(Pose2(o.x_m, o.y_m, 0.0)) for o in self._view.obstacles if o.range_m > nearest]
        if senses.ball_in_mouth:
            mouth = pose.compose(Pose2(self._reach_m, 0.0, 0.0))
            self._ball.update((mouth.x_m, mouth.y_m), senses.t_s)
        ball = self._ball.place(senses.t_s)
        if ball is not None and self._ball.age_s(senses.t_s) > _MISSED_S:
            there = pose.inverse().transform(ball)
            if is_in_sight(free_space, (float(there[0]), float(there[1]))):
                self._ball.miss()
                ball = None
        velocity = self._ball.velocity_mps
        if self._hidden is not None and _HIDDEN_S < self._ball.age_s(senses.t_s) <= self._ball.settings.forget_s:
            hidden = self._hidden.place((pose.x_m, pose.y_m), *self._tracks(senses.t_s))
            if hidden is not None:
                ball, velocity = hidden
        plan = self._tactics.decide(
            Situation(
                self._in_team(pose),
                None if ball is None else self._point_in_team(ball),
                self._point_in_team(velocity),
                senses.ball_in_mouth,
                0.0 if self._held_since_s is None else senses.t_s - self._held_since_s,
                tuple(self._point_in_team((thing.x_m, thing.y_m)) for thing in things),
                senses.phase,
                senses.kick_off,
                senses.t_s,
                self._plan_shot(senses),
                self._others(senses.t_s),
            )
        )
        self._intent, self._why = plan.intent, plan.why
        if ball is not None and plan.avoid_ball:
            at = pose.inverse().transform(ball)
            free_space = block_ball(free_space, (float(at[0]), float(at[1])), self._setup.field.ball_radius_m)
        return self._drive(plan, pose, free_space, senses.t_s)

    def _drive(self, plan: Plan, pose: Pose2, free_space: FreeSpace, t_s: float) -> Command:
        moving = self._moving(pose, t_s)
        self._travel = travel = self._plan_travel(plan, t_s)
        if travel is not None:
            travel = dataclasses.replace(travel, waypoint=self._point_in_team(travel.waypoint))
        return self._motion.drive(plan, self._in_team(pose), free_space, t_s, moving, travel)

    def _plan_shot(self, senses: Senses) -> ShotPlan | None:
        if self._shooter is None or not senses.ball_in_mouth:
            return None
        around = self._around(senses.t_s)
        if around is None:
            return None
        shot = self._shooter.plan(around, senses.odometry.theta_rad / CONTROL_PERIOD_S)
        return shot if self._setup.attacks > 0 else shot.half_turn()

    def _plan_travel(self, plan: Plan, t_s: float) -> Travel | None:
        if self._planner is None:
            return None
        target = self._point_in_team(plan.target)
        if plan.holding:
            return self._planner.carry(target)
        around = self._around(t_s)
        if around is None:
            return None
        if plan.close:
            return self._planner.approach(around, target, self._ball.place(t_s))
        return self._planner.plan(around, target)

    def _around(self, t_s: float) -> Surroundings | None:
        robot = self._filter.belief
        if not isinstance(robot, PoseEstimate):
            return None
        known = None if self._view is None else self._view.belief
        tracks, age_s = self._tracks(t_s)
        c, s = math.cos(robot.pose.theta_rad), math.sin(robot.pose.theta_rad)
        velocity, pending = (
            (c * x - s * y, s * x + c * y) for x, y in (self._motion.now_mps, self._motion.pending_mps)
        )
        return Surroundings(
            t_s,
            robot,
            velocity,
            pending,
            tracks,
            age_s,
            None if known is None else known.free_map,
        )

    def _tracks(self, t_s: float) -> tuple[tuple[Track, ...], float]:
        """Who is followed, and as of how long ago."""
        belief = None if self._view is None else self._view.belief
        return ((), 0.0) if belief is None else (belief.tracks, t_s - belief.t_s)

    def _others(self, t_s: float) -> tuple[Point, ...]:
        """Who is followed, where it is by now, team frame; players that do not plan do not ask."""
        if self._planner is None:
            return ()
        tracks, age_s = self._tracks(t_s)
        return tuple(self._point_in_team(track.place_after(age_s)) for track in tracks)

    def _moving(self, robot: Pose2, t_s: float) -> tuple[Disc, ...]:
        """Who moves on the field, where it is by now, in the robot frame."""
        tracks, age_s = self._tracks(t_s)
        return tuple(track.as_disc(robot, self._setup.limits.radius_m, age_s) for track in tracks)

    def _free_space_now(self, seen: FreeSpace, motion: Pose2) -> FreeSpace:
        if self._head is None:
            return carry_free_space(seen, motion)
        return FreeSpace(seen.bearing_rad - motion.theta_rad, seen.range_m)

    def _in_team(self, pose: Pose2) -> Pose2:
        return pose if self._setup.attacks > 0 else pose.half_turn()

    def _point_in_team(self, point: Point) -> Point:
        return point if self._setup.attacks > 0 else (-point[0], -point[1])

    def _plan_gaze(self, planner: PoseGaze, t_s: float) -> Gaze:
        tracks, _ = self._tracks(t_s)
        radius_m, height_m = self._setup.limits.radius_m, self._setup.limits.height_m
        blockers = [Disc(t.x_m, t.y_m, radius_m, t.covariance[:2, :2], height_m=height_m) for t in tracks]
        return planner.choose(self._filter.belief, t_s, self._pan_rad, blockers, _DRIFT)

    def _turn_head(self, t_s: float) -> float:
        """Watch the ball, and in between look for goals: left and right, or where most is to be learnt of the pose."""
        belief, ball = self._filter.belief, self._ball.place(t_s)
        phase_s = t_s % (_WATCH_S + _SWEEP_S)
        gaze = None
        if belief and ball is not None and phase_s < _WATCH_S:
            at = belief.pose.inverse().transform(ball)
            wanted = math.atan2(at[1], at[0])
        elif ball is not None and self._gaze_planner is not None:
            if self._gaze is None or t_s - self._gaze_s >= _GAZE_S:
                self._gaze, self._gaze_s = self._plan_gaze(self._gaze_planner, t_s), t_s
            gaze = self._gaze
            wanted = gaze.pan_rad
        else:
            wanted = self._neck.sweep(phase_s, _SWEEP_S)
        self._gaze = gaze
        return max(-self._neck.limit_rad, min(self._neck.limit_rad, wanted))
