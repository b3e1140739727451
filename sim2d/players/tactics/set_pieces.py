"""Decisions of a player while the rules bind it: kick-off, stop, free kick, penalty, ball placement."""

from __future__ import annotations

import math
from dataclasses import replace

from robocup_vision.geometry import Pose2, wrap_angle
from sim2d.players.keep_out import Capsule, KeepOut
from sim2d.players.plan import Plan, Situation
from sim2d.players.tactics.field_player import Fetch, FieldPlayer
from sim2d.players.tactics.keeper import Keeper
from sim2d.players.tactics.team_field import TeamField, direction_rad, offset
from sim2d.robot_link import Point

# The rules are those of the small-size league.

# Distance from the robot to the ball during a stop and the other team's set pieces: 0.5 m by the rules, plus the
# error of the ball's place.
BALL_ROOM_M = 0.57
# Greatest speed during a stop: 1.5 m/s by the rules, minus the overshoot of a velocity.
STOP_MPS = 1.3
# Distance behind the ball, in reaches, before a kick-off or a penalty, so as not to touch it too early.
_BEHIND_REACHES = 2.0
# Distance behind the ball at a penalty: 1 m by the rules, plus a robot.
_PENALTY_ROOM_M = 1.3
# Distances from its place at which a carried ball is released, and at which a ball counts as placed: 0.15 m by the
# rules, minus the error of its place.
_RELEASE_M = 0.05
_PLACED_M = 0.12
# Distance to the placed ball at which the robot leaves it.
_LEAVE_M = 0.75
# A ball closer to a wall than this, in reaches, has no room behind: it is taken from the front, within this angle,
# and pulled away by this distance.
_WALL_REACHES = 2.5
_PULL_M = 0.4
_STRAIGHT_RAD = 0.3


