"""Processes the pieces of a run, in the same way in this process, several processes or on a dask cluster."""

from robocup_vision.workers.pieces import Pool, Workers, in_order, run_pieces
from robocup_vision.workers.places import dask_workers, find_workers, local_workers, this_process
from robocup_vision.workers.processes import worker_processes

__all__ = [
    "Pool",
    "Workers",
    "dask_workers",
    "find_workers",
    "in_order",
    "local_workers",
    "run_pieces",
    "this_process",
    "worker_processes",
]
