"""What a player does with the ball in its mouth: shoot, clear, dribble."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.planning.shots.shot_planner import ShotPlan
from sim2d.players.plan import Plan, Point, Situation
from sim2d.players.tactics.team_field import TeamField, direction_rad, distance_to_segment_m, offset
from sim2d.robot_link import Reason, RobotLimits


@dataclass(frozen=True, slots=True)
class BallHolderSettings:
    """Values of `BallHolder`; lengths in radii are robot radii unless the line names ball radii.

    Attributes
    ----------
    places : int
        Places in the goal's mouth that are tried, odd so that the middle is one.
    clear_ball_radii : float
        An obstacle whose rim is nearer to the shot's line than this less two, in ball radii, stops it.
    reaction_s : float
        A keeper starts so long after the kick. A kick is likely to score from where the ball is at a post before a
        keeper that stood in the middle: slow kicks from afar are its balls.
    max_aim_rad, min_aim_rad : float
        A kick may miss the aim by half the goal's angle, but by no more and no less than this.
    pressed_radii : float
        A keeper clears the ball where another robot is so near: it would lose the ball soon.
    min_forward_cos : float
        It clears only where it looks forward by this cosine: no kick goes to its own goal.
    min_chance : float
        A planned shot that promises less is none.
    max_held_s, clear_after_s : float
        A ball held so long is shot in any case, and kicked off in any direction: rules and opponents end longer holds.
    max_step_m, min_step_m : float
        Length of a step of dribbling: far enough to get speed, near enough to react.
    turn_rad, turn_room_reaches : float
        Before a turn by more than this with less room ahead it draws back: the ball would wedge between robot and wall.
    draw_back_m : float
        By so much.
    """

    places: int = 7
    clear_ball_radii: float = 3.5
    reaction_s: float = 0.3
    max_aim_rad: float = 0.35
    min_aim_rad: float = 0.06
    pressed_radii: float = 3.0
    min_forward_cos: float = 0.3
    min_chance: float = 0.05
    max_held_s: float = 3.0
    clear_after_s: float = 4.5
    max_step_m: float = 0.4
    min_step_m: float = 0.15
    turn_rad: float = 0.6
    turn_room_reaches: float = 1.5
    draw_back_m: float = 0.3


class BallHolder:
    """Decides for one player that holds the ball.

    Parameters
    ----------
    team : TeamField
        The field.
    limits : RobotLimits
        Of all robots.
    is_keeper : bool
        A keeper clears the ball under pressure and shoots from any distance.
    settings : BallHolderSettings
        See there.
    """

    def __init__(self, team: TeamField, limits: RobotLimits, is_keeper: bool, settings: BallHolderSettings) -> None:
        self._team, self._is_keeper, self._settings = team, is_keeper, settings
        self._kick_speed_mps = limits.kick_speed_mps
        way_m = max(team.goal_half_m - team.ball_radius_m - team.reach_m, 0.0)
        self._range_m = limits.kick_speed_mps * (settings.reaction_s + dash_s(way_m, limits))

    def decide(self, now: Situation) -> Plan:
        """Turn the ball to the opponent's goal; kick it there, or where nobody stands."""
        settings, pose = self._settings, now.pose
        ball = self._team.mouth(pose)
        if now.shot is not None:
            planned = self._follow(now, ball, now.shot)
            if planned is not None:
                return planned
        if self._is_keeper and self._is_pressed(now):
            return self._kick("clear", ball, pose.theta_rad)
        target, is_open = self._aim(ball, now.obstacles)
        wanted = direction_rad(now.place, target)
        off = abs(wrap_angle(wanted - pose.theta_rad))
        away, goal_half = math.dist(ball, target), self._team.goal_half_m
        is_aimed = off < min(settings.max_aim_rad, max(settings.min_aim_rad, 0.5 * goal_half / max(away, 1e-6)))
        in_range = away < self._range_m or self._is_keeper
        if is_aimed and ((is_open and in_range) or now.held_s > settings.max_held_s):
            return self._kick("shoot", ball, wanted)
        if now.held_s > settings.clear_after_s:
            # held in vain, in a corner or a scrum: any way out is good
            return self._kick("clear", ball, pose.theta_rad)
        step = min(settings.max_step_m, max(away - 2 * goal_half, settings.min_step_m))
        return self._dribble(pose, offset(now.place, wanted, step), wanted)

    def _is_pressed(self, now: Situation) -> bool:
        """Whether another robot is so near that the ball is soon lost, and a kick would not go to the own goal."""
        near_m = self._settings.pressed_radii * self._team.robot_radius_m
        is_forward = math.cos(now.pose.theta_rad) > self._settings.min_forward_cos
        return is_forward and any(math.dist(other, now.place) < near_m for other in now.others)

    def _aim(self, ball: Point, obstacles: tuple[Point, ...]) -> tuple[Point, bool]:
        """Choose the place in the goal's mouth nearest to its middle with a free way; else the middle, and False."""
        team, settings = self._team, self._settings
        width_m = team.goal_half_m - 1.5 * team.ball_radius_m
        last = settings.places - 1
        places = [(team.half_length_m, width_m * (2 * k / last - 1)) for k in range(settings.places)]
        near_m = team.robot_radius_m + (settings.clear_ball_radii - 2) * team.ball_radius_m
        free = [p for p in places if all(distance_to_segment_m(o, ball, p) > near_m for o in obstacles)]
        if not free:
            return (team.half_length_m, 0.0), False
        return min(free, key=lambda p: abs(p[1])), True

    def _follow(self, now: Situation, ball: Point, shot: ShotPlan) -> Plan | None:
        """Kick, turn or go nearer, whichever the shot plan chose; None where its probability is small."""
        if shot.chance < self._settings.min_chance or now.held_s > self._settings.max_held_s:
            return None
        why = Reason("shot", shot.action, shot.reason)
        if shot.action == "kick":
            return self._kick("shoot", ball, now.pose.theta_rad, why)
        target = offset(shot.place_m, shot.heading_rad, -self._team.reach_m)
        return self._dribble(now.pose, target, shot.heading_rad, why)

    def _kick(self, intent: str, ball: Point, heading_rad: float, why: Reason | None = None) -> Plan:
        target = self._team.inside(ball)
        return Plan(intent, target, heading_rad, self._kick_speed_mps, True, close=True, holding=True, why=why)

    def _dribble(self, pose: Pose2, target: Point, wanted_rad: float, why: Reason | None = None) -> Plan:
        """Take the ball to a place; draw back first where turning would wedge it between robot and wall."""
        team, settings = self._team, self._settings
        is_small_turn = abs(wrap_angle(wanted_rad - pose.theta_rad)) <= settings.turn_rad
        if is_small_turn or team.room_ahead_m(pose) >= settings.turn_room_reaches * team.reach_m:
            return Plan("dribble", team.inside(target), wanted_rad, dribble=True, holding=True, why=why)
        back = pose.compose(Pose2(-settings.draw_back_m, 0.0, 0.0))
        place = team.inside((back.x_m, back.y_m))
        return Plan("draw back", place, pose.theta_rad, dribble=True, close=True, holding=True, why=why)


def dash_s(way_m: float, limits: RobotLimits) -> float:
    """Return the time in which a robot that stood drives so far."""
    speed, acceleration = limits.speed_mps, limits.acceleration_mps2
    faster_m = speed**2 / (2 * acceleration)
    if way_m < faster_m:
        return math.sqrt(2 * way_m / acceleration)
    return speed / acceleration + (way_m - faster_m) / speed
