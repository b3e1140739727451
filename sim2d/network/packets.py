"""The simulator's truth as a tracker's packet, and its own referee's."""

from __future__ import annotations

from robocup_vision.ssl.values.referee import MatchType, Referee, RefereeCommand, Stage, TeamInfo
from robocup_vision.ssl.values.simulation import Team
from robocup_vision.ssl.values.tracked import (
    Capability,
    TeamColor,
    TrackedBall,
    TrackedFrame,
    TrackedRobot,
    TrackedRobotId,
    TrackerPacket,
    Vector2,
    Vector3,
)
from sim2d.network.world import LeagueState

# the same in every run, so that a reader of a log identifies the truth
TRUTH_UUID, TRUTH_SOURCE = "sim2d-truth", "sim2d"
REFEREE_SOURCE = "sim2d"
_COLORS = {Team.YELLOW: TeamColor.YELLOW, Team.BLUE: TeamColor.BLUE}
_US_PER_S = 1e6
_HALF_US = 300_000_000


def tracker_packet(state: LeagueState, frame_number: int, epoch_s: float) -> TrackerPacket:
    """Return the truth as a tracker would send it: without noise and delay, however real the vision is."""
    ball = state.ball
    robots = tuple(
        TrackedRobot(
            TrackedRobotId(robot.number, _COLORS[robot.team]),
            Vector2(robot.pose.x_m, robot.pose.y_m),
            robot.pose.theta_rad,
            Vector2(*robot.velocity_mps),
            robot.turn_rps,
            1.0,
        )
        for robot in state.robots
    )
    tracked = TrackedBall(Vector3(ball.x_m, ball.y_m, ball.z_m), Vector3(ball.vx_mps, ball.vy_mps, ball.vz_mps), 1.0)
    frame = TrackedFrame(
        frame_number,
        epoch_s + state.t_s,
        (tracked,),
        robots,
        capabilities=(Capability.DETECT_FLYING_BALLS,),
    )
    return TrackerPacket(TRUTH_UUID, TRUTH_SOURCE, frame)


def referee_packet(epoch_s: float, t_s: float) -> Referee:
    """Return the referee's message that lets everybody play from the beginning: yellow towards +x."""
    begin_us = round(epoch_s * _US_PER_S)
    return Referee(
        packet_time_us=begin_us + round(t_s * _US_PER_S),
        stage=Stage.NORMAL_FIRST_HALF,
        command=RefereeCommand.FORCE_START,
        command_counter=1,
        command_time_us=begin_us,
        yellow=_team("yellow"),
        blue=_team("blue"),
        stage_time_left_us=_HALF_US - round(t_s * _US_PER_S),
        blue_on_positive_half=True,
        source_identifier=REFEREE_SOURCE,
        match_type=MatchType.FRIENDLY,
    )


def _team(name: str) -> TeamInfo:
    return TeamInfo(name, 0, 0, 0, 4, _HALF_US, 0, can_place_ball=True, max_allowed_robots=11)
