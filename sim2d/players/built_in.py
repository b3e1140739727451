"""The built-in player: commands for one robot from its camera frames and odometry alone.

`Vision` and `Memory` estimate, `tactics` decides in the team's frame, `driving` plans the way and makes the command.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import UInt8Array
from robocup_vision.avoidance.recent_free_space import RecentFreeSpace, SteadyFreeSpace, carry_free_space
from robocup_vision.belief import Track
from robocup_vision.calibration.online import OnlineCalibration
from robocup_vision.camera import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.planning.shots.shot_planner import ShotPlan
from robocup_vision.view import View
from sim2d.kick_off import kick_off_pose
from sim2d.players.ball import block_ball
from sim2d.players.driving.motion import MotionSettings
from sim2d.players.driving.travel import Travel, TravelPlanner
from sim2d.players.head import Head, HeadView, PoseLook
from sim2d.players.keep_out import allowed_target, block_zones
from sim2d.players.parts import PlayerParts
from sim2d.players.plan import Plan, Situation, Surroundings
from sim2d.players.settings import PlayerSettings
from sim2d.players.shot import Shooter
from sim2d.players.straight_frames import StraightFrames
from sim2d.players.team_talk import TeamTalk
from sim2d.robot_link import CONTROL_PERIOD_S, Command, Phase, Player, PlayerSetup, PlayerStatus, Point, Reason, Senses

_NO_MOTION = Pose2(0.0, 0.0, 0.0)
# covariance of the robot's pose at the kick-off that begins a match: standard deviations of 5 cm and 3 degrees
_START_COVARIANCE = np.diag([0.05, 0.05, math.radians(3.0)]) ** 2
# margin of the filtered free floor, see `SteadyFreeSpace`
_FLOOR_MARGIN_RATIO = 0.02
# greatest age of a frame whose free space is used for driving, since obstacles move; after that the robot stops
_MAX_FRAME_AGE_S = 0.4
# shortest time between looks with a pinhole camera while no pose is expected: a search of the whole field takes as long
# as several other looks, and the errors of successive frames are correlated
_LOST_LOOK_S = 0.1
# turning rate while it is not located, to see more of the field
_LOST_RPS = 1.0

# features that a player may use in addition to the frames and the odometry of its own robot
USES = {
    "memory": "track other robots and keep a map of the floor: steering then keeps clear of where the others will be",
    "plans": "plan ways between others, speeds, shots and where a head looks; it has a memory then, too",
    "messages": "tell the others of the team where the ball is, and agree with them who fetches it",
    "goal_looks": "with a head that turns: while the half of the field is not known, look for a goal that decides",
    "floor_looks": "with plans and a head that turns: look at undecided floor on the way",
}


@dataclass(frozen=True, slots=True)
class BuiltInTeam:
    """Makes built-in players; teams with the same options are equal, also in different processes.

    Raises
    ------
    ArgumentError
        If `uses` names an unknown feature.
    """

    #: Features of its players: names of `USES`.
    uses: tuple[str, ...] = ()
    settings: PlayerSettings = PlayerSettings()
    #: Functions that make the player's parts; users may replace them.
    parts: PlayerParts = PlayerParts()

    def __post_init__(self) -> None:
        for name in self.uses:
            if name not in USES:
                raise ArgumentError(f"a built-in player cannot use '{name}', only {', '.join(USES)}")
        object.__setattr__(self, "uses", tuple(name for name in USES if name in self.uses))

    def __call__(self, setup: PlayerSetup) -> Player:
        """Make one player."""
        return BuiltInPlayer(setup, self)


class BuiltInPlayer:
    """Plays one robot; satisfies `sim2d.robot_link.Player`.

    Raises
    ------
    ArgumentError
        If the localizer has no memory.
    """

    def __init__(self, setup: PlayerSetup, team: BuiltInTeam = BuiltInTeam()) -> None:
        settings, parts, uses = team.settings, team.parts, team.uses
        plans = "plans" in uses
        self._setup = setup
        field, limits, camera = setup.field, setup.limits, setup.camera
        self._head: Head | None = None
        self._sees_ahead_only = setup.sees_ahead_only
        if self._sees_ahead_only and isinstance(camera, PinholeCamera) and limits.pan_limit_rad > 0:
            looks_again = plans and "floor_looks" in uses
            self._head = Head(field, limits, camera, plans=plans, asks="goal_looks" in uses, looks_again=looks_again)
        # where the camera is fixed and does not see all around, the robot itself turns to look
        is_fixed = self._sees_ahead_only and self._head is None
        self._pose_look = PoseLook(field) if is_fixed else None
        self._localizer = parts.localizer(setup, settings, plans or "memory" in uses)
        if self._localizer.memory is None:
            raise ArgumentError("a player's localizer must have a memory")
        self._memory = self._localizer.memory
        self._filter = self._memory.poses
        # the start position of the rules; a frame may contradict it
        self._start = kick_off_pose(field, setup.attacks, setup.number, setup.players, limits.radius_m)
        self._filter.expect(self._start)
        self._straight: StraightFrames | None = None
        if self._sees_ahead_only and isinstance(camera, PinholeCamera) and camera.readout_s:
            self._straight = StraightFrames(camera, self._filter)
        self._tactics = parts.tactics(setup, settings)
        self._driving = parts.driving(setup, settings)
        self._talk: TeamTalk | None = None
        if "messages" in uses:
            role = parts.role(setup, settings, self._tactics.is_keeper)
            self._talk = TeamTalk(setup, role)
        hides = plans and self._memory.free_map is not None
        self._ball = parts.ball(setup, settings, hides, self._talk)
        self._phase: Phase = "play"
        self._view: View | None = None
        self._view_t_s = self._looked_s = -math.inf
        self._floor = SteadyFreeSpace(_FLOOR_MARGIN_RATIO)
        # the recently visible floor of a camera that sees a part of it
        self._recent = RecentFreeSpace(limits.radius_m) if self._sees_ahead_only else None
        # free space in the last frame, and for driving
        self._free_space: FreeSpace | None = None
        self._drivable: FreeSpace | None = None
        self._last_frame: UInt8Array | None = None
        self._last_t_s: float | None = None
        self._held_since_s: float | None = None
        self._intent = "wait"
        self._why: Reason | None = None
        self._planner: TravelPlanner | None = None
        self._shooter: Shooter | None = None
        if plans and self._memory.free_map is not None:
            self._planner = TravelPlanner(field, limits, self._memory.free_map.looks_to_free)
            # keepers do not shoot
            if field.goals and not self._tactics.is_keeper:
                motion = MotionSettings(self._planner.holding_mps, self._planner.holding_rps)
                self._shooter = Shooter(field, limits, setup.attacks, motion=motion)
        self._travel: Travel | None = None
        # target of the drive, field frame
        self._target: Point | None = None

    @property
    def status(self) -> PlayerStatus:
        """Estimates and plans after the last `act`."""
        place = None if self._last_t_s is None else self._ball.place(self._last_t_s)
        travel, gaze = self._travel, None if self._head is None else self._head.gaze
        reasons = () if travel is None else travel.reasons
        online = self._localizer.online
        if self._why is not None:
            reasons += (self._why,)
        if gaze is not None:
            reasons += (Reason("gaze", gaze.choice, gaze.reason),)
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
            self._localizer.colors,
            online.state if isinstance(online, OnlineCalibration) else None,
        )

    def act(self, senses: Senses) -> Command:
        """Return the command that holds until the next senses."""
        self._travel = self._why = self._target = None
        self._update(senses)
        self._look(senses)
        if self._talk is not None:
            if senses.phase == "kick_off" and self._phase != "kick_off":
                self._ball.forget(senses.t_s)
            self._phase = senses.phase
            self._talk.hear(senses.messages, self._ball.sighting)
        command = self._decide(senses)
        pan = None if self._head is None else self._turn_head(self._head, senses.t_s)
        message = None
        if self._talk is not None:
            place = self._ball.place(senses.t_s)
            message = self._talk.tell(senses.t_s, self._filter.belief, self._ball.sighting, place)
        numbers = (command.forward_mps, command.left_mps, command.turn_rps, command.kick_mps)
        if not all(map(math.isfinite, numbers)):
            return Command(pan_rad=pan, message=message)
        return dataclasses.replace(command, pan_rad=pan, message=message)

    def _update(self, senses: Senses) -> None:
        odometry = senses.odometry
        if not all(map(math.isfinite, (odometry.x_m, odometry.y_m, odometry.theta_rad))):
            odometry = _NO_MOTION
        self._filter.predict(odometry, senses.t_s)
        if self._last_t_s is None and senses.phase == "kick_off":
            self._filter.update(PoseEstimate(self._start, _START_COVARIANCE, 1.0, 0.0), senses.t_s)
        self._driving.update(odometry, senses.t_s)
        self._last_t_s = senses.t_s
        if not senses.ball_in_mouth:
            self._held_since_s = None
        elif self._held_since_s is None:
            self._held_since_s = senses.t_s

    def _look(self, senses: Senses) -> None:
        """Process the frame, unless there is none or it equals the last one because the camera has stopped."""
        frame, frame_t_s = senses.frame, senses.frame_t_s
        if frame is None or frame_t_s is None:
            return
        if self._last_frame is not None and np.array_equal(frame, self._last_frame):
            return
        self._last_frame = frame.copy()
        if self._head is not None and senses.frame_pan_rad is not None:
            self._head.pan_rad = senses.frame_pan_rad
        is_soon = frame_t_s - self._looked_s < _LOST_LOOK_S
        if is_soon and self._sees_ahead_only and self._filter.prior(frame_t_s) is None:
            return
        self._looked_s = frame_t_s
        if self._straight is not None:
            frame = self._straight.straighten(frame, frame_t_s, 0.0 if self._head is None else self._head.pan_rad)
        hypotheses = self._filter.hypotheses
        pan_rad = None if self._head is None else self._head.pan_rad
        shown = frame if senses.rig_frames is None else senses.rig_frames
        view = self._localizer.look(shown, frame_t_s, pan_rad=pan_rad)
        if self._head is not None:
            self._head.observe(view, hypotheses)
        self._view = view
        if not any(one.polar is not None and one.marks.any() for one in view.views):
            return
        motion = self._filter.motion_since(frame_t_s)
        before = self._filter.motion_since(self._view_t_s)
        if before is None or motion is None:
            self._floor = SteadyFreeSpace(_FLOOR_MARGIN_RATIO)
            if self._recent is not None:
                self._recent.forget()
        moved = _NO_MOTION if before is None or motion is None else before.compose(motion.inverse())
        if self._recent is None:
            self._free_space = self._drivable = self._floor.update(view.free_space, moved)
        else:
            self._free_space = view.free_space
            self._drivable = self._recent.update(view.free_space, moved, frame_t_s)
        self._view_t_s = frame_t_s
        then = self._filter.belief_at(frame_t_s)
        if then is not None and view.ball is not None:
            self._ball.see(then, view.ball, frame_t_s, *self._tracks(frame_t_s))

    def _decide(self, senses: Senses) -> Command:
        if senses.phase in ("halt", "time_out"):
            self._intent = senses.phase.replace("_", "-")
            return Command()
        belief = self._filter.belief
        motion = self._filter.motion_since(self._view_t_s)
        is_late = senses.t_s - self._view_t_s > _MAX_FRAME_AGE_S
        if not belief or motion is None or is_late or self._view is None or not self._free_space or not self._drivable:
            if self._talk is not None:
                # the robot cannot drive, but another robot may have reported the ball
                pose = belief.pose if belief else None
                known = self._ball.locate(pose, None, senses.t_s, *self._tracks(senses.t_s))
                self._talk.role(pose, known.place, senses.t_s)
            self._intent = "look around" if self._view is not None else "wait"
            return Command(turn_rps=0.0 if is_late or self._head is not None else _LOST_RPS)
        pose = belief.pose
        in_view = self._free_space_now(self._free_space, motion)
        free_space = in_view if self._recent is None else self._free_space_now(self._drivable, motion)
        seen_from = pose.compose(motion.inverse())
        # only the ball fits between the robot and something at this range
        nearest = self._setup.limits.radius_m + 2 * self._setup.field.ball_radius_m
        c, s = math.cos(seen_from.theta_rad), math.sin(seen_from.theta_rad)
        things = [
            (seen_from.x_m + c * o.x_m - s * o.y_m, seen_from.y_m + s * o.x_m + c * o.y_m)
            for o in self._view.obstacles
            if o.range_m > nearest
        ]
        if senses.ball_in_mouth:
            self._ball.hold(belief, senses.t_s)
        known = self._ball.locate(pose, in_view, senses.t_s, *self._tracks(senses.t_s))
        ball = known.place
        plan = self._tactics.decide(
            Situation(
                self._in_team(pose),
                None if ball is None else self._point_in_team(ball),
                self._point_in_team(known.velocity_mps),
                senses.ball_in_mouth,
                0.0 if self._held_since_s is None else senses.t_s - self._held_since_s,
                tuple(map(self._point_in_team, things)),
                senses.phase,
                senses.own_turn,
                senses.t_s,
                self._plan_shot(senses),
                self._others(senses.t_s),
                None if senses.placement_in_field is None else self._point_in_team(senses.placement_in_field),
                None if self._talk is None else self._talk.role(pose, ball, senses.t_s),
            )
        )
        if self._pose_look is not None:
            plan = self._pose_look.on_the_way(plan, belief, self._setup.attacks)
        self._intent, self._why = plan.intent, plan.why
        self._target = self._point_in_team(plan.target)
        if plan.keep_outs:
            here, radius_m = self._in_team(pose), self._setup.limits.radius_m
            place = allowed_target(plan.target, (here.x_m, here.y_m), plan.keep_outs, radius_m)
            plan = dataclasses.replace(plan, target=place)
            free_space = block_zones(free_space, here, plan.keep_outs, radius_m)
        if ball is not None and plan.avoid_ball:
            at = pose.inverse().transform(ball)
            free_space = block_ball(free_space, (float(at[0]), float(at[1])), self._setup.field.ball_radius_m)
        return self._drive(plan, pose, free_space, senses.t_s)

    def _drive(self, plan: Plan, pose: Pose2, free_space: FreeSpace, t_s: float) -> Command:
        moving = self._moving(pose, t_s)
        self._travel = travel = self._plan_travel(plan, t_s)
        if travel is not None:
            travel = dataclasses.replace(travel, waypoint=self._point_in_team(travel.waypoint))
        return self._driving.drive(plan, self._in_team(pose), free_space, t_s, moving, travel)

    def _plan_shot(self, senses: Senses) -> ShotPlan | None:
        if self._shooter is None or not senses.ball_in_mouth:
            return None
        surroundings = self._surroundings(senses.t_s)
        if surroundings is None:
            return None
        shot = self._shooter.plan(surroundings, senses.odometry.theta_rad / CONTROL_PERIOD_S)
        return shot if self._setup.attacks > 0 else shot.half_turn()

    def _plan_travel(self, plan: Plan, t_s: float) -> Travel | None:
        if self._planner is None:
            return None
        target = self._point_in_team(plan.target)
        if plan.holding:
            return self._planner.carry(target)
        if plan.close or plan.races:
            return self._planner.race(target)
        surroundings = self._surroundings(t_s)
        return None if surroundings is None else self._planner.plan(surroundings, target)

    def _surroundings(self, t_s: float) -> Surroundings | None:
        robot = self._filter.belief
        if not isinstance(robot, PoseEstimate):
            return None
        known = None if self._view is None else self._view.belief
        tracks, age_s = self._tracks(t_s)
        c, s = math.cos(robot.pose.theta_rad), math.sin(robot.pose.theta_rad)
        velocity, pending = (
            (c * x - s * y, s * x + c * y) for x, y in (self._driving.now_mps, self._driving.pending_mps)
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
        """Return the tracked robots, and the age of these tracks."""
        belief = None if self._view is None else self._view.belief
        return ((), 0.0) if belief is None else (belief.tracks, t_s - belief.t_s)

    def _others(self, t_s: float) -> tuple[Point, ...]:
        """Return the present places of tracked robots, team frame; empty for players that do not plan."""
        if self._planner is None:
            return ()
        tracks, age_s = self._tracks(t_s)
        return tuple(self._point_in_team(track.place_after(age_s)) for track in tracks)

    def _moving(self, robot: Pose2, t_s: float) -> tuple[Disc, ...]:
        """Return tracked robots as moving obstacles at their present places, robot frame."""
        tracks, age_s = self._tracks(t_s)
        return tuple(track.as_disc(robot, self._setup.limits.radius_m, age_s) for track in tracks)

    def _free_space_now(self, seen: FreeSpace, motion: Pose2) -> FreeSpace:
        if not self._sees_ahead_only:
            return carry_free_space(seen, motion)
        return FreeSpace(seen.bearing_rad - motion.theta_rad, seen.range_m)

    def _in_team(self, pose: Pose2) -> Pose2:
        return pose if self._setup.attacks > 0 else pose.half_turn()

    def _point_in_team(self, point: Point) -> Point:
        return point if self._setup.attacks > 0 else (-point[0], -point[1])

    def _turn_head(self, head: Head, t_s: float) -> float:
        tracks, _ = self._tracks(t_s)
        belief = None if self._view is None else self._view.belief
        floor = None if belief is None else belief.free_map
        filter_, ball = self._filter, self._ball.place(t_s)
        return head.turn(t_s, HeadView(filter_.belief, filter_.hypotheses, ball, tracks, floor, self._target))
