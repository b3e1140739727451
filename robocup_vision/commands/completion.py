"""Completion of commands, options, field names and files in a shell (extra `completion`)."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from typing import Any


def complete(parser: argparse.ArgumentParser) -> None:
    """If the shell asks for completions, answer it and exit; needs argcomplete."""
    if find_spec("argcomplete") is None:
        return
    argcomplete: Any = import_module("argcomplete")
    for action in _actions(parser):
        if action.dest == "field":
            action.completer = _complete_field  # type: ignore[attr-defined]
    argcomplete.autocomplete(parser)


def _complete_field(prefix: str, **_: Any) -> list[str]:
    from field_models.catalog import field_names

    completers: Any = import_module("argcomplete.completers")
    files = completers.FilesCompleter(("toml",))(prefix)
    return [*(name for name in field_names() if name.startswith(prefix)), *files]


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the options of a parser and of all its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from _actions(inner)
