"""Bounds of settings: what is inside passes, what is outside is named with its value."""

import math
from types import SimpleNamespace

import pytest

from field_models.errors import ArgumentError
from robocup_vision.checks import require_at_least, require_not_negative, require_positive

VALUES = SimpleNamespace(one=1, half=0.5, zero=0.0, minus=-1.0, endless=math.inf, unknown=math.nan)


@pytest.mark.parametrize(
    ("check", "good"),
    [
        (require_positive, ("one", "half")),
        (require_not_negative, ("one", "half", "zero")),
        (lambda owner, *names: require_at_least(owner, 0.5, *names), ("one", "half")),
    ],
    ids=["positive", "not_negative", "at_least"],
)
def test_a_value_outside_its_bound_is_named_and_no_other(check, good):
    check(VALUES, *good)
    for name, value in vars(VALUES).items():
        if name not in good:
            with pytest.raises(ArgumentError, match=f"^{name} must .*, got {value}$"):
                check(VALUES, *good, name)
