"""Checks of numbers in settings, with one rule and one message for each kind of bound."""

from __future__ import annotations

import math

from field_models.errors import ArgumentError


def as_positive(name: str, value: float) -> float:
    """Return a number as float; if it is not positive and finite, raise an `ArgumentError` that names it."""
    if not 0.0 < value < math.inf:
        raise ArgumentError(f"{name} must be positive, got {value!r}")
    return float(value)


def require_positive(owner: object, *names: str) -> None:
    """Raise an `ArgumentError` that names the first attribute that is not positive and finite, if there is one."""
    for name in names:
        as_positive(name, getattr(owner, name))


def require_not_negative(owner: object, *names: str) -> None:
    """Raise an `ArgumentError` that names the first attribute that is negative or not finite, if there is one."""
    for name in names:
        if not 0.0 <= getattr(owner, name) < math.inf:
            raise ArgumentError(f"{name} must not be negative, got {getattr(owner, name)!r}")


def require_at_least(owner: object, least: float, *names: str) -> None:
    """Raise an `ArgumentError` that names the first attribute that is below a bound or not finite, if there is one."""
    for name in names:
        if not least <= getattr(owner, name) < math.inf:
            raise ArgumentError(f"{name} must be at least {least:g}, got {getattr(owner, name)!r}")
