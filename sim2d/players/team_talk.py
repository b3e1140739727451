"""What a player tells the others of its team, and what it makes of their messages: the ball, and its role."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from field_models.errors import PacketError
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.team.ball_fusion import BallFusionSettings, FusedBall, TeamBall
from robocup_vision.team.message import BallSighting, Role, TeamMessage, unpack_message
from robocup_vision.team.roles import ChosenRole, RoleSettings, time_to_ball_s
from sim2d.robot_link import TIME_SLACK_S, PlayerSetup, Point


@dataclass(frozen=True, slots=True)
class TeamTalkSettings:
    """Values of `TeamTalk`."""

    #: Time between two messages: the channel carries no more.
    period_s: float = 0.5
    ball: BallFusionSettings = BallFusionSettings()
    roles: RoleSettings = RoleSettings()


class ChoosesRole(Protocol):
    """Chooses the player's role from messages of others; see `RoleChooser`, which does, for the arguments."""

    role: Role

    def update(self, message: TeamMessage) -> None:
        """Take in a message."""

    def choose(self, t_s: float, place: Point | None, ball: Point | None, time_to_ball_s: float) -> ChosenRole:
        """Return the role for now."""


class TeamTalk:
    """One player's messages."""

    def __init__(self, setup: PlayerSetup, roles: ChoosesRole, settings: TeamTalkSettings = TeamTalkSettings()) -> None:
        self._number, self._attacks = setup.number, setup.attacks
        self._limits, self._settings = setup.limits, settings
        self._ball = TeamBall(settings.ball)
        self._roles = roles
        self._sent_s = -math.inf
        self.refused = 0

    def hear(self, messages: Sequence[bytes], own: BallSighting | None) -> None:
        """Take in what others sent.

        Parameters
        ----------
        own : BallSighting or None
            The ball as this player last saw it.
        """
        for data in messages:
            try:
                message = unpack_message(data)
            except PacketError:
                self.refused += 1
                continue
            if message.sender == self._number:
                # some radios give back what was sent
                continue
            self._ball.update(message, own)
            self._roles.update(message)

    def ball(self, own: BallSighting | None, t_s: float) -> FusedBall | None:
        """Return the ball as this player and the others know it; see `TeamBall.fuse`."""
        return self._ball.fuse(own, t_s)

    def is_own_enough(self, own: BallSighting | None, t_s: float) -> bool:
        """Whether the player sees the ball so well itself that messages would add nothing."""
        return own is not None and self._ball.is_own_enough(own, t_s)

    def forget(self, t_s: float) -> None:
        """Forget what others saw of the ball before a time."""
        self._ball.forget(t_s)

    def reject(self, ball: FusedBall) -> None:
        """Forget what others told of a ball that is not there."""
        self._ball.reject(ball.sources)

    def role(self, pose: Pose2 | None, ball: Point | None, t_s: float) -> ChosenRole:
        """Return what this player is to do now."""
        place = None if pose is None else (pose.x_m, pose.y_m)
        chosen = self._roles.choose(t_s, place, ball, self._time_to_ball_s(pose, ball))
        if self._attacks > 0:
            return chosen
        # counted from the right side as the team sees it
        return replace(chosen, place=chosen.places - 1 - chosen.place)

    def tell(
        self, t_s: float, belief: PoseEstimate | NotLocated, own: BallSighting | None, ball: Point | None
    ) -> bytes | None:
        """Return the message that is due now; None between two messages.

        Parameters
        ----------
        belief : PoseEstimate or NotLocated
            Where the player is; with more than one candidate it tells neither its place nor the ball's.
        own : BallSighting or None
            The ball as it last saw it itself.
        ball : (float, float) or None
            Where it takes the ball to be, from all it knows.
        """
        if t_s < self._sent_s + self._settings.period_s - TIME_SLACK_S:
            return None
        self._sent_s = t_s
        if not belief or len(belief.candidates) > 1:
            return TeamMessage(self._number, t_s, self._roles.role).pack()
        time_s = self._time_to_ball_s(belief.pose, ball)
        is_old = own is None or t_s - own.t_s > self._settings.ball.forget_s
        sighting = None if is_old else own
        return TeamMessage(self._number, t_s, self._roles.role, time_s, belief.pose, belief.covariance, sighting).pack()

    def _time_to_ball_s(self, pose: Pose2 | None, ball: Point | None) -> float:
        if pose is None or ball is None:
            return math.inf
        return time_to_ball_s(pose, ball, self._limits.speed_mps, self._limits.turn_rps)
