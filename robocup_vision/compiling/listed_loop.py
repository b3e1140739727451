"""Compiles one loop for arguments of given types, spelled as JSON values."""

from __future__ import annotations

import gc
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any

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
