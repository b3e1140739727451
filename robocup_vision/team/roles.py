"""Who of a team goes to the ball and who supports: each robot decides for itself, by rules that all have in common.

The robot that would be at the ball first fetches it. The one that fetches it already keeps that role until another
would be there sooner by a margin. Robots that have not been heard of lately are not counted on, so without any message
each decides alone. The keeper is fixed, as the leagues' rules want it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.team.message import Role, TeamMessage

STALE_S = 1.6  # a robot that was not heard of for so long is not counted on: three messages
# another robot must be at the ball sooner by this to take it over: more than what one message changes
_MARGIN_S = 0.5


@dataclass(frozen=True, slots=True)
class ChosenRole:
    """The role of one robot now."""

    role: Role  #: what it does
    #: which of so many supporters (or searchers) it is, counted from the right side of the field (least y)
    place: int = 0
    places: int = 1
    is_agreed: bool = False  #: whether another robot was heard of that plays in the field; else it decides alone


class RoleChooser:
    """Chooses the role of one robot.

    Parameters
    ----------
    is_keeper : bool
        It keeps the goal.
    speed_mps : float
        Nobody of the team is faster.
    """

    def __init__(self, number: int, is_keeper: bool, speed_mps: float) -> None:
        self._number, self._is_keeper, self._speed_mps = number, is_keeper, speed_mps
        self._messages: dict[int, TeamMessage] = {}
        self.role: Role = "keep" if is_keeper else "search"

    def update(self, message: TeamMessage) -> None:
        """Take in a message; an older one than the last of its sender changes nothing."""
        known = self._messages.get(message.sender)
        if message.sender != self._number and (known is None or message.t_s > known.t_s):
            self._messages[message.sender] = message

    def choose(
        self, t_s: float, place: tuple[float, float] | None, ball: tuple[float, float] | None, time_to_ball_s: float
    ) -> ChosenRole:
        """Return the role for now.

        Parameters
        ----------
        t_s : float
            Now, seconds.
        place : (float, float) or None
            Where the robot is, field frame.
        ball : (float, float) or None
            Where the ball is, as far as it knows.
        time_to_ball_s : float
            How long it would take to it.
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
        """Return the time of another robot to the ball: what it told, but no less than from its place to this ball."""
        if other.pose is None:
            return math.inf
        away_m = math.dist((other.pose.x_m, other.pose.y_m), ball)
        time_s = max(other.time_to_ball_s, away_m / self._speed_mps)
        return time_s - (_MARGIN_S if other.role == "fetch" else 0.0)

    def _among(self, others: Iterable[TeamMessage], place: tuple[float, float] | None) -> ChosenRole:
        others = list(others)
        # the one who fetches needs no place
        beside = [one for one in others if one.role != "fetch"] if self.role != "search" else others
        own_y = 0.0 if place is None else place[1]
        before = sum((one.pose.y_m, one.sender) < (own_y, self._number) for one in beside if one.pose is not None)
        return ChosenRole(self.role, before, len(beside) + 1, bool(others))


def time_to_ball_s(pose: Pose2, ball: tuple[float, float], speed_mps: float, turn_rps: float) -> float:
    """Return how long a robot takes to a ball: to drive there, and to turn there meanwhile or afterwards."""
    drive_s = math.dist((pose.x_m, pose.y_m), ball) / speed_mps
    off = wrap_angle(math.atan2(ball[1] - pose.y_m, ball[0] - pose.x_m) - pose.theta_rad)
    # it turns while it speeds up: about half of the turn takes time of its own
    return drive_s + 0.5 * abs(off) / turn_rps
