"""Formats a command line for the files that the command writes."""

from __future__ import annotations

import argparse
import shlex

# arguments that are written elsewhere in the command, and options for the workers
_NO_OPTIONS = ("command", "action", "run", "out", "jobs", "dask")


def spelled(name: str, args: argparse.Namespace, out: str | None = "OUT") -> str:
    """Return a command line equivalent to parsed arguments, with all options (also defaults) and the output."""
    words = ["robocup-vision", *name.split()]
    for option, value in vars(args).items():
        if option in _NO_OPTIONS or value is None or value is False:
            continue
        words.append(f"--{option.replace('_', '-')}")
        if value is not True:
            words += map(str, value if isinstance(value, list) else [value])
    return shlex.join(words if out is None else [*words, out])
