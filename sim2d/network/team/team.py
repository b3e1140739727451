"""A whole team by overhead vision: the robots' roles, what the referee allows, and the robots' commands.

Packets go in, commands come out; there are no sockets. Its time is the tracker's steady time, which never jumps.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.ssl.game import Game, GameState
from robocup_vision.ssl.problems import Problems
from robocup_vision.ssl.tracker import OverheadTracker
from robocup_vision.ssl.values.detection import VisionPacket
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.simulation import LocalVelocity, MoveCommand, RobotCommand, RobotControlResponse, Team
from robocup_vision.ssl.values.tracked import TrackedFrame, TrackedRobot
from sim2d.match.pitch_rules import kick_time_s
from sim2d.network.team.overhead_player import Moving, Orders, OverheadPlayer, defence_zones
from sim2d.players.driving.motion import MotionSettings
from sim2d.players.keep_out import Capsule
from sim2d.players.plan import Situation
from sim2d.players.tactics.set_pieces import BALL_ROOM_M, STOP_MPS
from sim2d.players.tactics.tactics import Tactics
from sim2d.players.tactics.team_field import TacticsSettings
from sim2d.robot_link import Command, Point, RobotLimits

_NOTHING = Command()
# vision's field may differ by this much: it may measure between the lines' outer edges, and lines are laid by hand
_SAME_FIELD_M = 0.2


# Limits of driving and kicking. They are below what the league's robots can do, so that robots stop in time before each
# other (the rules forbid collisions at more than 1.5 m/s) and no kick is a foul (over 6.5 m/s).
LIMITS = RobotLimits(
    speed_mps=1.5,
    acceleration_mps2=2.0,
    dead_time_s=0.05,
    height_m=0.15,
    turn_acceleration_rps2=40.0,
    turn_rps=8.0,
    kick_speed_mps=5.0,
)
# a keeper has the whole defence area; one robot alone goes for the ball
_TACTICS = TacticsSettings(
    keeper_area_radii=11.0,
    keeper_depth_radii=11.0,
    block_widths=4 / 3,
    straight_rad=0.6,
    straight_reaches=10.0,
    round_reaches=1.8,
    support_limits=(-0.6, 2.5),
    fetches_in_strip=False,
)
_MOTION = MotionSettings(holding_mps=1.0, holding_rps=2.5)
_DRIBBLER_RPS = 150.0
# a reported contact with the ball is valid for this time
_CONTACT_LASTS_S = 0.07
# without a contact sensor, the ball counts as in the mouth within this distance of the hull's front, and this offset
_MOUTH_M, _MOUTH_HALF_M = 0.012, 0.03
# another robot takes over fetching the ball only if its cost is smaller by this, so that two do not alternate
_TAKE_OVER_M = 0.25
# distance from the other team's defence area while the ball is not in play: 0.2 m by the rules, and a margin
_THEIR_ROOM_M = 0.22
# a robot whose hull is this near to the ball has touched it; the robot that took a kick may then touch it again
_TOUCHED_M = 0.03


@dataclass(slots=True)
class _Kick:
    """A kick that this team takes: the kicker's number, and whether the ball is in play since."""

    kicker: int
    is_over: bool = False


@dataclass(slots=True)
class _Robot:
    """One robot of the team: its player, and what its contact sensor reported about the ball."""

    player: OverheadPlayer
    contact_s: float = -math.inf
    has_contact: bool = False
    has_contact_sensor: bool = False


