"""Makes the simulator's tracker packets, which hold the truth, and its own referee packets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from robocup_vision.ssl.values.geometry import FloorPoint
from robocup_vision.ssl.values.referee import (
    MatchType,
    Referee,
    RefereeCommand,
    Stage,
    TeamInfo,
)
from robocup_vision.ssl.values.simulation import Team
from robocup_vision.ssl.values.tracked import (
    Capability,
    KickedBall,
    TrackedBall,
    TrackedFrame,
    TrackedRobot,
    TrackedRobotId,
    TrackerPacket,
    Vector2,
    Vector3,
)
from sim2d.match.league_referee import Command, LeagueReferee
from sim2d.match.pitch_rules import Restart
from sim2d.network.world import SIDES, Kick, LeagueState
from sim2d.world.ball_physics import GRAVITY_MPS2, ROLLS_RATIO, BallSettings
from sim2d.world.state import BallState, RobotState

# the same in every run, so that a reader of a log can identify the truth
TRUTH_UUID, TRUTH_SOURCE = "sim2d-truth", "sim2d"
REFEREE_SOURCE = "sim2d"
US_PER_S = 1e6
_HALF_US = 300_000_000
_STAGES = {
    "first_half": Stage.NORMAL_FIRST_HALF,
    "half_time": Stage.NORMAL_HALF_TIME,
    "second_half": Stage.NORMAL_SECOND_HALF,
    "post_game": Stage.POST_GAME,
}
# the league's commands for each of the simulator's, if it is yellow's turn and if it is blue's
COMMANDS: dict[Command, tuple[RefereeCommand, RefereeCommand]] = {
    "halt": (RefereeCommand.HALT,) * 2,
    "stop": (RefereeCommand.STOP,) * 2,
    "normal_start": (RefereeCommand.NORMAL_START,) * 2,
    "force_start": (RefereeCommand.FORCE_START,) * 2,
    "prepare_kick_off": (RefereeCommand.PREPARE_KICKOFF_YELLOW, RefereeCommand.PREPARE_KICKOFF_BLUE),
    "prepare_penalty": (RefereeCommand.PREPARE_PENALTY_YELLOW, RefereeCommand.PREPARE_PENALTY_BLUE),
    "direct_free": (RefereeCommand.DIRECT_FREE_YELLOW, RefereeCommand.DIRECT_FREE_BLUE),
    "ball_placement": (RefereeCommand.BALL_PLACEMENT_YELLOW, RefereeCommand.BALL_PLACEMENT_BLUE),
}
# command that begins each kind of restart
NEXT: dict[Restart, Command] = {
    "kick_off": "prepare_kick_off",
    "free_kick": "direct_free",
    "penalty": "prepare_penalty",
    "force_start": "force_start",
}


def tracked_frame(
    number: int, t_s: float, robots: Sequence[RobotState], ball: BallState, yellow_side: int
) -> TrackedFrame:
    """Return a moment as a tracker's frame; `yellow_side` is +1 if yellow attacks the goal at +x, else -1."""
    tracked = tuple(
        TrackedRobot(
            TrackedRobotId(robot.number, Team.YELLOW if robot.side == yellow_side else Team.BLUE),
            Vector2(robot.pose.x_m, robot.pose.y_m),
            robot.pose.theta_rad,
            Vector2(*robot.velocity_mps),
            robot.turn_rps,
            1.0,
        )
        for robot in robots
    )
    here = TrackedBall(Vector3(ball.x_m, ball.y_m, ball.z_m), Vector3(ball.vx_mps, ball.vy_mps, ball.vz_mps), 1.0)
    return TrackedFrame(number, t_s, (here,), tracked)


def tracker_packet(state: LeagueState, frame_number: int, epoch_s: float) -> TrackerPacket:
    """Return the truth as a tracker would send it: without noise and delay, whatever the vision's realism is."""
    frame = replace(
        tracked_frame(frame_number, epoch_s + state.t_s, state.robots, state.ball, SIDES[Team.YELLOW]),
        kicked_ball=None if state.kick is None else _kicked_ball(state.kick, epoch_s),
        capabilities=(Capability.DETECT_FLYING_BALLS, Capability.DETECT_KICKED_BALLS),
    )
    return TrackerPacket(TRUTH_UUID, TRUTH_SOURCE, frame)


