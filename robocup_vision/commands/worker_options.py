"""The options that say who does the pieces of a run. Apart from what reads them, so that --help loads nothing."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from robocup_vision.commands.options import count

if TYPE_CHECKING:
    from robocup_vision.workers import Workers


def add_worker_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--jobs`` and ``--dask`` to a command's parser."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--jobs", type=count, default=1, metavar="N", help="processes on this machine (default: 1)")
    where.add_argument(
        "--dask", metavar="ADDRESS", help="scheduler of a dask.distributed cluster, e.g. tcp://host:8786"
    )


def chosen_workers(options: argparse.Namespace) -> Workers:
    """Return the workers that the options name.

    Raises
    ------
    ArgumentError
        If the number of processes is not positive, or dask.distributed is not installed.
    """
    from robocup_vision.workers import find_workers

    return find_workers(options.jobs, options.dask)
