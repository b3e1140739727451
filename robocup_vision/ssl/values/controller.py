"""Messages of automatic referees and teams to the game controller, and its replies."""

from __future__ import annotations

from typing import Annotated

from robocup_vision.ssl.protocol.mapping import Message, OpenEnum, Wire, message_value
from robocup_vision.ssl.values.simulation import Team


class ReplyStatus(OpenEnum):
    """Whether the game controller accepted a message."""

    UNKNOWN = 0
    OK = 1
    REJECTED = 2


class EventKind(OpenEnum):
    """Kind of an event; only those that our automatic referee reports."""

    UNKNOWN = 0
    PLACEMENT_SUCCEEDED = 5
    BALL_LEFT_FIELD_TOUCH_LINE = 6
    BALL_LEFT_FIELD_GOAL_LINE = 7
    ATTACKER_DOUBLE_TOUCHED_BALL = 14
    ATTACKER_TOUCHED_BALL_IN_DEFENSE_AREA = 15
    BOT_KICKED_BALL_TOO_FAST = 18
    BOT_INTERFERED_PLACEMENT = 20
    BOT_TOO_FAST_IN_STOP = 28
    DEFENDER_TOO_CLOSE_TO_KICK_POINT = 29
    DEFENDER_IN_DEFENSE_AREA = 31
    POSSIBLE_GOAL = 39


class AdvantageChoice(OpenEnum):
    """What a team wants after a foul of the other one."""

    STOP = 0
    CONTINUE = 1


@message_value("controller.ControllerReply")
class ControllerReply(Message):
    """The game controller's reply to each message; `reason` says why it rejected one."""

    status: Annotated[ReplyStatus | None, Wire(1, "status_code")] = None
    reason: Annotated[str | None, Wire(2)] = None
    next_token: Annotated[str | None, Wire(3)] = None


@message_value("controller.ControllerToClient")
class ControllerMessage(Message):
    """A message of the game controller, in the same format for automatic referees and teams."""

    reply: Annotated[ControllerReply | None, Wire(1, "controller_reply")] = None


@message_value("controller.Vector2")
class Place(Message):
    """A point on the floor, field frame, metres."""

    x_m: Annotated[float, Wire(1, "x")]
    y_m: Annotated[float, Wire(2, "y")]


@message_value("controller.ByRobot")
class ByRobot(Message):
    """A robot that did something, the place, and the amount in m/s or metres, depending on the event."""

    team: Annotated[Team, Wire(1, "by_team")]
    number: Annotated[int | None, Wire(2, "by_bot")] = None
    place: Annotated[Place | None, Wire(3, "location")] = None
    amount: Annotated[float | None, Wire(4)] = None


@message_value("controller.PlacementSucceeded")
class PlacementSucceeded(Message):
    """A team has placed the ball: time taken, remaining distance to the place, and initial distance."""

    team: Annotated[Team, Wire(1, "by_team")]
    took_s: Annotated[float | None, Wire(2, "time_taken")] = None
    off_m: Annotated[float | None, Wire(3, "precision")] = None
    distance_m: Annotated[float | None, Wire(4, "distance")] = None


@message_value("controller.Goal")
class Goal(Message):
    """The ball is in a goal: the team that scored, the robot that kicked, and the ball's greatest height."""

    team: Annotated[Team, Wire(1, "by_team")]
    kicking_team: Annotated[Team | None, Wire(6)] = None
    kicking_number: Annotated[int | None, Wire(2, "kicking_bot")] = None
    place: Annotated[Place | None, Wire(3, "location")] = None
    max_height_m: Annotated[float | None, Wire(5, "max_ball_height")] = None
    robots: Annotated[int | None, Wire(7, "num_robots_by_team")] = None


@message_value("controller.GameEvent")
class RefereeEvent(Message):
    """An event seen by an automatic referee: its kind, its time (microseconds since 1970), and one of the fields."""

    kind: Annotated[EventKind | None, Wire(40, "type")] = None
    time_us: Annotated[int | None, Wire(49, "created_timestamp", kind="uint64")] = None
    placement_succeeded: Annotated[PlacementSucceeded | None, Wire(5)] = None
    ball_left_field_touch_line: Annotated[ByRobot | None, Wire(6)] = None
    ball_left_field_goal_line: Annotated[ByRobot | None, Wire(7)] = None
    attacker_double_touched_ball: Annotated[ByRobot | None, Wire(14)] = None
    attacker_touched_ball_in_defense_area: Annotated[ByRobot | None, Wire(15)] = None
    bot_kicked_ball_too_fast: Annotated[ByRobot | None, Wire(18)] = None
    bot_interfered_placement: Annotated[ByRobot | None, Wire(20)] = None
    bot_too_fast_in_stop: Annotated[ByRobot | None, Wire(28)] = None
    defender_too_close_to_kick_point: Annotated[ByRobot | None, Wire(29)] = None
    defender_in_defense_area: Annotated[ByRobot | None, Wire(31)] = None
    possible_goal: Annotated[Goal | None, Wire(39)] = None


def referee_event(kind: EventKind, what: ByRobot | PlacementSucceeded | Goal, time_us: int) -> RefereeEvent:
    """Return an event with its details in the field for its kind."""
    return RefereeEvent(kind, time_us, **{kind.name.lower(): what})  # type: ignore[arg-type]


@message_value("controller.AutoRefRegistration")
class AutoRefRegistration(Message):
    """The first message of an automatic referee."""

    identifier: Annotated[str, Wire(1)]


@message_value("controller.AutoRefToController")
class AutoRefMessage(Message):
    """A message of an automatic referee."""

    event: Annotated[RefereeEvent | None, Wire(2, "game_event")] = None


@message_value("controller.TeamRegistration")
class TeamRegistration(Message):
    """The first message of a team, with its name as in the game controller."""

    team_name: Annotated[str, Wire(1)]
    team: Annotated[Team | None, Wire(3)] = None


@message_value("controller.TeamToController")
class TeamMessage(Message):
    """A request of a team, in one of the fields."""

    desired_keeper: Annotated[int | None, Wire(2, kind="int32")] = None
    advantage_choice: Annotated[AdvantageChoice | None, Wire(3)] = None
    substitute_robot: Annotated[bool | None, Wire(4, "substitute_bot")] = None
    ping: Annotated[bool | None, Wire(5)] = None
