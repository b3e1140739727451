"""Decorators for the functions that are compiled to machine code, so that all are compiled in the same way.

Loops are cached on the disk and run without the interpreter's lock. numba's wrapper for callers in C is omitted: it is
not used, and takes a tenth of the compilation time.
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

# LLVM's option for the number of address comparisons before a vectorised loop, and its default
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
    """Compile a function when it is first called with arguments of new types; a decorator with or without options.

    Parameters
    ----------
    function : callable
        The function; omitted if options are given.
    error_model : str
        With ``numpy`` a division by zero gives infinity, with ``python`` it raises.
    fastmath : bool or set of str
        Permissions to reorder arithmetic, by LLVM's names; all of them if True.
    inline : str
        With ``always`` each call is replaced by the function's body.
    """
    options = {"error_model": error_model, "fastmath": fastmath, "inline": inline}
    make_loop = cast(Any, njit)(cache=True, nogil=True, no_cfunc_wrapper=True, **options)

    def decorator(function: Any) -> Any:
        loop = make_loop(function)
        _keep_by_digest(loop)
        if fastmath:
            # without fastmath every path rounds in the same way
            loop.compile = _on_one_path(loop.compile)
        return loop

    return decorator if function is None else decorator(function)


def _keep_by_digest(loop: Any) -> None:
    """Make numba check cached loops by `source_digest` instead of the modification time of the loop's file.

    It is also part of the version, which is compared before cached types are read, because their classes may be gone.
    """
    kept: Any = getattr(getattr(loop, "_cache", None), "_cache_file", None)
    digest = source_digest(loop.py_func.__module__)
    if digest is not None and hasattr(kept, "_source_stamp"):
        kept._source_stamp = digest
        kept._version = f"{kept._version}, {digest}"


def _on_one_path(compile_loop: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function that compiles a loop so that rounding does not depend on where its arrays are in memory.

    LLVM's vectorised loops compare addresses at run time, and take another path if two small arrays are close together.
    If arithmetic may be reordered, that path rounds differently: the same frame would give estimates that differ in the
    last bits from call to call. Loops that do not need such comparisons are still vectorised. The option applies to the
    whole process, so it is set only while one of our loops is compiled.
    """

    def compile_alike(types: Any) -> Any:
        global _compiling
        with global_compiler_lock:
            # calls may be nested: a loop is compiled during the compilation of one that calls it
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
    """Convert a named tuple, and those in it, to plain tuples, for a loop that names them again (``Rules(*rules)``).

    Passing a plain tuple takes a fifth of the time, because for a named one each class is looked up at each call.
    """
    return cast(Values, tuple(plain(value) if isinstance(value, tuple) else value for value in values))


@compiled(inline="always")
def variable(value: int) -> int:
    """Return an integer as a variable of a loop; a loop that is called with a literal is compiled again for it."""
    return int(np.int64(value))


@compiled(inline="always")
def flag(value: bool) -> bool:
    """Return a truth value as a variable of a loop; see `variable`."""
    return bool(np.int64(value) != 0)
