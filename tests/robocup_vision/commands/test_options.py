"""Counts and seeds of commands: the least that is taken, and the line that names option and value where it is not."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.commands.options import require_count, require_seed


@given(st.integers(max_value=0), st.sampled_from(["--count", "--frames"]))
def test_counts_begin_at_one(value: int, option: str) -> None:
    require_count(option, 1 - value)
    with pytest.raises(ArgumentError) as refusal:
        require_count(option, value)
    assert str(refusal.value) == f"{option} must be at least 1, got {value}"


@given(st.integers(min_value=0))
def test_seeds_begin_at_zero(seed: int) -> None:
    require_seed(seed)
    with pytest.raises(ArgumentError) as refusal:
        require_seed(-1 - seed)
    assert str(refusal.value) == f"--seed must not be negative, got {-1 - seed}"
