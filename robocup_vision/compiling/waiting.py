"""Tells once, when the first loop is compiled, what a program waits for.

The logger ``robocup_vision`` tells it as a warning, so that a program without any logging shows the line on standard
error, and one with its own shows or silences it as it does others. At a terminal a bar follows.
"""

from __future__ import annotations

import logging
import multiprocessing
import sys
from pathlib import Path
from typing import Any

from numba.core.event import Listener, register

from robocup_vision.progress import draw

_LOG = logging.getLogger("robocup_vision")


class _Wait(Listener):
    """Hears numba compile, which it tells when a loop is in no cache."""

    def __init__(self) -> None:
        self.folders: set[Path] = set()
        self.is_told = False
        self.ready, self.total = 0, 0

    def on_start(self, event: Any) -> None:
        source = Path(event.data["dispatcher"].py_func.__code__.co_filename)
        if self.is_told or not any(folder in source.parents for folder in self.folders):
            return
        self.is_told = True
        # whoever started this worker tells it
        if multiprocessing.parent_process() is None:
            done = f"{self.ready} of {self.total} loops are ready, " if self.total else ""
            _LOG.warning(
                "robocup_vision compiles for this machine, once: %sthe others take up to some minutes "
                "(`robocup-vision warm-up` or a compiled wheel does it ahead)",
                done,
            )

    def on_end(self, event: Any) -> None:
        pass


_wait = _Wait()


def tell_of_compiling(kernels: Path) -> None:
    """Tell when the first loop of a folder, or of those below it, is compiled."""
    if not _wait.folders:
        register("numba:compile", _wait)  # type: ignore[no-untyped-call]
    _wait.folders.add(kernels)


def note_ready(ready: int, total: int) -> None:
    """Note how many of the loops that are being made ready are so; draw it at a terminal, once some are compiled."""
    _wait.ready, _wait.total = ready, total
    if _wait.is_told and ready <= total and sys.stderr.isatty() and multiprocessing.parent_process() is None:
        draw("compiling", ready, total)
        if ready == total:
            sys.stderr.write("\n")
