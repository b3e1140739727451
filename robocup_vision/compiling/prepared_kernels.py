"""Compiles, or loads from the disk's cache, all loops that an object's calls can reach, so that no call waits for it.

numba compiles a loop when it is first called with arguments of some types. `signatures.json` beside the kernels lists
those types for each kind of object, loops that take long to compile first; ``python tests/kernel_workloads.py`` writes
it.
"""

from __future__ import annotations

import gc
import json
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from robocup_vision.compiling.second_process import Entry, second_process

KERNELS = "robocup_vision.kernels"
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
    with _seldom_collected(), ExitStack() as beside:
        is_alone = True
        for entry in _from_the_end(waiting):
            if prepare_kernel(*entry) and is_alone:
                beside.enter_context(second_process(waiting))
                is_alone = False
    with _seldom_collected():
        for kernel, arguments in entries:
            prepare_kernel(kernel, arguments)


def _from_the_end(waiting: deque[Entry]) -> Iterator[Entry]:
    while True:
        try:
            yield waiting.pop()
        except IndexError:  # the second process may take the last one
            return


@contextmanager
def _seldom_collected() -> Iterator[None]:
    """Look for garbage seldom: numba makes so many objects that Python's search takes a tenth of the time."""
    before = gc.get_threshold()
    gc.set_threshold(50_000, 20, 100)
    try:
        yield
    finally:
        gc.set_threshold(*before)


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
    with _seldom_collected():
        for kernel, arguments in modules()[module]:
            prepare_kernel(kernel, arguments)


@cache
def _listed() -> dict[str, list[tuple[str, list[Any]]]]:
    listed = json.loads(SIGNATURES.read_text(encoding="utf-8"))
    return {group: [(kernel, arguments) for kernel, arguments in entries] for group, entries in listed.items()}


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
