"""Messages of the game controller: stage, command, teams. Its whole microseconds stay whole, so that none is lost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from robocup_vision.ssl.protocol.mapping import OpenEnum, Wire, message_value
from robocup_vision.ssl.values.geometry import MM_PER_M, Geometry
from robocup_vision.ssl.values.tracked import TrackerPacket


class Stage(OpenEnum):
    """Where in a match we are."""

    NORMAL_FIRST_HALF_PRE = 0
    NORMAL_FIRST_HALF = 1
    NORMAL_HALF_TIME = 2
    NORMAL_SECOND_HALF_PRE = 3
    NORMAL_SECOND_HALF = 4
    EXTRA_TIME_BREAK = 5
    EXTRA_FIRST_HALF_PRE = 6
    EXTRA_FIRST_HALF = 7
    EXTRA_HALF_TIME = 8
    EXTRA_SECOND_HALF_PRE = 9
    EXTRA_SECOND_HALF = 10
    PENALTY_SHOOTOUT_BREAK = 11
    PENALTY_SHOOTOUT = 12
    POST_GAME = 13


class RefereeCommand(OpenEnum):
    """What the teams must do now."""

    HALT = 0
    STOP = 1
    NORMAL_START = 2
    FORCE_START = 3
    PREPARE_KICKOFF_YELLOW = 4
    PREPARE_KICKOFF_BLUE = 5
    PREPARE_PENALTY_YELLOW = 6
    PREPARE_PENALTY_BLUE = 7
    DIRECT_FREE_YELLOW = 8
    DIRECT_FREE_BLUE = 9
    INDIRECT_FREE_YELLOW = 10
    INDIRECT_FREE_BLUE = 11
    TIMEOUT_YELLOW = 12
    TIMEOUT_BLUE = 13
    GOAL_YELLOW = 14
    GOAL_BLUE = 15
    BALL_PLACEMENT_YELLOW = 16
    BALL_PLACEMENT_BLUE = 17


class MatchType(OpenEnum):
    """What is at stake."""

    UNKNOWN = 0
    GROUP_PHASE = 1
    ELIMINATION_PHASE = 2
    FRIENDLY = 3


class HullColor(OpenEnum):
    """Of a team's robots."""

    UNKNOWN = 0
    DARK = 1
    LIGHT = 2


@message_value("referee.Referee.TeamInfo")
@dataclass(frozen=True, slots=True)
class TeamInfo:
    """One team: its goals, cards, time-outs (microseconds), and the number of its goalkeeper."""

    name: str
    score: int
    red_cards: int
    yellow_cards: int
    timeouts: int
    timeout_time_us: Annotated[int, Wire("timeout_time")]
    goalkeeper: int
    yellow_card_times_us: Annotated[tuple[int, ...], Wire("yellow_card_times")] = ()
    foul_counter: int | None = None
    ball_placement_failures: int | None = None
    can_place_ball: bool | None = None
    max_allowed_robots: Annotated[int | None, Wire("max_allowed_bots")] = None
    substitution_intent: Annotated[bool | None, Wire("bot_substitution_intent")] = None
    ball_placement_failures_reached: bool | None = None
    substitution_allowed: Annotated[bool | None, Wire("bot_substitution_allowed")] = None
    substitutions_left: Annotated[int | None, Wire("bot_substitutions_left")] = None
    substitution_time_left: Annotated[int | None, Wire("bot_substitution_time_left")] = None
    hull_color: HullColor | None = None
    unknown: bytes = b""


@message_value("referee.Referee.Point")
@dataclass(frozen=True, slots=True)
class DesignatedPosition:
    """Where the ball shall be placed, field frame."""

    x_m: Annotated[float, Wire("x", MM_PER_M)]
    y_m: Annotated[float, Wire("y", MM_PER_M)]
    unknown: bytes = b""


@message_value("referee.GameEvent")
@dataclass(frozen=True, slots=True)
class GameEvent:
    """Something that happened; kept as it came, in `unknown`."""

    unknown: bytes = b""


@message_value("referee.GameEventProposalGroup")
@dataclass(frozen=True, slots=True)
class GameEventProposals:
    """Events that automatic referees have proposed."""

    group_id: Annotated[str | None, Wire("id")] = None
    game_events: tuple[GameEvent, ...] = ()
    accepted: bool | None = None
    unknown: bytes = b""


@message_value("referee.Referee")
@dataclass(frozen=True, slots=True)
class Referee:
    """One datagram of the game controller.

    Times ending in ``_us`` are microseconds, the stamps since 1970. A command is a new one when `command_counter` is
    another; packets are repeated, and any may be lost.
    """

    packet_time_us: Annotated[int, Wire("packet_timestamp")]
    stage: Stage
    command: RefereeCommand
    command_counter: int
    command_time_us: Annotated[int, Wire("command_timestamp")]
    yellow: TeamInfo
    blue: TeamInfo
    stage_time_left_us: Annotated[int | None, Wire("stage_time_left")] = None
    designated_position: DesignatedPosition | None = None
    blue_on_positive_half: Annotated[bool | None, Wire("blue_team_on_positive_half")] = None
    next_command: RefereeCommand | None = None
    game_events: tuple[GameEvent, ...] = ()
    game_event_proposals: tuple[GameEventProposals, ...] = ()
    action_time_left_us: Annotated[int | None, Wire("current_action_time_remaining")] = None
    source_identifier: str | None = None
    match_type: MatchType | None = None
    status_message: str | None = None
    unknown: bytes = b""


@message_value("referee.Input")
@dataclass(frozen=True, slots=True)
class ControllerInput:
    """An order to the game controller; kept as it came, in `unknown`."""

    unknown: bytes = b""


@message_value("referee.CiInput")
@dataclass(frozen=True, slots=True)
class CiInput:
    """Message of a simulator to a game controller that runs at the simulator's speed; `time_ns` is simulated time."""

    time_ns: Annotated[int | None, Wire("timestamp")] = None
    tracker: Annotated[TrackerPacket | None, Wire("tracker_packet")] = None
    inputs: Annotated[tuple[ControllerInput, ...], Wire("api_inputs")] = ()
    geometry: Geometry | None = None
    unknown: bytes = b""


@message_value("referee.CiOutput")
@dataclass(frozen=True, slots=True)
class CiOutput:
    """What the game controller answers."""

    referee: Annotated[Referee | None, Wire("referee_msg")] = None
    unknown: bytes = b""
