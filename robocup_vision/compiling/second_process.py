"""Compiles in a second process while this one compiles too: two cores halve the wait of a fresh installation.

What the second process compiles it leaves in the cache on the disk, where this one finds it.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import subprocess
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread
from typing import IO, Any

from robocup_vision.compiling.listed_loop import prepare_kernel, quick_compiling

Entry = tuple[str, list[Any]]


@contextmanager
def second_process(waiting: deque[Entry]) -> Iterator[None]:
    """Take entries from the front of a list while there are any, one at a time; leaving waits for the last of them.

    Does nothing on one core, in a worker process, and where no process can be started.

    Parameters
    ----------
    waiting : deque of (str, list)
        Loops and the types of their arguments, as `prepared_kernels.groups` gives them.
    """
    if _cores() < 2 or multiprocessing.parent_process() is not None:
        yield
        return
    command = [sys.executable, "-m", __name__]
    try:
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
    except OSError:
        yield
        return
    with process:
        thread = Thread(target=_hand_over, args=(waiting, process.stdin, process.stdout), daemon=True)
        thread.start()
        try:
            yield
        except BaseException:
            process.kill()
            raise
        finally:
            thread.join()


def _hand_over(waiting: deque[Entry], stdin: IO[str], stdout: IO[str]) -> None:
    try:
        while stdout.readline():  # one line when it is ready, and one for each entry
            stdin.write(json.dumps(waiting.popleft()) + "\n")
            stdin.flush()
    except (IndexError, OSError):
        pass  # none is left, or the process has ended: what it has not compiled is compiled here


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _main() -> None:
    print("ready", flush=True)
    with quick_compiling():
        for line in sys.stdin:
            prepare_kernel(*json.loads(line))
            print("done", flush=True)


if __name__ == "__main__":
    _main()
