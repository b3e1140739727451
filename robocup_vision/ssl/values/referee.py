"""Messages of the game controller: stage, command, teams. Times stay integer microseconds, so that none is rounded."""

from __future__ import annotations

from typing import Annotated

from robocup_vision.ssl.protocol.mapping import Message, OpenEnum, Wire, message_value
from robocup_vision.ssl.values.geometry import FloorPoint, Geometry
from robocup_vision.ssl.values.tracked import TrackerPacket


class Stage(OpenEnum):
    """Stage of a match."""

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
    """Kind of a match."""

    UNKNOWN = 0
    GROUP_PHASE = 1
    ELIMINATION_PHASE = 2
    FRIENDLY = 3


class HullColor(OpenEnum):
    """Brightness of the hulls of a team's robots."""

    UNKNOWN = 0
    DARK = 1
    LIGHT = 2


@message_value("referee.TeamInfo")
class TeamInfo(Message):
    """One team: its goals, cards, time-outs (their time in microseconds), and the number of its goalkeeper."""

    name: Annotated[str, Wire(1)]
    score: Annotated[int, Wire(2)]
    red_cards: Annotated[int, Wire(3)]
    yellow_cards: Annotated[int, Wire(5)]
    timeouts: Annotated[int, Wire(6)]
    timeout_time_us: Annotated[int, Wire(7, "timeout_time")]
    goalkeeper: Annotated[int, Wire(8)]
    yellow_card_times_us: Annotated[tuple[int, ...], Wire(4, "yellow_card_times", kind="uint32 packed")] = ()
    foul_counter: Annotated[int | None, Wire(9)] = None
    ball_placement_failures: Annotated[int | None, Wire(10)] = None
    can_place_ball: Annotated[bool | None, Wire(12)] = None
    max_allowed_robots: Annotated[int | None, Wire(13, "max_allowed_bots")] = None
    substitution_intent: Annotated[bool | None, Wire(14, "bot_substitution_intent")] = None
    ball_placement_failures_reached: Annotated[bool | None, Wire(15)] = None
    substitution_allowed: Annotated[bool | None, Wire(16, "bot_substitution_allowed")] = None
    substitutions_left: Annotated[int | None, Wire(17, "bot_substitutions_left")] = None
    substitution_time_left: Annotated[int | None, Wire(18, "bot_substitution_time_left")] = None
    hull_color: Annotated[HullColor | None, Wire(19)] = None


@message_value("referee.GameEvent")
class GameEvent(Message):
    """An event; its fields are kept undecoded in `unknown`."""


@message_value("referee.GameEventProposalGroup")
class GameEventProposals(Message):
    """Events that automatic referees have proposed."""

    group_id: Annotated[str | None, Wire(3, "id")] = None
    game_events: Annotated[tuple[GameEvent, ...], Wire(1)] = ()
    accepted: Annotated[bool | None, Wire(2)] = None


@message_value("referee.Referee")
class Referee(Message):
    """One datagram of the game controller.

    Times ending in ``_us`` are microseconds, stamps since 1970. A command is new if `command_counter` has changed.
    Packets are repeated, and any of them may be lost.
    """

    packet_time_us: Annotated[int, Wire(1, "packet_timestamp", kind="uint64")]
    stage: Annotated[Stage, Wire(2)]
    command: Annotated[RefereeCommand, Wire(4)]
    command_counter: Annotated[int, Wire(5)]
    command_time_us: Annotated[int, Wire(6, "command_timestamp", kind="uint64")]
    yellow: Annotated[TeamInfo, Wire(7)]
    blue: Annotated[TeamInfo, Wire(8)]
    stage_time_left_us: Annotated[int | None, Wire(3, "stage_time_left", kind="sint64")] = None
    designated_position: Annotated[FloorPoint | None, Wire(9)] = None  #: where the ball is to be placed
    blue_on_positive_half: Annotated[bool | None, Wire(10, "blue_team_on_positive_half")] = None
    next_command: Annotated[RefereeCommand | None, Wire(12)] = None
    game_events: Annotated[tuple[GameEvent, ...], Wire(16)] = ()
    game_event_proposals: Annotated[tuple[GameEventProposals, ...], Wire(17)] = ()
    action_time_left_us: Annotated[int | None, Wire(15, "current_action_time_remaining", kind="int64")] = None
    source_identifier: Annotated[str | None, Wire(18)] = None
    match_type: Annotated[MatchType | None, Wire(19)] = None
    status_message: Annotated[str | None, Wire(20)] = None


@message_value("referee.CiInput")
class CiInput(Message):
    """Message of a simulator to a game controller that runs on simulated time, which is `time_ns`."""

    time_ns: Annotated[int | None, Wire(1, "timestamp", kind="int64")] = None
    tracker: Annotated[TrackerPacket | None, Wire(2, "tracker_packet")] = None
    geometry: Annotated[Geometry | None, Wire(4)] = None


@message_value("referee.CiOutput")
class CiOutput(Message):
    """The game controller's answer."""

    referee: Annotated[Referee | None, Wire(1, "referee_msg")] = None
