"""Messages of a player to its team and from it: the ball, and roles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from field_models.errors import PacketError
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.team.ball_fusion import FORGET_S, FusedBall, TeamBall
from robocup_vision.team.message import BallSighting, Role, TeamMessage, unpack_message
from robocup_vision.team.roles import ChosenRole, time_to_ball_s
from sim2d.robot_link import TIME_SLACK_S, PlayerSetup, Point

# time between two messages, by the channel's capacity
_PERIOD_S = 0.5


class ChoosesRole(Protocol):
    """Chooses the player's role from messages of others, like `RoleChooser`, which explains the arguments."""

    role: Role

    def update(self, message: TeamMessage) -> None:
        """Update with a message."""

    def choose(self, t_s: float, place: Point | None, ball: Point | None, time_to_ball_s: float) -> ChosenRole:
        """Return the present role."""


class TeamTalk:
    """One player's messages."""

    def __init__(self, setup: PlayerSetup, roles: ChoosesRole) -> None:
        self._number, self._attacks = setup.number, setup.attacks
        self._limits = setup.limits
        self._ball = TeamBall()
        self._roles = roles
        self._sent_s = -math.inf
        self.refused = 0

    def hear(self, messages: Sequence[bytes], own: BallSighting | None) -> None:
        """Update with the messages of others.

        Parameters
        ----------
        own : BallSighting or None
            This player's last sighting of the ball.
        """
        for data in messages:
            try:
                message = unpack_message(data)
            except PacketError:
                self.refused += 1
                continue
            if message.sender == self._number:
                # some radios return what was sent
                continue
            self._ball.update(message, own)
            self._roles.update(message)

    def ball(self, own: BallSighting | None, t_s: float) -> FusedBall | None:
        """Return the ball by the sightings of this player and the others; see `TeamBall.fuse`."""
        return self._ball.fuse(own, t_s)

    def is_own_enough(self, own: BallSighting | None, t_s: float) -> bool:
        """Whether the player's own sighting is so accurate that messages add nothing."""
        return own is not None and self._ball.is_own_enough(own, t_s)

    def forget(self, t_s: float) -> None:
        """Forget the others' sightings of the ball before a time."""
        self._ball.forget(t_s)

    def reject(self, ball: FusedBall) -> None:
        """Forget the others' sightings of a ball that is not there."""
        self._ball.reject(ball.sources)

    def role(self, pose: Pose2 | None, ball: Point | None, t_s: float) -> ChosenRole:
        """Return the player's present role."""
        place = None if pose is None else (pose.x_m, pose.y_m)
        chosen = self._roles.choose(t_s, place, ball, self._time_to_ball_s(pose, ball))
        if self._attacks > 0:
            return chosen
        # places are counted from the team's own right
        return replace(chosen, place=chosen.places - 1 - chosen.place)

    def tell(
        self, t_s: float, belief: PoseEstimate | NotLocated, own: BallSighting | None, ball: Point | None
    ) -> bytes | None:
        """Return the message if one is due, else None.

        Parameters
        ----------
        belief : PoseEstimate or NotLocated
            Pose of the player; with more than one candidate it sends neither its own place nor the ball's.
        own : BallSighting or None
            Its own last sighting of the ball.
        ball : (float, float) or None
            Its estimate of the ball from all sources.
        """
        if t_s < self._sent_s + _PERIOD_S - TIME_SLACK_S:
            return None
        self._sent_s = t_s
        if not belief or len(belief.candidates) > 1:
            return TeamMessage(self._number, t_s, self._roles.role).pack()
        time_s = self._time_to_ball_s(belief.pose, ball)
        is_old = own is None or t_s - own.t_s > FORGET_S
        sighting = None if is_old else own
        return TeamMessage(self._number, t_s, self._roles.role, time_s, belief.pose, belief.covariance, sighting).pack()

    def _time_to_ball_s(self, pose: Pose2 | None, ball: Point | None) -> float:
        if pose is None or ball is None:
            return math.inf
        return time_to_ball_s(pose, ball, self._limits.speed_mps, self._limits.turn_rps)
