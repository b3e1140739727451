"""Chooses which robot of a team goes to the ball and which ones support; each decides for itself, by common rules.

The robot that would be first at the ball fetches it. The one that already fetches keeps that role until another robot
would be there earlier by a margin. Robots whose messages are missing are not considered, so that without messages each
robot decides alone. The keeper is fixed, as the leagues' rules demand.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.team.message import Role, TeamMessage

STALE_S = 1.6  # a robot without a message for this time (three messages) is not considered
# time by which another robot must be earlier at the ball to take over: more than a single message changes
_MARGIN_S = 0.5


@dataclass(frozen=True, slots=True)
class ChosenRole:
    """The present role of one robot."""

    role: Role
    #: index among the supporters (or searchers), counted from the right side of the field (least y), and their number
    place: int = 0
    places: int = 1
    is_agreed: bool = False  #: whether there are messages of other field players; else the robot decides alone


class RoleChooser:
    """Chooses the role of one robot.

    Parameters
    ----------
    is_keeper : bool
        Whether the robot keeps the goal.
    speed_mps : float
        Largest speed of the team's robots.
    """

    def __init__(self, number: int, is_keeper: bool, speed_mps: float) -> None:
        self._number, self._is_keeper, self._speed_mps = number, is_keeper, speed_mps
        self._messages: dict[int, TeamMessage] = {}
        self.role: Role = "keep" if is_keeper else "search"

    def update(self, message: TeamMessage) -> None:
        """Add a message; one that is not newer than the last one of its sender is ignored."""
        known = self._messages.get(message.sender)
        if message.sender != self._number and (known is None or message.t_s > known.t_s):
            self._messages[message.sender] = message

    def choose(
        self, t_s: float, place: tuple[float, float] | None, ball: tuple[float, float] | None, time_to_ball_s: float
    ) -> ChosenRole:
        """Return the present role.

        Parameters
        ----------
        t_s : float
            Present time.
        place : (float, float) or None
            Place of the robot, field frame; None: unknown.
        ball : (float, float) or None
            Place of the ball, field frame; None: unknown.
        time_to_ball_s : float
            Time that the robot needs to reach the ball.
        """
        if self._is_keeper:
            return ChosenRole("keep")
        others = [
            one
            for one in self._messages.values()
            if one.role != "keep" and t_s - one.t_s <= STALE_S and one.pose is not None
        ]
        if ball is None:
            self.role = "search"
        else:
            own_s = time_to_ball_s - (_MARGIN_S if self.role == "fetch" else 0.0)
            is_first = all((own_s, self._number) <= (self._claim_s(one, ball), one.sender) for one in others)
            self.role = "fetch" if is_first else "support"
        return self._among(others, place)

    def _claim_s(self, other: TeamMessage, ball: tuple[float, float]) -> float:
        """Return another robot's time to the ball: as in its message, but at least that from its place to this ball."""
        if other.pose is None:
            return math.inf
        away_m = math.dist((other.pose.x_m, other.pose.y_m), ball)
        time_s = max(other.time_to_ball_s, away_m / self._speed_mps)
        return time_s - (_MARGIN_S if other.role == "fetch" else 0.0)

    def _among(self, others: Iterable[TeamMessage], place: tuple[float, float] | None) -> ChosenRole:
        others = list(others)
        # the robot that fetches does not need a place
        beside = [one for one in others if one.role != "fetch"] if self.role != "search" else others
        own_y = 0.0 if place is None else place[1]
        before = sum((one.pose.y_m, one.sender) < (own_y, self._number) for one in beside if one.pose is not None)
        return ChosenRole(self.role, before, len(beside) + 1, bool(others))


def time_to_ball_s(pose: Pose2, ball: tuple[float, float], speed_mps: float, turn_rps: float) -> float:
    """Return the time that a robot needs to a ball: for driving there, and turning meanwhile or afterwards."""
    drive_s = math.dist((pose.x_m, pose.y_m), ball) / speed_mps
    off = wrap_angle(math.atan2(ball[1] - pose.y_m, ball[0] - pose.x_m) - pose.theta_rad)
    # it turns while it accelerates: about half of the turn takes additional time
    return drive_s + 0.5 * abs(off) / turn_rps
