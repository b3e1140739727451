"""The league's simulator without sockets: bytes of commands in, bytes of answers and of published packets out.

A step of the physics is 1/300 s; cameras expose at every fifth step. Time is counted in steps, so that it does not
drift, even over days of simulated time. A request that cannot be read is counted, answered with an error and ignored.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from enum import Enum

import numpy as np

from field_models import Field
from field_models.errors import ArgumentError, PacketError
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.sockets import SIMULATED_VISION_PORT
from robocup_vision.ssl.values.detection import DetectionFrame, VisionPacket
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.simulation import (
    MOTION_TYPE,
    AnyMessage,
    RobotCommand,
    RobotControl,
    RobotControlResponse,
    RobotFeedback,
    RobotMotion,
    SimulatorCommand,
    SimulatorError,
    SimulatorResponse,
    SyncRequest,
    SyncResponse,
    Team,
)
from sim2d.kick_off import kick_off_pose
from sim2d.match.league_referee import LeagueReferee
from sim2d.network.ball_boy import BallBoy
from sim2d.network.built_in import BuiltInRobots
from sim2d.network.control import MAX_SPEED_MPS, MAX_TURN_RPS, apply_command
from sim2d.network.packets import match_packet, referee_packet, tracker_packet
from sim2d.network.realism import Realism
from sim2d.network.vision import CameraImages, OverheadVision, detection_packets
from sim2d.network.world import MAX_NUMBER, STEPS_PER_S, LeagueWorld
from sim2d.world.ball_physics import Flight
from sim2d.world.physics import STEP_S
from sim2d.world.state import BallState

STEPS_A_FRAME = 5
STEPS_A_REFEREE = 8
# built-in players act, and the referee judges, 30 times per second, as in sim2d's own matches
STEPS_A_COMMAND = 10
# one request must not block the simulator for its other clients
MAX_SYNC_STEP_S = 1.0
# twice the largest meaningful command; decoding a larger one would take longer than a step
MAX_REQUEST_BYTES = 8192
MAX_KICK_MPS, MAX_DRIBBLER_RPS = 100.0, 10_000.0
MAX_KICK_RAD = math.pi / 2 + 1e-6  # 90 degrees may be slightly more as a float32
# numbers of the random streams of vision and of radio losses
_VISION_STREAM, _RADIO_STREAM = range(2)
# a SyncRequest begins with its step: field 1, a float; every other request begins with a message
_SYNC_MARK = b"\x0d"


class Channel(Enum):
    """The multicast channel on which a packet is published."""

    VISION = "vision"
    TRACKER = "tracker"
    REFEREE = "referee"


class LeagueSimulator:
    """A field on which external programs play.

    Parameters
    ----------
    players : int
        Robots of each team, placed as for a kick-off; yellow plays towards +x.
    seed : int
        The same seed and the same requests at the same steps give the same packets, except for their times.
    epoch_s : float
        Time of the first step, seconds since 1970.
    referee : LeagueReferee, optional
        Judges a match by the rules and places the ball; by default play is never interrupted.
    built_in : sequence of BuiltInRobots
        Built-in players of some of the robots; the other robots obey external commands.
    images : CameraImages, optional
        Receives each overhead camera's image of the world.

    Attributes
    ----------
    speed : float
        Simulated time per real time: 1 in real time, 0 stopped, infinity as fast as possible.

    Raises
    ------
    ArgumentError
        If the field has no goals, there are too many players or the seed is negative.
    """

    def __init__(
        self,
        field: Field,
        players: int,
        realism: Realism,
        seed: int = 0,
        epoch_s: float = 0.0,
        referee: LeagueReferee | None = None,
        built_in: Sequence[BuiltInRobots] = (),
        images: CameraImages | None = None,
    ) -> None:
        if not field.goals:
            raise ArgumentError(f"the field {field.name} has no goals: it is none of the small-size league")
        if not 0 <= players <= MAX_NUMBER + 1:
            raise ArgumentError(f"players must be from 0 to {MAX_NUMBER + 1}, got {players}")
        if seed < 0:
            raise ArgumentError(f"seed must not be negative, got {seed}")
        self.epoch_s = epoch_s
        self.speed = 1.0
        self.vision_port = SIMULATED_VISION_PORT
        self.bad_datagrams = 0
        self.last_problem = ""
        self.world = LeagueWorld(field, Flight())
        for team, side in ((Team.YELLOW, 1), (Team.BLUE, -1)):
            for number in range(players):
                self.world.add(team, number, kick_off_pose(field, side, number, players, field.robot_radius_m))
        self._rng = np.random.default_rng([seed, _RADIO_STREAM])
        self._vision_rng = np.random.default_rng([seed, _VISION_STREAM])
        self._vision = OverheadVision(field, realism, self._vision_rng)
        self._delayed: deque[tuple[int, bytes]] = deque()
        self._sync_debt_s = 0.0
        self.publishes_referee = True
        self.referee, self._players, self._images = referee, players, images
        self._ball_boy = BallBoy(field)
        self._built_in = tuple(built_in)
        self._taken = {(robots.team, number) for robots in built_in for number in robots.numbers}
        for robots in built_in:
            robots.begin(self.world)

    @property
    def realism(self) -> Realism:
        """The noise, delays and losses that are simulated now."""
        return self._vision.realism

    def set_realism(self, realism: Realism) -> None:
        """Change the simulated noise, delays and losses."""
        self._vision = OverheadVision(self.world.field, realism, self._vision_rng)

    def set_field(self, field: Field, flight: Flight) -> None:
        """Replace the field and the parameters of the ball's flight."""
        self.world.set_field(field, flight)
        self._vision = OverheadVision(field, self.realism, self._vision_rng)
        self._ball_boy = BallBoy(field)

    def step(self) -> list[tuple[Channel, bytes]]:
        """Advance by one step of the physics; return the packets to publish."""
        self.world.step()
        steps = self.world.steps
        out: list[tuple[Channel, bytes]] = []
        if steps % STEPS_A_FRAME == 0:
            state = self.world.state
            due = steps + math.ceil(self.realism.vision_delay_s / STEP_S - 1e-9)
            for frame in self._vision.capture(state, self.epoch_s):
                self._delayed.extend((due, data) for data in detection_packets(frame))
            if self._images is not None:
                self._images.add(self._vision, state, self.epoch_s)
            out.append((Channel.TRACKER, encode(tracker_packet(state, steps // STEPS_A_FRAME, self.epoch_s))))
        if steps % STEPS_PER_S == STEPS_A_FRAME:
            out += [(Channel.VISION, data) for data in self._vision.geometry_packets(self.world.flight)]
        while self._delayed and self._delayed[0][0] <= steps:
            out.append((Channel.VISION, self._delayed.popleft()[1]))
        if self.publishes_referee:
            if self.referee is not None and steps % STEPS_A_COMMAND == 0:
                self._judge(self.referee)
            if steps % STEPS_A_REFEREE == 0:
                out.append((Channel.REFEREE, encode(self._referee_packet())))
        self._play_built_in(out)
        return out

    def hear_referee(self, packet: Referee) -> None:
        """Let the built-in players obey a game controller, and place the ball where a person would for it."""
        self._ball_boy.hear(packet, self.world.t_s)
        ball = self.world.ball
        place = self._ball_boy.wants(self.world.t_s, (ball.x_m, ball.y_m), math.hypot(ball.vx_mps, ball.vy_mps))
        if place is not None:
            self.world.place_ball(BallState(*place))
        for robots in self._built_in:
            robots.hear_referee(packet)

    def lose_referee(self) -> None:
        """Stop the built-in players until the next packet of a referee."""
        for robots in self._built_in:
            robots.lose_referee()

    def _play_built_in(self, published: Sequence[tuple[Channel, bytes]]) -> None:
        for robots in self._built_in:
            for channel, data in published:
                if channel is Channel.VISION and robots.sees_from_above:
                    robots.hear_vision(decode(VisionPacket, data))
                elif channel is Channel.REFEREE:
                    robots.hear_referee(decode(Referee, data))
            if self.world.steps % STEPS_A_COMMAND == 0:
                robots.act(self.world, self.epoch_s)

    def _referee_packet(self) -> Referee:
        if self.referee is None:
            return referee_packet(self.epoch_s, self.world.t_s)
        return match_packet(self.referee, self.epoch_s, self.world.t_s, self._players)

    def _judge(self, referee: LeagueReferee) -> None:
        state = self.world.state
        for ruling in referee.judge(state.t_s, state.robots, state.ball):
            if ruling.ball_at is not None:
                self.world.place_ball(BallState(*ruling.ball_at))

    def answer_control(self, data: bytes) -> tuple[bytes | None, list[tuple[Channel, bytes]]]:
        """Process a datagram of the simulation control; return the answer, if any, and the packets to publish."""
        try:
            self._check_size(data)
            if data[:1] == _SYNC_MARK:
                return self._answer_sync(decode(SyncRequest, data), None)
            errors = apply_command(self, decode(SimulatorCommand, data))
        except PacketError as error:
            errors = [self._count_bad(error)]
        return (encode(SimulatorResponse(tuple(errors))) if errors else None), []

    def answer_robots(self, team: Team, data: bytes) -> tuple[bytes | None, list[tuple[Channel, bytes]]]:
        """Process a datagram for a team's robots; returns as `answer_control`."""
        try:
            self._check_size(data)
            if data[:1] == _SYNC_MARK:
                return self._answer_sync(decode(SyncRequest, data), team)
            response = self._command_robots(team, decode(RobotControl, data))
        except PacketError as error:
            response = RobotControlResponse((self._count_bad(error),))
        if self._is_lost(self.realism.response_loss):
            return None, []
        return encode(response), []

    def answer_step(self, team: Team | None, data: bytes) -> tuple[bytes, list[tuple[Channel, bytes]]]:
        """Process a SyncRequest from a team's connection, or from the control's (None); returns as `answer_control`."""
        try:
            self._check_size(data)
            return self._answer_sync(decode(SyncRequest, data), team)
        except PacketError as error:
            return encode(SyncResponse(robots=RobotControlResponse((self._count_bad(error),)))), []

    def _answer_sync(self, request: SyncRequest, team: Team | None) -> tuple[bytes, list[tuple[Channel, bytes]]]:
        # a client that steps the simulator expects it to pause between the steps
        self.speed = 0.0
        errors: list[SimulatorError] = []
        feedback: tuple[RobotFeedback, ...] = ()
        published: list[tuple[Channel, bytes]] = []
        if request.command is not None:
            errors += apply_command(self, request.command)
        if request.robot_control is not None:
            if team is None:
                message = "send a robot_control to the port of its team: this port does not name a team"
                errors.append(SimulatorError("UNKNOWN_TEAM", message))
            else:
                response = self._command_robots(team, request.robot_control)
                errors += response.errors
                feedback = response.feedback
        step_s = request.step_s or 0.0
        if 0 <= step_s <= MAX_SYNC_STEP_S:
            self._sync_debt_s += step_s
            count = math.floor(self._sync_debt_s / STEP_S + 1e-6)
            self._sync_debt_s -= count * STEP_S
            for _ in range(count):
                published += self.step()
        else:
            message = f"sim_step must be from 0 to {MAX_SYNC_STEP_S:g}, got {request.step_s}"
            errors.append(SimulatorError("STEP_RANGE", message))
        frames: tuple[DetectionFrame, ...] = tuple(self._vision.capture(self.world.state, self.epoch_s))
        if feedback:
            feedback = tuple(self._feel(team, known.number) for known in feedback if team is not None)
        return encode(SyncResponse(frames, RobotControlResponse(tuple(errors), feedback))), published

    def _command_robots(self, team: Team, control: RobotControl) -> RobotControlResponse:
        errors: list[SimulatorError] = []
        feedback: list[RobotFeedback] = []
        for command in control.commands:
            if not self.world.has(team, command.number):
                message = f"there is no robot {command.number} of {team.name.lower()} on the field"
                errors.append(SimulatorError("ROBOT_NOT_PRESENT", message))
                continue
            if (team, command.number) in self._taken:
                message = f"robot {command.number} of {team.name.lower()} is played by a built-in player"
                errors.append(SimulatorError("ROBOT_BUILT_IN", message))
                continue
            problem = _problem(command)
            if problem:
                errors.append(SimulatorError("COMMAND_RANGE", f"robot {command.number}: {problem}"))
            elif not self._is_lost(self.realism.command_loss):
                self.world.command(team, command)
            feedback.append(self._feel(team, command.number))
        return RobotControlResponse(tuple(errors), tuple(feedback))

    def _feel(self, team: Team, number: int) -> RobotFeedback:
        """Return a robot's feedback: whether it touches the ball, and its own motion."""
        motion = AnyMessage(MOTION_TYPE, encode(RobotMotion(*self.world.robot(team, number).motion)))
        return RobotFeedback(number, self.world.touches_ball(team, number), motion)

    def _is_lost(self, ratio: float) -> bool:
        return ratio > 0 and bool(self._rng.random() < ratio)

    def _check_size(self, data: bytes) -> None:
        if len(data) > MAX_REQUEST_BYTES:
            raise PacketError(f"a request must have at most {MAX_REQUEST_BYTES} bytes, got {len(data)}")

    def _count_bad(self, error: PacketError) -> SimulatorError:
        self.bad_datagrams += 1
        self.last_problem = str(error)
        return SimulatorError("UNREADABLE", str(error))


def _problem(command: RobotCommand) -> str:
    """Return why a command is outside what any robot can do; empty if it is not."""
    move = command.move
    speeds: list[float] = []
    turns: list[float] = []
    if move is not None and move.local is not None:
        speeds += [move.local.forward_mps, move.local.left_mps]
        turns.append(move.local.turn_rps)
    if move is not None and move.world is not None:
        speeds += [move.world.x_mps, move.world.y_mps]
        turns.append(move.world.turn_rps)
    if move is not None and move.wheels is not None:
        wheels = move.wheels
        speeds += [wheels.front_right_mps, wheels.back_right_mps, wheels.back_left_mps, wheels.front_left_mps]
    if not all(abs(speed) <= MAX_SPEED_MPS for speed in speeds):
        return f"a velocity must be within {MAX_SPEED_MPS:g} m/s, got {speeds}"
    if not all(abs(turn) <= MAX_TURN_RPS for turn in turns):
        return f"a turning rate must be within {MAX_TURN_RPS:g} rad/s, got {turns[0]}"
    if command.kick_mps is not None and not 0 <= command.kick_mps <= MAX_KICK_MPS:
        return f"kick_speed must be from 0 to {MAX_KICK_MPS:g} m/s, got {command.kick_mps}"
    if command.kick_angle_rad is not None and not 0 <= command.kick_angle_rad <= MAX_KICK_RAD:
        return f"kick_angle must be from 0 to 90 degrees, got {math.degrees(command.kick_angle_rad)}"
    if command.dribbler_rps is not None and not abs(command.dribbler_rps) <= MAX_DRIBBLER_RPS:
        return f"dribbler_speed must be within {MAX_DRIBBLER_RPS:g} rad/s, got {command.dribbler_rps}"
    return ""
