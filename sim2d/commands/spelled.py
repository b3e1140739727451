"""Spells a command, for the files that it writes."""

from __future__ import annotations

import argparse
import shlex

# what stands elsewhere in the command, and who does the work
_NO_OPTIONS = ("command", "action", "run", "out", "jobs", "dask")


def spelled(name: str, args: argparse.Namespace, out: str | None = "OUT") -> str:
    """Return the command that does the same as parsed arguments: its options, defaults included, and what it writes."""
    words = ["robocup-vision", *name.split()]
    for option, value in vars(args).items():
        if option in _NO_OPTIONS or value is None or value is False:
            continue
        words.append(f"--{option.replace('_', '-')}")
        if value is not True:
            words += map(str, value if isinstance(value, list) else [value])
    return shlex.join(words if out is None else [*words, out])
