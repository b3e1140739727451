"""Option types of the commands (a count, a seed, an angle), and the options that choose the workers of a run.

Invalid values are refused (`ArgumentTypeError`) while the command line is parsed, before a file is read. This module
loads nothing of the library, so that --help answers at once.
"""

from __future__ import annotations

import argparse
import math
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robocup_vision.workers import Workers

# without this, argparse takes -15deg for an option
NEGATIVE_ANGLE = re.compile(r"^-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?(deg|rad)?$")


def count(text: str) -> int:
    """Parse a number of things, at least 1; a type for ``add_argument``, like the functions below."""
    value = _whole(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, got {value}")
    return value


def seed(text: str) -> int:
    """Parse a seed, which is not negative."""
    value = _whole(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"must not be negative, got {value}")
    return value


def angle(text: str) -> float:
    """Parse an angle in radians (at most a turn), or in degrees with "deg" behind the number; return radians."""
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
    """Parse the size of images, such as 640x480."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"must be width and height in pixels, such as 640x480, got {text!r}")
    return int(width), int(height)


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a whole number, got {text!r}") from None


def add_worker_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--jobs`` and ``--dask`` to a command's parser."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--jobs", type=count, default=1, metavar="N", help="processes on this machine (default: 1)")
    where.add_argument(
        "--dask", metavar="ADDRESS", help="scheduler of a dask.distributed cluster, e.g. tcp://host:8786"
    )


def chosen_workers(options: argparse.Namespace) -> Workers:
    """Return the workers chosen by the options."""
    from robocup_vision.workers import find_workers

    return find_workers(options.jobs, options.dask)
