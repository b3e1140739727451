"""Types of arguments are spelled as JSON values; a type that cannot be is told."""

from __future__ import annotations

import pytest

from robocup_vision.compiling.listed_loop import spelled_type


def test_a_type_that_is_not_known_is_told() -> None:
    from numba import types

    with pytest.raises(TypeError, match="cannot be listed"):
        spelled_type(types.ListType(types.int64))
    assert spelled_type(types.Array(types.uint8, 2, "A", readonly=True)) == ["array", "uint8", 2, "A", False]