def _kicked_ball(kick: Kick, epoch_s: float) -> KickedBall:
    """Return a kick; if it is flat, with the time and place at which the ball will stop after sliding and rolling."""
    ball, carpet = kick.ball, BallSettings()
    slide_mps2, roll_mps2 = carpet.sliding_friction * GRAVITY_MPS2, carpet.rolling_friction * GRAVITY_MPS2
    speed = math.hypot(ball.vx_mps, ball.vy_mps)
    stop_s, stop_m = None, None
    if ball.vz_mps == 0 and speed > 0:
        rolls_mps = ROLLS_RATIO * speed
        slides_s, rolls_s = (speed - rolls_mps) / slide_mps2, rolls_mps / roll_mps2
        way_m = (speed + rolls_mps) / 2 * slides_s + rolls_mps / 2 * rolls_s
        stop_s = epoch_s + kick.t_s + slides_s + rolls_s
        stop_m = Vector2(ball.x_m + way_m * ball.vx_mps / speed, ball.y_m + way_m * ball.vy_mps / speed)
    return KickedBall(
        Vector2(ball.x_m, ball.y_m),
        Vector3(ball.vx_mps, ball.vy_mps, ball.vz_mps),
        epoch_s + kick.t_s,
        stop_s,
        stop_m,
        TrackedRobotId(kick.number, kick.team),
    )


def referee_packet(epoch_s: float, t_s: float) -> Referee:
    """Return the referee's packet of a game in which all may play from the beginning; yellow plays towards +x."""
    begin_us = round(epoch_s * US_PER_S)
    return Referee(
        packet_time_us=begin_us + round(t_s * US_PER_S),
        stage=Stage.NORMAL_FIRST_HALF,
        command=RefereeCommand.FORCE_START,
        command_counter=1,
        command_time_us=begin_us,
        yellow=_team("yellow"),
        blue=_team("blue"),
        stage_time_left_us=_HALF_US - round(t_s * US_PER_S),
        blue_on_positive_half=True,
        source_identifier=REFEREE_SOURCE,
        match_type=MatchType.FRIENDLY,
    )


def match_packet(referee: LeagueReferee, epoch_s: float, t_s: float, players: int) -> Referee:
    """Return the packet that the game controller would send in a match judged by `referee`."""
    begin_us = round(epoch_s * US_PER_S)
    place, coming, left_s = referee.placement_m, referee.next_play, referee.action_left_s(t_s)
    yellow, blue = (
        replace(
            _team(name),
            score=referee.score[side],
            yellow_cards=referee.card_count(side),
            yellow_card_times_us=tuple(max(round((end - t_s) * US_PER_S), 0) for end in referee.cards[side]),
            goalkeeper=referee.keepers[side],
            foul_counter=referee.foul_count(side),
            ball_placement_failures=referee.placement_failures[side],
            max_allowed_robots=referee.robots_allowed(side, players),
        )
        for name, side in (("yellow", 1), ("blue", -1))
    )
    return Referee(
        packet_time_us=begin_us + round(t_s * US_PER_S),
        stage=_STAGES[referee.stage],
        command=COMMANDS[referee.command][referee.command_side < 0],
        command_counter=referee.command_counter,
        command_time_us=begin_us + round(referee.command_s * US_PER_S),
        yellow=yellow,
        blue=blue,
        stage_time_left_us=round((referee.stage_end_s - t_s) * US_PER_S),
        designated_position=None if place is None else FloorPoint(*place),
        blue_on_positive_half=True,
        next_command=None if coming is None else COMMANDS[NEXT[coming.kind]][coming.side < 0],
        action_time_left_us=None if left_s is None else round(left_s * US_PER_S),
        source_identifier=REFEREE_SOURCE,
        match_type=MatchType.FRIENDLY,
    )


def _team(name: str) -> TeamInfo:
    return TeamInfo(name, 0, 0, 0, 4, _HALF_US, 0, can_place_ball=True, max_allowed_robots=11)
