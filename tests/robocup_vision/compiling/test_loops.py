"""All loops are compiled by one decorator; a literal does not make a second version of a loop."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled, flag, plain, variable

ROOT = Path(__file__).parents[3]
KERNELS = sorted(path for package in ("robocup_vision", "sim2d") for path in (ROOT / package / "kernels").rglob("*.py"))


def test_no_loop_is_compiled_in_another_way() -> None:
    assert len(KERNELS) > 50
    assert [path.name for path in KERNELS if "njit" in path.read_text(encoding="utf-8")] == []


def test_a_literal_makes_no_second_version() -> None:
    @compiled
    def inner(count: int) -> int:
        return count + 1

    @compiled
    def outer(end: int) -> int:
        count = variable(0)
        while count < end:
            count = inner(count)
        return count

    assert outer(3) == 3
    assert len(inner.overloads) == 1  # type: ignore[attr-defined]


def test_a_literal_truth_value_makes_no_second_version() -> None:
    @compiled
    def inner(is_set: bool, count: int) -> int:
        return count + 1 if is_set else count

    @compiled
    def outer(is_set: bool) -> int:
        return inner(flag(True), 1) + inner(flag(False), 1) + inner(is_set, 1)

    assert outer(True) == 5
    assert len(inner.overloads) == 1  # type: ignore[attr-defined]


def test_division_by_zero_is_as_asked_for() -> None:
    @compiled
    def strict(x: float) -> float:
        return 1.0 / x

    @compiled(error_model="numpy")
    def loose(x: float) -> float:
        return 1.0 / x

    assert loose(0.0) == float("inf")
    with pytest.raises(ZeroDivisionError):
        strict(0.0)


class Inner(NamedTuple):
    """Named values within others."""

    array: np.ndarray
    count: int


class Outer(NamedTuple):
    """Named values that hold others."""

    inner: Inner
    pair: tuple[float, float]


def test_plain_tuples_hold_the_same_values_in_no_class():
    array = np.zeros(3)
    found = plain(Outer(Inner(array, 2), (0.5, 1.5)))
    assert type(found) is tuple
    assert type(found[0]) is tuple
    assert found[0][0] is array
    assert (found[0][1], found[1]) == (2, (0.5, 1.5))
    assert Outer(*found).pair == (0.5, 1.5)


def addresses_compared(loop: Any) -> int:
    """Call a loop and count in its code what takes one path or another by where its arrays lie."""
    loop(np.ones(9), np.ones(9), np.empty(9))
    # code from the cache on the disk cannot be read
    loop.recompile()
    return sum(code.count("memcheck") for code in loop.inspect_llvm().values())


def test_a_loop_that_may_round_otherwise_on_another_path_has_one_wherever_its_arrays_lie() -> None:
    def weighted(values: FloatArray, weights: FloatArray, products: FloatArray) -> None:
        for i in range(values.shape[0]):
            products[i] = values[i] * weights[i] + values[i]

    @compiled
    def inner(values: FloatArray, weights: FloatArray, products: FloatArray) -> None:
        for i in range(values.shape[0]):
            products[i] = values[i] * weights[i] + values[i]

    @compiled(fastmath=True)
    def outer(values: FloatArray, weights: FloatArray, products: FloatArray) -> None:
        inner(values, weights, products)
        for i in range(values.shape[0]):
            products[i] += values[i] * weights[i]

    # LLVM compares addresses, and goes on doing so in loops of others
    assert addresses_compared(njit(fastmath=True)(weighted)) > 0
    assert addresses_compared(outer) == 0
    assert addresses_compared(compiled(fastmath=True)(weighted)) == 0
    assert addresses_compared(njit(fastmath=True)(weighted)) > 0
