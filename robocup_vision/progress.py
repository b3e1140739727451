"""A progress bar for people at a terminal; silent everywhere else."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")

WIDTH = 30
SECONDS_BETWEEN_DRAWINGS = 0.1


# progress of the latest loop in this process, for the last line of an interrupted command
_reached = ""


def reached() -> str:
    """Return the progress of the latest loop as ``label done/total``; empty before the first."""
    return _reached


def progress(iterable: Iterable[T], total: int, label: str) -> Iterator[T]:
    """Yield the items of `iterable`; if stderr is a terminal, draw a bar there with the number of finished items."""
    global _reached
    is_drawn = sys.stderr.isatty()
    drawn_s = 0.0
    _reached = f"{label} 0/{total}"
    for done, item in enumerate(iterable, start=1):
        yield item
        _reached = f"{label} {done}/{total}"
        if not is_drawn:
            continue
        now_s = time.monotonic()
        if done >= total or now_s - drawn_s >= SECONDS_BETWEEN_DRAWINGS:
            drawn_s = now_s
            draw(label, done, total)
    if is_drawn:
        sys.stderr.write("\n")


def draw(label: str, done: int, total: int) -> None:
    """Draw the bar in place of the previous one."""
    filled = WIDTH * min(done, total) // max(total, 1)
    sys.stderr.write(f"\r{label} [{'#' * filled}{'.' * (WIDTH - filled)}] {done}/{total}")
    sys.stderr.flush()
