"""Numbers that commands take: one rule and one wording wherever a count, a seed or an angle is asked for.

They are refused while the command line is parsed, before a file is read. Loads nothing, so that --help answers at once.
"""

from __future__ import annotations

import argparse
import math
import re

# argparse takes -15deg for an option otherwise
NEGATIVE_ANGLE = re.compile(r"^-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?(deg|rad)?$")


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


def angle(text: str) -> float:
    """Parse an angle, radians: a number of radians, or of degrees with "deg" behind it.

    Raises
    ------
    ArgumentTypeError
        If it is neither, or a number of radians that is more than a turn.
    """
    number, in_degrees = text.removesuffix("deg").removesuffix("rad"), text.endswith("deg")
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be an angle, such as -0.26 or -15deg, got {text!r}")
    if not in_degrees and abs(value) > math.tau:
        raise argparse.ArgumentTypeError(f"{text} is more than a turn of radians: {number}deg?")
    return math.radians(value) if in_degrees else value


def size(text: str) -> tuple[int, int]:
    """Parse the size of images, such as 640x480.

    Raises
    ------
    ArgumentTypeError
        If it is none.
    """
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"must be width and height in pixels, such as 640x480, got {text!r}")
    return int(width), int(height)


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a whole number, got {text!r}") from None
