"""Runs the pieces of a benchmark in processes of this machine, or on the workers of a dask cluster."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from benchmarks.harness.programs import ROOT
from robocup_vision.commands.options import add_worker_options
from robocup_vision.workers import Pool as Opened
from robocup_vision.workers import Workers, find_workers, in_order, run_pieces

P = TypeVar("P")
R = TypeVar("R")


def add_pool_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--jobs``, of which `open_pool` decides unless it is given, and ``--dask``."""
    add_worker_options(parser)
    parser.set_defaults(jobs=None)


class Pool:
    """Workers that stay for several rounds of pieces.

    Parameters
    ----------
    workers : Workers
        Who works.
    stack : ExitStack
        Ends them.
    """

    def __init__(self, workers: Workers, stack: ExitStack) -> None:
        self._workers, self._stack = workers, stack
        self._opened: Opened | None = None

    def map(self, function: Callable[[P], R], pieces: Iterable[P], chunksize: int = 1) -> Iterator[R]:
        """Yield the result of each piece, in order; a piece whose worker dies is done again."""
        called = function if self._workers.share_files else _importable(function)
        is_first = True

        @contextmanager
        def open_pool(start: Callable[[], Any]) -> Iterator[Opened]:
            nonlocal is_first
            if self._opened is None or not is_first:
                self._stack.close()
                self._opened = self._stack.enter_context(self._workers.open_pool(start))
            is_first = False
            yield self._opened

        calls = (partial(called, piece) for piece in pieces)
        with closing(
            in_order(run_pieces(_caller, calls, replace(self._workers, open_pool=open_pool), batch=chunksize))
        ) as done:
            yield from done


def _caller() -> Callable[[Callable[[], Any]], Any]:
    return _call


def _call(piece: Callable[[], Any]) -> Any:
    return piece()


def _importable(function: Callable[[P], R]) -> Callable[[P], R]:
    """Return a function of the program that runs as one of its module, which the workers of a cluster import."""
    if function.__module__ != "__main__":
        return function
    path = Path(sys.argv[0]).resolve().relative_to(ROOT).with_suffix("")
    found: Callable[[P], R] = getattr(import_module(".".join(path.parts)), function.__qualname__)
    return found


@contextmanager
def open_pool(arguments: argparse.Namespace) -> Iterator[Pool]:
    """Yield the pool that a program's options name: unless they do, all processors, or this process in quick size.

    A process takes longer to load the library than the pieces of a quick run do.
    """
    jobs = arguments.jobs or (1 if arguments.quick else os.cpu_count() or 1)
    with ExitStack() as stack:
        yield Pool(find_workers(jobs, arguments.dask), stack)
