"""Places where pieces are processed: this process, other processes of this machine, a dask cluster."""

from __future__ import annotations

import numbers
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any, TypeVar

from field_models.errors import ArgumentError
from robocup_vision.workers.pieces import Pool, Start, Workers
from robocup_vision.workers.processes import Doer, only_one_opencv_thread, worker_processes

T = TypeVar("T")

# largest number of processes; each needs some hundred megabytes for the library
_MAX_JOBS = 1024


def find_workers(jobs: int, dask: str | None = None) -> Workers:
    """Return the workers chosen by the options ``--jobs`` and ``--dask``; a single job runs in this process.

    Raises
    ------
    ArgumentError
        If `jobs` is not positive, dask.distributed is not installed, or no scheduler answers.
    """
    if dask is not None:
        return dask_workers(dask)
    return this_process() if jobs == 1 else local_workers(jobs)


def this_process() -> Workers:
    """Return this process as the only worker."""
    return Workers(_open_here, (), is_here=True)


def local_workers(jobs: int) -> Workers:
    """Return `jobs` processes of this machine as workers.

    Raises
    ------
    ArgumentError
        If `jobs` is not a whole number, 1 to 1024.
    """
    if not isinstance(jobs, numbers.Integral) or isinstance(jobs, bool):
        raise ArgumentError(f"jobs must be a whole number, got {type(jobs).__name__} {jobs!r}")
    if jobs < 1:
        raise ArgumentError(f"jobs must be at least 1, got {jobs}")
    if jobs > _MAX_JOBS:
        raise ArgumentError(f"jobs must be at most {_MAX_JOBS}, got {jobs}")

    @contextmanager
    def open_pool(start: Start[Any, Any]) -> Iterator[Pool]:
        with worker_processes(jobs, _begin, (start,)) as executor:
            yield Pool(executor, _do, lambda: jobs)

    return Workers(open_pool)


def dask_workers(address: str) -> Workers:
    """Return the workers of a dask.distributed cluster (extra `distributed`).

    Parameters
    ----------
    address : str
        Address of its scheduler, such as ``tcp://10.0.0.1:8786``. Its workers need the same version of this package.

    Raises
    ------
    ArgumentError
        If dask.distributed is not installed, or no scheduler answers.
    """
    if find_spec("distributed") is None:
        raise ArgumentError("dask.distributed is not installed (pip install 'robocup-vision[distributed]')")
    from robocup_vision.workers.cluster import cluster_workers

    return cluster_workers(address)


class _InlineExecutor(Executor):
    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@contextmanager
def _open_here(start: Start[Any, Any]) -> Iterator[Pool]:
    yield Pool(_InlineExecutor(), Doer(start), lambda: 0)


# one per process, made by the initialiser
_doer: Doer | None = None


def _begin(start: Start[Any, Any]) -> None:
    global _doer
    only_one_opencv_thread()
    _doer = Doer(start)


def _do(batch: list[Any]) -> list[Any]:
    assert _doer is not None
    return _doer(batch)
