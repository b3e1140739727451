"""One control period of a match as a value: for figures, films and reports, never for a player."""

from __future__ import annotations

from dataclasses import dataclass

from sim2d.robot_link import Command, PlayerStatus, Senses
from sim2d.world.state import WorldState


@dataclass(frozen=True, slots=True)
class RobotMoment:
    """One robot in one control period."""

    #: What it sensed.
    senses: Senses
    #: What its player reported then.
    status: PlayerStatus
    #: What its player commanded then.
    command: Command
    #: Why its player was stopped; empty if it was not.
    stopped: str


@dataclass(frozen=True, slots=True)
class Moment:
    """One control period of a match: the truth when the senses were taken, and each robot in order of its index."""

    state: WorldState
    robots: tuple[RobotMoment, ...]
