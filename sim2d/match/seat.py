"""One player's seat in a match: hands it its robot's senses, checks what it answers, and stops it when it fails."""

from __future__ import annotations

import math

from field_models.errors import ArgumentError
from robocup_vision.estimates import NotLocated
from sim2d.report.moment import RobotMoment
from sim2d.robot_link import Command, Player, PlayerFactory, PlayerSetup, PlayerStatus, Senses
from sim2d.sensors.team_channel import check_message
from sim2d.world.robot_body import check_command

_REASON_LETTERS = 200


class Seat:
    """Holds one player, and stops it when it fails."""

    def __init__(self, make: PlayerFactory, setup: PlayerSetup) -> None:
        self._player: Player | None = None
        self._stopped = ""
        try:
            self._player = make(setup)
        except (Exception, SystemExit) as error:
            self._stop(error)

    def act(self, senses: Senses) -> RobotMoment:
        """Let the player act; once it has failed, its robot stands still."""
        if self._player is not None:
            try:
                command = _checked(self._player.act(senses))
                return RobotMoment(senses, _checked_status(self._player.status), command, "")
            except (Exception, SystemExit) as error:
                self._stop(error)
        return RobotMoment(
            senses, PlayerStatus(NotLocated("its player was stopped"), None, "stopped", None), Command(), self._stopped
        )

    def _stop(self, error: BaseException) -> None:
        # the error itself holds on to the player and all it has seen
        text = " ".join(f"{type(error).__name__}: {error}".split())
        self._stopped = text[:_REASON_LETTERS]
        self._player = None


def _checked(command: object) -> Command:
    """Return a command of plain finite numbers.

    Raises
    ------
    TypeError, ArgumentError
        If it is no command, or no robot can take it.
    """
    if not isinstance(command, Command):
        raise TypeError(f"the command is a {type(command).__name__}, no Command")
    plain = Command(
        float(command.forward_mps),
        float(command.left_mps),
        float(command.turn_rps),
        float(command.kick_mps),
        bool(command.dribble),
        None if command.pan_rad is None else float(command.pan_rad),
        command.message,
    )
    if plain.message is not None:
        check_message(plain.message)
    check_command(plain)
    return plain


def _checked_status(status: object) -> PlayerStatus:
    if not isinstance(status, PlayerStatus):
        raise TypeError(f"the status is a {type(status).__name__}, no PlayerStatus")
    if status.pose and not all(map(math.isfinite, status.pose.pose.array)):
        raise ArgumentError(f"the status' pose must be finite, got {status.pose.pose}")
    return status
