"""Hands the pieces of a run to workers, a bounded number at a time, and repeats what is lost with a worker.

Pieces and results need not all fit into memory: pieces are taken from an iterator when workers become free, and results
are yielded as they arrive. The result of a piece must not depend on the worker.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

from field_models.errors import ArgumentError, RobocupVisionError

P = TypeVar("P")
R = TypeVar("R")

Start = Callable[[], Callable[[P], R]]

# number of times in a row that all workers may be lost before any piece is finished
_BARREN_ROUNDS = 3
# batches handed out per worker: one in work, one ready, and two because batches take unequally long
_AHEAD = 4
# period at which the workers are checked while none of them finishes anything
_LOOK_AFTER_S = 5.0


@dataclass(frozen=True)
class Pool:
    """Workers that are ready."""

    executor: Executor  #: hands out calls
    do: Callable[[list[Any]], list[Any]]  #: function to call: ``do(batch)`` returns a list with each piece's result
    #: returns the present number of batches that are processed at a time; 0 if `submit` processes a batch at once
    slots: Callable[[], int]
    #: called periodically while nothing is finished; raises `RobocupVisionError` if nothing will be
    look_after: Callable[[], None] = lambda: None


@dataclass(frozen=True)
class Workers:
    """How to open a pool of workers."""

    #: ``open_pool(start)`` returns a context manager of a `Pool`; called again when workers were lost
    open_pool: Callable[[Start[Any, Any]], AbstractContextManager[Pool]]
    #: exceptions with which a batch fails when its worker was lost
    losses: tuple[type[BaseException], ...] = (BrokenExecutor, CancelledError)
    is_here: bool = False  #: whether this process does all the work
    share_files: bool = True  #: whether the workers read the files that this process reads


def run_pieces(
    start: Start[P, R],
    pieces: Iterable[P],
    workers: Workers,
    *,
    batch: int = 1,
    describe: Callable[[P], str] = str,
) -> Generator[tuple[int, R], None, None]:
    """Process pieces, and yield the number and the result of each in the order in which they are finished.

    Close the generator, as `contextlib.closing` does, to end the work early.

    Parameters
    ----------
    start : callable
        Called once per worker, without arguments; returns the function that turns a piece into its result. For other
        processes it is pickled, as are the pieces and the results.
    pieces : iterable
        Read only a bounded number ahead of the oldest unfinished piece.
    batch : int
        Number of pieces handed out together; several if each takes only some milliseconds.
    describe : callable
        Returns a name for a piece, for the error message about one that ends its workers.

    Raises
    ------
    ArgumentError
        If `batch` is not positive, or `workers` is not a `Workers`.
    RobocupVisionError
        If all workers are lost repeatedly before they finish anything, or there are none.
    Exception
        Exceptions of a piece.
    """
    if not isinstance(workers, Workers):
        raise ArgumentError(f"workers must be what find_workers(jobs) returns, got {type(workers).__name__}")
    if batch < 1:
        raise ArgumentError(f"batch must be at least 1, got {batch}")
    taken = iter(pieces)
    batches = enumerate(iter(lambda: list(islice(taken, batch)), []))
    # unfinished batches by number, the oldest first
    missing: dict[int, list[P]] = {}
    has_more, ahead, barren = True, 0, 0
    while has_more or missing:
        is_barren = True
        with workers.open_pool(start) as pool:
            futures: dict[Future[list[R]], int] = {}

            def hand_out(
                number: int, one: list[P], pool: Pool = pool, futures: dict[Future[list[R]], int] = futures
            ) -> bool:
                try:
                    futures[pool.executor.submit(pool.do, one)] = number
                except workers.losses:
                    return False
                return True

            is_whole = all(hand_out(number, one) for number, one in missing.items())
            while True:
                while is_whole and has_more and (not missing or ahead - next(iter(missing)) < _AHEAD * pool.slots()):
                    number, one = next(batches, (ahead, []))
                    has_more = bool(one)
                    if has_more:
                        missing[number] = one
                        ahead = number + 1
                        is_whole = hand_out(number, one)
                if not futures:
                    break
                done = wait(futures, timeout=_LOOK_AFTER_S, return_when=FIRST_COMPLETED).done
                if not done:
                    pool.look_after()
                for future in sorted(done, key=futures.__getitem__):
                    number = futures.pop(future)
                    try:
                        results = future.result()
                    except workers.losses:
                        is_whole = False
                        continue
                    del missing[number]
                    is_barren = False
                    yield from enumerate(results, start=number * batch)
        barren = barren + 1 if is_barren else 0
        if missing and barren == _BARREN_ROUNDS:
            oldest = describe(next(iter(missing.values()))[0])
            raise RobocupVisionError(
                f"{oldest} is not done: {_BARREN_ROUNDS} times all workers ended before they finished anything "
                "(a crash, or too little memory?)"
            )


def in_order(results: Generator[tuple[int, R], None, None]) -> Generator[R, None, None]:
    """Yield the results of `run_pieces` in the order of the pieces; only those that wait for an older one are kept."""
    ahead: dict[int, R] = {}
    due = 0
    with closing(results):
        for number, result in results:
            ahead[number] = result
            while due in ahead:
                yield ahead.pop(due)
                due += 1
