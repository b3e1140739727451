"""Decorates the functions that are compiled to machine code, so that all of them are compiled in the same way.

Loops are kept in the cache on the disk and run without the interpreter's lock. numba's entry for callers in C is left
out: nobody uses it, and making it takes a tenth of the time of compiling.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast, overload

import numpy as np
from llvmlite.binding import set_option
from numba import njit
from numba.core.compiler_lock import global_compiler_lock

from robocup_vision.compiling.compile_cache import source_digest

Loop = TypeVar("Loop", bound=Callable[..., Any])
Values = TypeVar("Values", bound=tuple[Any, ...])

# LLVM's option, how many comparisons of addresses a vectorised loop may begin with, and its default
_COMPARISONS, _LLVMS_COMPARISONS = "-vectorize-memory-check-threshold", 128
_compiling = 0


@overload
def compiled(function: Loop) -> Loop: ...
@overload
def compiled(
    *, error_model: str = "python", fastmath: bool | set[str] = False, inline: str = "never"
) -> Callable[[Loop], Loop]: ...


def compiled(
    function: Any = None, *, error_model: str = "python", fastmath: bool | set[str] = False, inline: str = "never"
) -> Any:
    """Compile a function when it is first called with arguments of some types; a decorator, with options or without.

    Parameters
    ----------
    function : callable
        What is compiled; left out where options are given.
    error_model : str
        ``numpy`` divides by zero to infinity, ``python`` raises.
    fastmath : bool or set of str
        Permissions to reorder arithmetic, by LLVM's names; all of them if True.
    inline : str
        ``always`` puts the function's body in the place of each call.
    """
    options = {"error_model": error_model, "fastmath": fastmath, "inline": inline}
    make_loop = cast(Any, njit)(cache=True, nogil=True, no_cfunc_wrapper=True, **options)

    def decorator(function: Any) -> Any:
        loop = make_loop(function)
        _keep_by_digest(loop)
        if fastmath:
            # of the other loops, every path rounds alike
            loop.compile = _on_one_path(loop.compile)
        return loop

    return decorator if function is None else decorator(function)


def _keep_by_digest(loop: Any) -> None:
    """Let numba tell by `source_digest` whether a kept loop is of today's sources: it asks for its own file's time.

    The version is compared before the types of kept loops are read: they may name classes that are no more.
    """
    kept: Any = getattr(getattr(loop, "_cache", None), "_cache_file", None)
    digest = source_digest(loop.py_func.__module__)
    if digest is not None and hasattr(kept, "_source_stamp"):
        kept._source_stamp = digest
        kept._version = f"{kept._version}, {digest}"


def _on_one_path(compile_loop: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return what compiles a loop so that it rounds alike wherever in memory its arrays lie.

    LLVM's vectorised loops compare addresses at run time, and take another path where two small arrays lie close
    together. Where arithmetic may be reordered, that path rounds otherwise: the same frame would then give another
    estimate, in its last bits, from one call to the next. Loops that need no such comparison are vectorised as ever.
    The option is of the whole process, so it is set only while a loop of ours is compiled.
    """

    def compile_alike(types: Any) -> Any:
        global _compiling
        with global_compiler_lock:
            # a loop is compiled while another one that calls it is
            _compiling += 1
            if _compiling == 1:
                set_option("", f"{_COMPARISONS}=0")
            try:
                return compile_loop(types)
            finally:
                _compiling -= 1
                if _compiling == 0:
                    set_option("", f"{_COMPARISONS}={_LLVMS_COMPARISONS}")

    return compile_alike


def plain(values: Values) -> Values:
    """Return a named tuple, and those in it, as plain ones, for a loop that names them again (``Rules(*rules)``).

    A plain tuple takes a fifth of the time to hand over: of a named one each class is looked up at each call.
    """
    return cast(Values, tuple(plain(value) if isinstance(value, tuple) else value for value in values))


@compiled(inline="always")
def variable(value: int) -> int:
    """Return a whole number as a variable of a loop; called with a literal, a loop is compiled once more for it."""
    return int(np.int64(value))


@compiled(inline="always")
def flag(value: bool) -> bool:
    """Return a truth value as a variable of a loop; see `variable`."""
    return bool(np.int64(value) != 0)