class OverheadTeam:
    """Drives all robots of one team.

    Attributes
    ----------
    intents : dict of int to str
        Present intent of each robot, by its number.
    state : GameState or None
        The referee's state at the last call of `commands`.

    Parameters
    ----------
    speed_mps : float
        The robots' greatest speed.

    Raises
    ------
    ArgumentError
        If the team is unknown, or the field has no goals.
    """

    def __init__(self, team: Team, field: Field, speed_mps: float = LIMITS.speed_mps) -> None:
        if not field.goals:
            raise ArgumentError(f"the field {field.name} has no goals to play at")
        self._team, self._field = team, field
        self._limits = replace(LIMITS, speed_mps=speed_mps, radius_m=field.robot_radius_m)
        # distance between the centres of a ball and a robot that touch
        self._touches_m = field.robot_radius_m + field.ball_radius_m
        self._game = Game(team, kick_time_s(field))
        reach_x_m, reach_y_m = np.abs(field.floor_polygon).max(axis=0).tolist()
        self._tracker = OverheadTracker((reach_x_m, reach_y_m))
        self._robots: dict[int, _Robot] = {}
        self._tactics: dict[tuple[int, int], Tactics] = {}
        self._fetcher: int | None = None
        self._kick: _Kick | None = None
        self._referee_problem = ""
        self.intents: dict[int, str] = {}
        self.state: GameState | None = None

    @property
    def seen_s(self) -> float:
        """Steady time (`OverheadTracker.newest_s`) of the newest frame; equals vision's clock until that jumps."""
        return self._tracker.newest_s

    @property
    def problems(self) -> Problems:
        """Problems with vision, referee and robots so far."""
        return self._tracker.problems

    def hear_vision(self, packet: VisionPacket) -> None:
        """Take in a packet of vision; report a problem if its field differs from the one that is played on."""
        if packet.geometry is not None:
            theirs, ours = packet.geometry.field, self._field
            if not max(abs(theirs.length_m - ours.length_m), abs(theirs.width_m - ours.width_m)) <= _SAME_FIELD_M:
                self.problems.add(
                    "vision's field is another",
                    f"vision shows a field of {theirs.length_m:.2f} x {theirs.width_m:.2f} m, but played on is "
                    f"{ours.name} of {ours.length_m:.2f} x {ours.width_m:.2f} m (--field)",
                )
        if packet.detection is not None:
            self._tracker.update(packet.detection)

    def hear_referee(
        self, packet: Referee, address: tuple[str, int] | None = None, received_s: float | None = None
    ) -> None:
        """Take in a packet of the game controller; arguments as in `Game.update`."""
        self._game.update(packet, address, received_s)
        if not packet.command.is_known:
            self.problems.add(f"the referee says an {packet.command}: taken for a halt")
        problem = self._game.problem
        if problem and problem != self._referee_problem:
            self.problems.add(problem)
        self._referee_problem = problem

    def lose_referee(self) -> None:
        """Stop all robots until the next packet of the referee."""
        self._game.lose_referee()

    def hear_robots(self, response: RobotControlResponse) -> None:
        """Take in the robots' contact sensors, and report a simulator's errors."""
        for error in response.errors:
            self.problems.add(
                f"error {error.code}",
                f"the simulator answers {error.code or 'an error'}: {error.message or 'no words'}",
            )
        for feedback in response.feedback:
            robot = self._robots.get(feedback.number)
            if robot is not None and feedback.ball_contact is not None:
                robot.has_contact_sensor, robot.has_contact = True, feedback.ball_contact
                robot.contact_s = self.seen_s if robot.has_contact else robot.contact_s

    def commands(self, t_s: float) -> list[RobotCommand]:
        """Return a command for each robot that is seen; call it once each control period (1/30 s).

        Parameters
        ----------
        t_s : float
            Time at which the commands will reach the robots, in steady time (`seen_s`).
        """
        world = self._tracker.at_steady(t_s)
        ball = (world.balls[0].position_m.x, world.balls[0].position_m.y) if world.balls else None
        state = self.state = self._game.state(t_s, ball)
        numbers = [seen.robot.number for seen in world.robots if seen.robot.team == self._team]
        if state.phase in ("halt", "time_out") or state.attacks is None:
            self.intents = dict.fromkeys(numbers, state.phase.replace("_", " "))
            self._kick = None
            return [robot_command(number, _NOTHING) for number in numbers]
        side = state.attacks
        robots = {(seen.robot.team, seen.robot.number): _in_team(seen, side) for seen in world.robots}
        own = {number: robots[self._team, number] for number in numbers}
        situation = self._situation(world, state, side, t_s)
        roles = self._roles(self._playing(own, state, situation.ball), own, state, situation)
        self._watch_kick(state, roles, robots, situation.ball)
        slow_mps = STOP_MPS if state.phase == "stop" else math.inf
        out = []
        for number, me in own.items():
            robot = self._robots.get(number)
            if robot is None:
                robot = self._robots[number] = _Robot(OverheadPlayer(self._field, self._limits, _MOTION, number))
            others = tuple(other for other in robots.values() if other is not me)
            own_situation = replace(situation, in_mouth=self._has_ball(robot, me, situation.ball))
            orders = self._orders(number, roles, own, state, own_situation, me)
            command = robot.player.act(orders, own_situation, me, others)
            out.append(robot_command(number, _slowed(command, slow_mps)))
            self.intents[number] = robot.player.intent
        return out

    def _situation(self, world: TrackedFrame, state: GameState, side: int, t_s: float) -> Situation:
        ball = velocity = None
        if world.balls:
            seen = world.balls[0]
            ball = (side * seen.position_m.x, side * seen.position_m.y)
            velocity = None if seen.velocity_mps is None else (side * seen.velocity_mps.x, side * seen.velocity_mps.y)
        place = None if state.placement_m is None else (side * state.placement_m[0], side * state.placement_m[1])
        phase, own_turn = state.phase, state.own_turn
        if _kick_off_is_next(state):
            # robots may drive to their kick-off places already in the stop before it
            phase, own_turn = "kick_off", state.next_own_turn
        nowhere = Pose2(0.0, 0.0, 0.0)
        return Situation(
            nowhere,
            ball,
            velocity or (0.0, 0.0),
            False,
            0.0,
            (),
            phase,
            own_turn and (phase != "ball_placement" or state.can_place_ball),
            t_s,
            placement=place,
        )

    def _playing(self, own: dict[int, Moving], state: GameState, ball: Point | None) -> list[int]:
        """Return the robots that may play; if the referee allows fewer, those farthest from the ball leave."""
        numbers = sorted(own)
        if state.max_robots is None or len(numbers) <= state.max_robots:
            return numbers
        center = ball or (0.0, 0.0)

        def away(number: int) -> tuple[bool, float]:
            pose = own[number].pose
            # a robot that is off the field already stays there
            outside = abs(pose.y_m) > self._field.width_m / 2
            return (outside, math.dist((pose.x_m, pose.y_m), center))

        leaving = sorted((n for n in numbers if n != state.goalkeeper), key=away, reverse=True)
        gone = set(leaving[: len(numbers) - state.max_robots])
        return [number for number in numbers if number not in gone]

    def _roles(
        self, numbers: Sequence[int], own: dict[int, Moving], state: GameState, now: Situation
    ) -> dict[int, int]:
        """Return each playing robot's role: 0 keeps the goal, 1 fetches the ball, others from 2 on, right to left."""
        places = {number: own[number].pose for number in numbers}
        field_players = [number for number in numbers if number != state.goalkeeper]
        if not field_players:
            return dict.fromkeys(numbers, 0)
        barred = self._kick.kicker if self._kick is not None and self._kick.is_over else None
        able = [number for number in field_players if number != barred] or field_players
        ball = now.ball or (0.0, 0.0)
        # a robot in front of the ball must drive round it, which costs about 0.3 m more
        cost = {n: math.dist((places[n].x_m, places[n].y_m), ball) + 0.3 * (places[n].x_m > ball[0]) for n in able}
        nearest = min(able, key=cost.__getitem__)
        if self._fetcher not in able or cost[self._fetcher] > cost[nearest] + _TAKE_OVER_M:
            self._fetcher = nearest
        rest = sorted((n for n in field_players if n != self._fetcher), key=lambda n: places[n].y_m)
        roles = {n: 0 for n in numbers if n == state.goalkeeper}
        return roles | {self._fetcher: 1} | {number: 2 + place for place, number in enumerate(rest)}

    def _watch_kick(
        self,
        state: GameState,
        roles: dict[int, int],
        robots: dict[tuple[Team, int], Moving],
        ball: Point | None,
    ) -> None:
        """Remember the kicker of this team, which may not touch the ball again before another robot has."""
        if state.phase == "free_kick" and state.own_turn:
            kicker = next((number for number, role in roles.items() if role == 1), None)
            self._kick = None if kicker is None else _Kick(kicker)
            return
        if self._kick is None:
            return
        if state.phase != "play":
            self._kick = None
            return
        self._kick.is_over = True
        if ball is None:
            return
        reach = self._touches_m + _TOUCHED_M
        who = (self._team, self._kick.kicker)
        if any(
            math.dist((robot.pose.x_m, robot.pose.y_m), ball) < reach for key, robot in robots.items() if key != who
        ):
            self._kick = None

    def _has_ball(self, robot: _Robot, me: Moving, ball: Point | None) -> bool:
        if robot.has_contact_sensor:
            return robot.has_contact and self.seen_s - robot.contact_s < _CONTACT_LASTS_S
        if ball is None:
            return False
        ahead, aside = me.pose.inverse().transform(ball).tolist()
        return bool(0 < ahead < self._touches_m + _MOUTH_M and abs(aside) < _MOUTH_HALF_M)

    def _orders(
        self,
        number: int,
        roles: dict[int, int],
        own: Iterable[int],
        state: GameState,
        now: Situation,
        me: Moving,
    ) -> Orders:
        role = roles.get(number)
        room_of_ball_m = BALL_ROOM_M
        in_play = state.phase == "play"
        room_m = 0.0 if in_play or state.phase == "penalty" else _THEIR_ROOM_M
        zones = defence_zones(self._field, is_keeper=role == 0, their_room_m=room_m)
        if state.phase == "ball_placement" and state.own_turn and role == 1:
            # the ball may lie in a defence area
            zones = ()
        if role is None:
            # a robot that may not play leaves the field beside its own half, on the nearer side
            radius_m = self._limits.radius_m
            place = sum(other not in roles and other < number for other in own)
            x, y = -(2 + 4 * place) * radius_m, math.copysign(self._field.width_m / 2 + 1.5 * radius_m, me.pose.y_m)
            if now.ball is not None:
                zones = (*zones, Capsule(now.ball, now.ball, room_of_ball_m))
            return Orders(self._tactics_of(1, 2), zones, (x, y))
        if now.ball is not None and (_kick_off_is_next(state) or (state.phase == "kick_off" and not state.own_turn)):
            zones = (*zones, Capsule(now.ball, now.ball, room_of_ball_m))
        if self._kick is not None and self._kick.is_over and self._kick.kicker == number and now.ball is not None:
            zones = (*zones, Capsule(now.ball, now.ball, 0.1))
        # where the keeper is missing, the highest role is greater than the number of robots
        players = max(len(roles), max(roles.values()) + 1, 2)
        return Orders(self._tactics_of(role, players), zones)

    def _tactics_of(self, role: int, players: int) -> Tactics:
        key = role, players
        if key not in self._tactics:
            self._tactics[key] = Tactics(self._field, self._limits, role, players, _TACTICS)
        return self._tactics[key]


