"""The built-in players by name, for command lines and for the files that name the players."""

from __future__ import annotations

from dataclasses import dataclass

from field_models.errors import ArgumentError
from sim2d.players.built_in import BuiltInPlayer
from sim2d.players.settings import PlayerSettings
from sim2d.robot_link import Player, PlayerFactory, PlayerSetup


@dataclass(frozen=True, slots=True)
class BuiltInTeam:
    """Makes built-in players with options; equal to another one of the same options, in other processes too.

    Parameters
    ----------
    remembers, plans, asks, looks_again : bool
        As `BuiltInPlayer`.
    settings : PlayerSettings
        As `BuiltInPlayer`.
    """

    remembers: bool = False
    plans: bool = False
    asks: bool = False
    looks_again: bool = False
    settings: PlayerSettings = PlayerSettings()

    def __call__(self, setup: PlayerSetup) -> Player:
        """Make one player."""
        return BuiltInPlayer(
            setup,
            remembers=self.remembers,
            plans=self.plans,
            asks=self.asks,
            looks_again=self.looks_again,
            settings=self.settings,
        )


PLAYERS: dict[str, PlayerFactory] = {
    "plain": BuiltInPlayer,
    "memory": BuiltInTeam(remembers=True),
    "planning": BuiltInTeam(remembers=True, plans=True),
    "asking": BuiltInTeam(remembers=True, plans=True, asks=True),
    "looking": BuiltInTeam(remembers=True, plans=True, looks_again=True),
}


def player_factory(name: str) -> PlayerFactory:
    """Return what makes the players of a name.

    Raises
    ------
    ArgumentError
        If there is no such player.
    """
    if name not in PLAYERS:
        raise ArgumentError(f"there is no player '{name}', only {', '.join(PLAYERS)}")
    return PLAYERS[name]


def player_name(factory: PlayerFactory) -> str:
    """Return the name of what makes players: that above, or else the name of their class or function."""
    for name, known in PLAYERS.items():
        if known == factory:
            return name
    inner = getattr(factory, "func", factory)
    return str(getattr(inner, "__qualname__", type(inner).__qualname__))
