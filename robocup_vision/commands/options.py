"""Checks of options that several commands take: one rule and one wording wherever a count or a seed is asked for."""

from __future__ import annotations

from field_models.errors import ArgumentError


def require_count(option: str, value: int) -> None:
    """Refuse a number of things that is not positive.

    Parameters
    ----------
    option : str
        As the user spells it, dashes and all.
    value : int
        What was given.

    Raises
    ------
    ArgumentError
        If it is less than 1.
    """
    if value < 1:
        raise ArgumentError(f"{option} must be at least 1, got {value}")


def require_seed(seed: int) -> None:
    """Refuse a ``--seed`` that no generator takes.

    Raises
    ------
    ArgumentError
        If it is negative.
    """
    if seed < 0:
        raise ArgumentError(f"--seed must not be negative, got {seed}")
