"""Decorates the functions that are compiled to machine code, so that all of them are compiled in the same way.

Loops are kept in the cache on the disk and run without the interpreter's lock. numba's entry for callers in C is left
out: nobody uses it, and making it takes a tenth of the time of compiling.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast, overload

import numpy as np
from numba import njit

Loop = TypeVar("Loop", bound=Callable[..., Any])
Values = TypeVar("Values", bound=tuple[Any, ...])


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
    decorator = cast(Any, njit)(cache=True, nogil=True, no_cfunc_wrapper=True, **options)
    return decorator if function is None else decorator(function)


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