class SetPieces:
    """Decides for one player while the rules bind it.

    Parameters
    ----------
    number, players : int
        As in `PlayerSetup`; number 1 takes its team's set pieces, or number 0 if it is alone.
    home : Pose2
        Its place at a kick-off.
    """

    def __init__(
        self,
        team: TeamField,
        fetch: Fetch,
        keeper: Keeper,
        field_player: FieldPlayer,
        number: int,
        players: int,
        kick_speed_mps: float,
        home: Pose2,
    ) -> None:
        self._team, self._fetch, self._keeper, self._field_player = team, fetch, keeper, field_player
        self._kick_speed_mps, self._home = kick_speed_mps, home
        self._is_keeper = number == 0 and players > 1
        self._is_taker = number == min(1, players - 1)

    def decide(self, now: Situation) -> Plan | None:
        """Return the plan; None if it is the same as in play."""
        if now.phase == "play":
            return None
        if now.phase == "kick_off":
            return self._kick_off(now)
        if now.phase in ("prepare_penalty", "penalty"):
            return self._penalty(now)
        if now.own_turn and self._is_taker and now.phase == "free_kick":
            return self._kick(now) if now.in_mouth else None
        if now.own_turn and self._is_taker and now.phase == "ball_placement" and now.placement and now.ball:
            return self._place(now, now.ball, now.placement)
        return self._wait(now)

    def _kick_off(self, now: Situation) -> Plan:
        """Go straight to the own half, then to the kick-off place; the taker waits just behind the ball."""
        if now.place[0] > 0.0:
            # places are close together near the middle, so that robots on straight ways would meet
            home = (self._home.x_m, now.place[1])
            return Plan("kick-off", self._team.inside(home), direction_rad(home, (0.0, 0.0)), avoid_ball=True)
        x = -_BEHIND_REACHES * self._team.reach_m if now.own_turn and self._is_taker else self._home.x_m
        target = (x, self._home.y_m)
        return Plan("kick-off", target, direction_rad(target, (0.0, 0.0)), avoid_ball=True)

    def _wait(self, now: Situation) -> Plan:
        """Keep away from the ball, between it and the own goal or in support."""
        slow_mps = STOP_MPS if now.phase in ("stop", "ball_placement") else None
        zones = self._zones(now)
        if now.ball is None:
            return Plan("wait", now.place, now.pose.theta_rad, speed_mps=slow_mps)
        if self._is_keeper:
            plan = replace(self._keeper.guard(now, now.ball), dribble=False)
        elif self._is_taker:
            away_m = BALL_ROOM_M + 2 * self._team.robot_radius_m
            homewards = direction_rad(now.ball, (-self._team.half_length_m, 0.0))
            place = self._team.inside(offset(now.ball, homewards, away_m))
            plan = Plan("mark the ball", place, direction_rad(place, now.ball))
        else:
            plan = self._field_player.support(now, now.ball)
        return replace(
            plan, intent=f"{now.phase.replace('_', ' ')}: {plan.intent}", speed_mps=slow_mps, keep_outs=zones
        )

    def _zones(self, now: Situation) -> tuple[KeepOut, ...]:
        """Return the area that the rules keep free around the ball, and along its way during placement."""
        if now.ball is None or (now.own_turn and now.phase == "free_kick"):
            return ()
        end = now.placement if now.phase == "ball_placement" and now.placement else now.ball
        return (Capsule(now.ball, end, BALL_ROOM_M),)

    def _kick(self, now: Situation) -> Plan:
        heading = now.pose.theta_rad
        ahead = self._team.inside(offset(now.place, heading, self._team.reach_m))
        return Plan("free kick", ahead, heading, self._kick_speed_mps, True, close=True, holding=True)

    def _penalty(self, now: Situation) -> Plan | None:
        """Leave it to the kicker and the keeper; all others stay behind the ball."""
        team, ball = self._team, now.ball
        plays = self._is_taker if now.own_turn else self._is_keeper
        if plays and now.phase == "penalty":
            return None
        if ball is None:
            return Plan("wait", now.place, now.pose.theta_rad)
        if plays and now.own_turn:
            behind = offset(ball, math.pi, _BEHIND_REACHES * team.reach_m)
            return Plan("prepare penalty", behind, 0.0, avoid_ball=True)
        if self._is_keeper and not now.own_turn:
            return replace(self._keeper.guard(now, (0.0, 0.0)), intent="prepare penalty", dribble=False)
        # behind the ball as seen from the target goal
        x = ball[0] + (-1.0 if now.own_turn else 1.0) * _PENALTY_ROOM_M
        y = now.place[1]
        if self._is_keeper:
            return Plan("penalty: wait", (min(x, -team.half_length_m / 2), 0.0), 0.0)
        return Plan("penalty: wait", team.inside((x, y)), direction_rad(now.place, ball))

    def _place(self, now: Situation, ball: Point, place: Point) -> Plan:
        """Take the ball to a place with the dribbler, and leave it there."""
        team = self._team
        away_m = math.dist(ball, place)
        if away_m < (_RELEASE_M if now.in_mouth else _PLACED_M):
            # placed: go straight back and stay away
            out = direction_rad(ball, now.place)
            return Plan("leave the ball", offset(ball, out, _LEAVE_M), now.pose.theta_rad, close=True)
        wall = team.away_from_wall(ball, _WALL_REACHES * team.reach_m)
        if wall is not None:
            return self._pull(now, ball, wall)
        if not now.in_mouth:
            return replace(self._fetch.decide(now, ball, place), intent="place: fetch", speed_mps=STOP_MPS)
        # a ball that is pushed ahead stays in the mouth; the heading is kept near the place
        heading = direction_rad(ball, place) if away_m > 2 * team.reach_m else now.pose.theta_rad
        target = offset(place, heading, -team.reach_m)
        return Plan("place the ball", target, heading, dribble=True, close=True, holding=True)

    def _pull(self, now: Situation, ball: Point, away_rad: float) -> Plan:
        """Take a ball at a wall from the front, and pull it away."""
        reach, facing = self._team.reach_m, away_rad + math.pi
        if now.in_mouth:
            target = offset(now.place, away_rad, _PULL_M)
            return Plan("pull the ball", target, now.pose.theta_rad, dribble=True, close=True, holding=True)
        before = offset(ball, away_rad, 2.0 * reach)
        off = direction_rad(ball, now.place) - away_rad
        if math.dist(now.place, before) > 0.5 * reach and abs(wrap_angle(off)) > _STRAIGHT_RAD:
            return Plan("place: before the wall", before, facing, avoid_ball=True, speed_mps=STOP_MPS)
        target = offset(ball, away_rad, 0.75 * reach)
        return Plan("place: at the wall", target, facing, dribble=True, close=True, speed_mps=STOP_MPS)
