"""Types of arguments are spelled as JSON values; the level of optimisation is lower while prepared loops compile."""

from __future__ import annotations

import gc

import pytest

from robocup_vision.compiling.prepared_kernels import quick_compiling, spelled_type


def test_a_type_that_is_not_known_is_told() -> None:
    from numba import types

    with pytest.raises(TypeError, match="cannot be listed"):
        spelled_type(types.ListType(types.int64))
    assert spelled_type(types.Array(types.uint8, 2, "A", readonly=True)) == ["array", "uint8", 2, "A", False]


def test_prepared_loops_are_optimized_less_and_the_level_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core import config

    monkeypatch.delenv("NUMBA_OPT", raising=False)
    before, thresholds = config.OPT, gc.get_threshold()
    with quick_compiling():
        assert (config.OPT, gc.get_threshold() > thresholds) == (2, True)
    assert (config.OPT, gc.get_threshold()) == (before, thresholds)


def test_a_level_that_the_user_names_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core import config

    monkeypatch.setenv("NUMBA_OPT", "1")
    before = config.OPT
    with quick_compiling():
        assert before == config.OPT


def test_the_level_comes_back_after_an_error() -> None:
    from numba.core import config

    before = config.OPT
    with pytest.raises(KeyError), quick_compiling():
        raise KeyError
    assert before == config.OPT
