"""The built-in players by name, for command lines and files."""

from __future__ import annotations

import importlib
import os
import sys
from typing import cast

from field_models.errors import ArgumentError
from sim2d.players.built_in import USES, BuiltInPlayer, BuiltInTeam
from sim2d.robot_link import PlayerFactory

__all__ = ["PLAYERS", "BuiltInTeam", "player_factory", "player_name"]

PLAYERS: dict[str, PlayerFactory] = {
    "plain": BuiltInPlayer,
    "memory": BuiltInTeam(("memory",)),
    "planning": BuiltInTeam(("memory", "plans", "messages")),
    "asking": BuiltInTeam(("memory", "plans", "messages", "goal_looks")),
    "looking": BuiltInTeam(("memory", "plans", "messages", "floor_looks")),
    "silent": BuiltInTeam(("memory", "plans")),
}


def player_factory(name: str) -> PlayerFactory:
    """Return the factory of players for a name, for the features that they use, or for a path ``package.module:Name``.

    Features are joined as in ``memory+plans``. Modules in the current folder can also be imported.

    Raises
    ------
    ArgumentError
        If there is no such player, or the path cannot be imported or is not callable.
    """
    if ":" in name:
        return _imported(name)
    if name in PLAYERS:
        return PLAYERS[name]
    uses = name.split("+")
    if set(uses) <= USES.keys():
        return BuiltInTeam(tuple(uses))
    raise ArgumentError(f"there is no player '{name}', only {', '.join(PLAYERS)}, or one's own as MODULE:NAME")


def _imported(path: str) -> PlayerFactory:
    module_name, _, name = path.partition(":")
    # an installed command does not search the current folder; worker processes inherit this list
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:
        text = " ".join(f"{type(error).__name__}: {error}".split())
        raise ArgumentError(f"the player '{path}' cannot be imported: {text}") from None
    factory = getattr(module, name, None)
    if factory is None:
        raise ArgumentError(f"the module '{module_name}' has no player '{name}'")
    if not callable(factory):
        raise ArgumentError(f"'{path}' makes no players: it cannot be called")
    return cast(PlayerFactory, factory)


def player_name(factory: PlayerFactory) -> str:
    """Return the name of a factory of players, as for `player_factory`; else that of its class or function."""
    for name, known in PLAYERS.items():
        if known == factory:
            return name
    if isinstance(factory, BuiltInTeam) and factory == BuiltInTeam(factory.uses):
        return "+".join(factory.uses)
    inner = getattr(factory, "func", factory)
    return str(getattr(inner, "__qualname__", type(inner).__qualname__))
