"""A progress bar for people at a terminal; silent everywhere else."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")

WIDTH = 30
SECONDS_BETWEEN_DRAWINGS = 0.1


def progress(iterable: Iterable[T], total: int, label: str) -> Iterator[T]:
    """Yield the items of `iterable`; while stderr is a terminal, draw there how many of `total` are done."""
    if not sys.stderr.isatty():
        yield from iterable
        return
    drawn_s = 0.0
    for done, item in enumerate(iterable, start=1):
        yield item
        now_s = time.monotonic()
        if done >= total or now_s - drawn_s >= SECONDS_BETWEEN_DRAWINGS:
            drawn_s = now_s
            filled = WIDTH * min(done, total) // max(total, 1)
            sys.stderr.write(f"\r{label} [{'#' * filled}{'.' * (WIDTH - filled)}] {done}/{total}")
            sys.stderr.flush()
    sys.stderr.write("\n")
