"""Compiles all loops that an object's calls can reach, or loads them from the disk's cache, so that no call waits.

numba compiles a loop when it is first called with arguments of certain types. `signatures.json` beside a package's
kernels lists those types for each kind of object; ``python tests/kernel_workloads.py`` writes it.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from importlib.resources import files
from typing import Any

# a loop, by its module and name, and the types of its arguments
Entry = tuple[str, list[Any]]


def prepare_kernel(kernel: str, arguments: list[Any]) -> bool:
    """Compile or load one loop, as `groups` lists it; return whether it had to be compiled."""
    module, _, name = kernel.rpartition(".")
    dispatcher = getattr(import_module(module), name)
    missed = sum(dispatcher.stats.cache_misses.values())
    dispatcher.compile(tuple(_type_of(argument) for argument in arguments))
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
    """Express a type of numba as JSON values.

    Raises
    ------
    TypeError
        If the type is not one of those that our loops take.
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
    """Compile in less time: with the optimisations of LLVM's ``-O2``, and less frequent garbage collection.

    ``-O3`` takes a tenth more processor time, but does not make frames faster; a level set in the environment variable
    ``NUMBA_OPT`` is kept. numba makes so many objects that garbage collection takes another tenth.
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


def groups(package: str = "robocup_vision") -> dict[str, list[Entry]]:
    """Return the loops that the calls of each kind of object in a package reach; empty if the package has no list."""
    listed = files(package) / "kernels" / "signatures.json"
    found = json.loads(listed.read_text(encoding="utf-8")) if listed.is_file() else {}
    return {
        group: [(f"{package}.kernels.{kernel}", arguments) for kernel, arguments in entries]
        for group, entries in found.items()
    }


def modules(packages: Iterable[str]) -> list[list[Entry]]:
    """Return the entries of `groups` for some packages, each once, in a list for each module, the longest first."""
    unique = {
        (kernel, json.dumps(arguments))
        for package in packages
        for entries in groups(package).values()
        for kernel, arguments in entries
    }
    found: dict[str, list[Entry]] = {}
    for kernel, arguments in sorted(unique):
        found.setdefault(kernel.rpartition(".")[0], []).append((kernel, json.loads(arguments)))
    return sorted(found.values(), key=len, reverse=True)


def prepare_loops(entries: Iterable[Entry]) -> None:
    """Compile or load some loops."""
    with quick_compiling():
        for entry in entries:
            prepare_kernel(*entry)


@cache
def prepare(group: str, package: str = "robocup_vision") -> None:
    """Compile or load the loops of one kind of object, such as ``mirror_field``; a group that is not listed has none.

    When the first loop had to be compiled, a second process begins to compile the same list from its other end. Each
    process finds the results of the other in the cache.
    """
    other = None
    try:
        with quick_compiling():
            for entry in reversed(groups(package).get(group, [])):
                if prepare_kernel(*entry) and other is None:
                    other = _second_process(group, package)
    finally:
        if other is not None:
            other.kill()
            other.wait()


def _second_process(group: str, package: str) -> subprocess.Popen[bytes] | None:
    """Start a process that compiles a group from its beginning; None in a worker process, or if that fails."""
    if multiprocessing.parent_process() is None:
        command, silent = [sys.executable, "-m", __name__, group, package], subprocess.DEVNULL
        with suppress(OSError):
            return subprocess.Popen(command, stdin=silent, stdout=silent, stderr=silent)
    return None


if __name__ == "__main__":
    prepare_loops(groups(sys.argv[2])[sys.argv[1]])
