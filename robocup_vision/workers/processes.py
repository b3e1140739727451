"""Processes of this machine that share the work of a run, and end at once when the run is interrupted or killed.

A worker is initialised once in each of its threads, then processes one piece after the other (`Doer`).
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, nullcontext
from typing import Any, TypeVar

from robocup_vision.workers.pieces import Start

_NO_MAIN_GUARD = (
    'a script whose own functions work in several processes must start them below `if __name__ == "__main__":`, as each'
    " process reads the script once more"
)
# module name in pickles of a script's own functions and classes
_MAIN = b"__main__"
# time after which a worker that was asked to end is killed
_END_S = 0.5


class Doer:
    """Processes batches of one run.

    Parameters
    ----------
    start : callable
        See `run_pieces`. It is called when a thread gets its first batch, so that an exception in it becomes that
        batch's error.
    """

    def __init__(self, start: Start[Any, Any]) -> None:
        self._start = start
        self._local = threading.local()

    def __call__(self, batch: list[Any]) -> list[Any]:
        """Return the result of each piece."""
        if not hasattr(self._local, "do"):
            self._local.do = self._start()
        return [self._local.do(piece) for piece in batch]


def only_one_opencv_thread() -> None:
    """Keep OpenCV from starting threads, because the workers already use all processors."""
    import cv2

    cv2.setNumThreads(0)


T = TypeVar("T")


@contextmanager
def worker_processes(
    jobs: int, initializer: Callable[..., object] | None = None, initargs: tuple[Any, ...] = ()
) -> Iterator[Executor]:
    """Yield an executor over processes of this machine.

    They ignore an interrupt (Ctrl-C), which is for the process that hands out the work. If the block fails or is
    interrupted they are ended at once; otherwise submitted calls are finished. They also end by themselves when this
    process is killed.

    Parameters
    ----------
    initializer, initargs
        Function that each process calls first, and its arguments.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        # this is a process being started, which runs the script again: one line instead of a traceback
        raise SystemExit(_NO_MAIN_GUARD)
    executor = _Processes(jobs, multiprocessing.get_context("spawn"), _begin, (initializer, initargs))
    try:
        yield executor
    except BaseException:
        executor.end()
        raise
    executor.shutdown()


def _begin(initializer: Callable[..., object] | None, initargs: tuple[Any, ...]) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if initializer is not None:
        initializer(*initargs)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _without_main() -> Iterator[None]:
    """In this block, start processes that do not run the program's script again, because they do not need it."""
    main: Any = sys.modules["__main__"]
    kept = {name: getattr(main, name) for name in ("__file__", "__spec__") if hasattr(main, name)}
    try:
        for name in kept:
            setattr(main, name, None)
        yield
    finally:
        for name, value in kept.items():
            setattr(main, name, value)


class _Processes(ProcessPoolExecutor):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        # function that each process calls first, and its arguments
        self._first = arguments[2:]
        self._started: set[Any] = set()
        self._needs_main: bool | None = None

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        if self._needs_main is None:
            self._needs_main = _MAIN in pickle.dumps((self._first, fn, args, kwargs))
        before = set(multiprocessing.active_children())
        can_block = hasattr(signal, "pthread_sigmask")
        # a new process inherits the blocked signals, so it ignores interrupts even while it imports
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,)) if can_block else ()
        try:
            with nullcontext() if self._needs_main else _without_main():
                return super().submit(fn, *args, **kwargs)
        finally:
            self._started |= set(multiprocessing.active_children()) - before
            if can_block:
                signal.pthread_sigmask(signal.SIG_SETMASK, blocked)

    def end(self) -> None:
        """End the processes without waiting for their calls."""
        results = getattr(self, "_result_queue", None)
        self.shutdown(wait=False, cancel_futures=True)
        for process in self._started:
            process.terminate()
        for process in self._started:
            process.join(_END_S)
            if process.is_alive():
                process.kill()
        # a process that ended while it wrote a result leaves half of it; the executor's thread would wait for the rest
        # for ever, and this process for that thread
        writer = getattr(results, "_writer", None)
        if writer is not None and not writer.closed:
            writer.close()