def robot_command(number: int, command: Command) -> RobotCommand:
    """Return a player's command in the form that every simulator obeys: velocities along the robot's own axes."""
    velocity = LocalVelocity(command.forward_mps, command.left_mps, command.turn_rps)
    return RobotCommand(
        number, MoveCommand(local=velocity), command.kick_mps, 0.0, _DRIBBLER_RPS if command.dribble else 0.0
    )


def _kick_off_is_next(state: GameState) -> bool:
    return state.phase == "stop" and state.next_phase == "kick_off"


def _slowed(command: Command, most_mps: float) -> Command:
    """Return a command with its speed reduced to at most `most_mps`."""
    speed = math.hypot(command.forward_mps, command.left_mps)
    if speed <= most_mps:
        return command
    part = most_mps / speed
    return replace(command, forward_mps=part * command.forward_mps, left_mps=part * command.left_mps)


def _in_team(robot: TrackedRobot, side: int) -> Moving:
    turned = 0.0 if side > 0 else math.pi
    velocity = robot.velocity_mps
    return Moving(
        # one number for each robot of both teams
        16 * int(robot.robot.team) + robot.robot.number,
        Pose2(side * robot.position_m.x, side * robot.position_m.y, wrap_angle(robot.orientation_rad + turned)),
        (0.0, 0.0) if velocity is None else (side * velocity.x, side * velocity.y),
        robot.turn_rps or 0.0,
    )
