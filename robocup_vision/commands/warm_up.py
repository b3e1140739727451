"""`robocup-vision warm-up`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any

from robocup_vision.commands.options import count


def add_parser(subparsers: Any) -> None:
    """Add the command `warm-up`."""
    parser = subparsers.add_parser(
        "warm-up",
        help="compile all loops now, so that no robot waits for them",
        description="Compile all loops of the library and the simulator and keep them on the disk (in the folder that "
        "NUMBA_CACHE_DIR names, if it is set), so that no later start waits for them: for boot scripts and container "
        "images.",
    )
    parser.add_argument("--jobs", metavar="N", type=count, default=2, help="number of processes (default: 2)")
    parser.add_argument(
        "--wheel",
        metavar="FILE",
        help="compile the loops of this wheel of the library, and write another one beside it that holds them: for "
        "robots with the same version of Python and numba and the same kind of processor as this machine",
    )
    parser.set_defaults(run=run_warm_up)


def run_warm_up(options: argparse.Namespace) -> int:
    """Compile all loops and print their number, or the path of the new wheel; return 0."""
    import time
    from concurrent.futures import as_completed
    from concurrent.futures.process import BrokenProcessPool
    from importlib.metadata import entry_points

    from field_models.errors import RobocupVisionError
    from robocup_vision.commands import GROUP
    from robocup_vision.compiling.prepared_kernels import modules, prepare_loops
    from robocup_vision.progress import progress
    from robocup_vision.workers import worker_processes

    if options.wheel is not None:
        from robocup_vision.compiling.compiled_wheel import compile_wheel

        print(compile_wheel(options.wheel, options.jobs))
        return 0
    start_s = time.monotonic()
    # packages that register commands have their own loops
    listed = modules({"robocup_vision", *(point.module.partition(".")[0] for point in entry_points(group=GROUP))})
    try:
        with worker_processes(options.jobs) as executor:
            waiting = [executor.submit(prepare_loops, entries) for entries in listed]
            for done in progress(as_completed(waiting), len(waiting), "warm-up"):
                done.result()
    except BrokenProcessPool:
        raise RobocupVisionError("a process ended abruptly; is there enough memory? Try --jobs 1") from None
    # if two processes write a loop's cache entry at the same time, one may be lost: here it is compiled again
    for entries in listed:
        prepare_loops(entries)
    count = sum(map(len, listed))
    print(f"{count} loops are ready, after {time.monotonic() - start_s:.0f} s")
    return 0
