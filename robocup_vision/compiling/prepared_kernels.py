"""Compiles, or loads from the disk's cache, all loops that an object's calls can reach, so that no call waits for it.

numba compiles a loop when it is first called with arguments of some types. `signatures.json` beside the kernels lists
those types for each kind of object, loops that take long to compile first; ``python tests/kernel_workloads.py`` writes
it.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import os
import subprocess
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import IO, Any

from robocup_vision.compiling.compile_cache import note_ready

KERNELS = "robocup_vision.kernels"


def prepare_kernel(kernel: str, arguments: list[Any]) -> bool:
    """Compile or load one loop, as `groups` lists it; return whether it had to be compiled."""
    return _prepared(kernel, json.dumps(arguments))


@cache
def _prepared(kernel: str, arguments: str) -> bool:
    module, _, name = kernel.rpartition(".")
    dispatcher = getattr(import_module(f"{KERNELS}.{module}"), name)
    missed = sum(dispatcher.stats.cache_misses.values())
    dispatcher.compile(tuple(_type_of(argument) for argument in json.loads(arguments)))
    return bool(sum(dispatcher.stats.cache_misses.values()) > missed)


def _type_of(spelled: Any) -> Any:
    types: Any = import_module("numba.types")
    if isinstance(spelled, str):
        return getattr(types, spelled)
    kind, *rest = spelled
    if kind == "array":
        dtype, dimensions, layout, is_mutable = rest
        return types.Array(_type_of(dtype), dimensions, layout, readonly=not is_mutable)
    if kind == "omitted":
        return types.Omitted(rest[0])
    if kind == "tuple":
        return types.BaseTuple.from_types(tuple(_type_of(field) for field in rest[0]))
    module, _, name = kind.partition(":")
    return types.BaseTuple.from_types(tuple(_type_of(field) for field in rest[0]), getattr(import_module(module), name))


def spelled_type(numba_type: Any) -> Any:
    """Spell a type of numba as JSON values.

    Raises
    ------
    TypeError
        If it is none of those that our loops take.
    """
    types: Any = import_module("numba.types")
    if isinstance(numba_type, types.Array) and numba_type.aligned:
        return ["array", spelled_type(numba_type.dtype), numba_type.ndim, numba_type.layout, numba_type.mutable]
    if isinstance(numba_type, types.Omitted):
        return ["omitted", numba_type.value]
    if isinstance(numba_type, types.BaseNamedTuple):
        of = numba_type.instance_class
        return [f"{of.__module__}:{of.__qualname__}", [spelled_type(field) for field in numba_type]]
    if isinstance(numba_type, types.BaseTuple):
        return ["tuple", [spelled_type(field) for field in numba_type]]
    name = {"bool": "boolean"}.get(str(numba_type), str(numba_type))
    if getattr(types, name, None) == numba_type:
        return name
    raise TypeError(f"a loop takes an argument of a type that cannot be listed: {numba_type!r}")


@contextmanager
def quick_compiling() -> Iterator[None]:
    """Compile in less time: optimise as LLVM's ``-O2`` does, and look for garbage seldom.

    What ``-O3`` does beyond costs a tenth of the processor time, and frames take as long without it; a level that the
    environment variable ``NUMBA_OPT`` names stays. numba makes so many objects that Python's search for garbage takes a
    tenth too.
    """
    config: Any = import_module("numba.core.config")
    thresholds, level = gc.get_threshold(), config.OPT
    gc.set_threshold(50_000, 20, 100)
    if "NUMBA_OPT" not in os.environ:
        config.OPT = type(level)(2)
    try:
        yield
    finally:
        config.OPT = level
        gc.set_threshold(*thresholds)


SIGNATURES = Path(__file__).parents[1] / "kernels" / "signatures.json"


@cache
def prepare(group: str) -> None:
    """Compile or load the loops of one kind of object; a group that is not listed has none.

    Parameters
    ----------
    group : str
        Name in `groups`, such as ``mirror_field`` or ``steering``.
    """
    entries = _listed().get(group, [])
    # the shortest first, as one that is not in the cache says that a second process is of use; that takes the longest
    waiting = deque(entries)
    with quick_compiling(), ExitStack() as beside:
        is_alone = True
        for entry in _from_the_end(waiting):
            note_ready(len(entries) - len(waiting) - 1, len(entries))
            if prepare_kernel(*entry) and is_alone:
                beside.enter_context(second_process(waiting))
                is_alone = False
    with quick_compiling():
        for kernel, arguments in entries:
            prepare_kernel(kernel, arguments)
    note_ready(len(entries), len(entries))


def _from_the_end(waiting: deque[Entry]) -> Iterator[Entry]:
    while True:
        try:
            yield waiting.pop()
        except IndexError:  # the second process may take the last one
            return


def groups() -> dict[str, list[tuple[str, list[Any]]]]:
    """Return for each kind of object the loops that its calls reach: module and name, and types of the arguments."""
    return dict(_listed())


def modules() -> dict[str, list[tuple[str, list[Any]]]]:
    """Return what `groups` lists, each entry once, by the module that it stands in; the longest modules first."""
    unique = {(kernel, json.dumps(arguments)) for entries in _listed().values() for kernel, arguments in entries}
    found: dict[str, list[tuple[str, list[Any]]]] = {}
    for kernel, arguments in sorted(unique):
        found.setdefault(kernel.rpartition(".")[0], []).append((kernel, json.loads(arguments)))
    return dict(sorted(found.items(), key=lambda item: -_length(item[0])))


def _length(module: str) -> int:
    return SIGNATURES.parent.joinpath(*module.split(".")).with_suffix(".py").stat().st_size


def prepare_module(module: str) -> None:
    """Compile or load the loops of one module, as `modules` lists them."""
    with quick_compiling():
        for kernel, arguments in modules()[module]:
            prepare_kernel(kernel, arguments)


@cache
def _listed() -> dict[str, list[tuple[str, list[Any]]]]:
    listed = json.loads(SIGNATURES.read_text(encoding="utf-8"))
    return {group: [(kernel, arguments) for kernel, arguments in entries] for group, entries in listed.items()}


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
