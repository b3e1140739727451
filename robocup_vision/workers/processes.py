"""Processes of this machine that share one piece of work, and end at once when it is interrupted or killed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

T = TypeVar("T")

# a worker that has not ended so long after it was asked to is killed
_END_S = 0.5


@contextmanager
def worker_processes(
    jobs: int, initializer: Callable[..., object] | None = None, initargs: tuple[Any, ...] = ()
) -> Iterator[Executor]:
    """Yield an executor over processes of this machine.

    They do not hear an interrupt (Ctrl-C), which is for the process that hands out the work. Where the block fails or
    is interrupted they are ended in the middle of what they do; else what was submitted is finished. They end as well
    when this process is killed, which leaves nobody to tell them.

    Parameters
    ----------
    jobs : int
        Largest number of processes.
    initializer, initargs
        What each calls first.
    """
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


class _Processes(ProcessPoolExecutor):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._started: set[Any] = set()

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        before = set(multiprocessing.active_children())
        can_block = hasattr(signal, "pthread_sigmask")
        # a process inherits which signals are blocked: from its first moment on, while it imports, too
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,)) if can_block else ()
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            self._started |= set(multiprocessing.active_children()) - before
            if can_block:
                signal.pthread_sigmask(signal.SIG_SETMASK, blocked)

    def end(self) -> None:
        """End the processes without waiting for what they do."""
        results = getattr(self, "_result_queue", None)
        self.shutdown(wait=False, cancel_futures=True)
        for process in self._started:
            process.terminate()
        for process in self._started:
            process.join(_END_S)
            if process.is_alive():
                process.kill()
        # a process that ended while it wrote a result leaves half of it: the executor's thread would wait for the rest
        # for ever, and this process for that thread
        writer = getattr(results, "_writer", None)
        if writer is not None and not writer.closed:
            writer.close()
