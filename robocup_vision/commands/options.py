"""Numbers that several commands take: one rule and one wording wherever a count or a seed is asked for.

They are refused while the command line is parsed, before a file is read. Loads nothing, so that --help answers at once.
"""

from __future__ import annotations

import argparse


def count(text: str) -> int:
    """Parse a number of things; a type for ``add_argument``.

    Raises
    ------
    ArgumentTypeError
        If it is less than 1, or no whole number.
    """
    value = _whole(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, got {value}")
    return value


def seed(text: str) -> int:
    """Parse a seed; a type for ``add_argument``.

    Raises
    ------
    ArgumentTypeError
        If it is negative, or no whole number.
    """
    value = _whole(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"must not be negative, got {value}")
    return value


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a whole number, got {text!r}") from None
