"""Hands the pieces of a run to workers, a bounded number at a time, and does again what is lost with a worker.

Neither the pieces nor the results are ever all in memory: pieces are taken from an iterator as workers get free, and
results go to the caller as they come. The result of a piece must not depend on which worker finds it.
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

# times in a row that all workers may be lost before one of them finishes anything
_BARREN_ROUNDS = 3
# batches handed out for each worker: one in work, one ready, and two against batches that take unequally long
_AHEAD = 4
# seconds after which the workers are looked after while none of them finishes anything
_LOOK_AFTER_S = 5.0


@dataclass(frozen=True)
class Pool:
    """Workers that are ready."""

    executor: Executor  #: hands out calls
    do: Callable[[list[Any]], list[Any]]  #: what it calls: ``do(batch)`` returns a list with the result of each piece
    #: returns how many batches are worked on at a time, now; 0 where a batch is done as it is handed out
    slots: Callable[[], int]
    #: called now and then while nothing is finished; raises `RobocupVisionError` where nothing will be
    look_after: Callable[[], None] = lambda: None


@dataclass(frozen=True)
class Workers:
    """Where pieces are worked on."""

    #: ``open_pool(start)`` returns a context manager of a `Pool`; called anew when workers were lost
    open_pool: Callable[[Start[Any, Any]], AbstractContextManager[Pool]]
    #: what a batch fails with when its worker was lost
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
    """Work on pieces, yielding the number of each and its result, in the order they end.

    Close the generator, as `contextlib.closing` does, to end the work early.

    Parameters
    ----------
    start : callable
        Called once a worker, without arguments: returns the function that turns a piece into its result. For other
        processes it, the pieces and the results are pickled.
    pieces : iterable
        Taken only a bounded number ahead of the oldest piece that is not finished.
    batch : int
        Pieces handed out together: several where each takes only some milliseconds.
    describe : callable
        Names a piece, for the message about one that ends its workers.

    Raises
    ------
    ArgumentError
        If `batch` is not positive, or `workers` are none.
    RobocupVisionError
        If workers are lost again and again before they finish anything, or there are none.
    Exception
        What a piece raises.
    """
    if not isinstance(workers, Workers):
        raise ArgumentError(f"workers must be what find_workers(jobs) returns, got {type(workers).__name__}")
    if batch < 1:
        raise ArgumentError(f"batch must be at least 1, got {batch}")
    taken = iter(pieces)
    batches = enumerate(iter(lambda: list(islice(taken, batch)), []))
    # by number: those that are not finished, the oldest first
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
    """Yield what `run_pieces` does in the order of the pieces; only results that wait for an older one are kept."""
    ahead: dict[int, R] = {}
    due = 0
    with closing(results):
        for number, result in results:
            ahead[number] = result
            while due in ahead:
                yield ahead.pop(due)
                due += 1
