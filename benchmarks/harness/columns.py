"""Short names for a table's columns by kind."""

from __future__ import annotations

from benchmarks.harness.figures import Column, Kind


def label(name: str) -> Column:
    """Names the row, beside the first column."""
    return Column(name, Kind.LABEL)


def rate(name: str) -> Column:
    """Per cent, or "a/b", of independent samples: more is better."""
    return Column(name, Kind.RATE)


def loss(name: str) -> Column:
    """Per cent, or "a/b", of independent samples: less is better."""
    return Column(name, Kind.LOSS)


def error(name: str, floor: float = 0.0) -> Column:
    """Return a column of errors or ratios of errors: less is better, and differences up to `floor` do not count."""
    return Column(name, Kind.ERROR, floor)


def score(name: str) -> Column:
    """Return a column of a figure of merit: more is better."""
    return Column(name, Kind.SCORE)


def count(name: str) -> Column:
    """How often something bad happened."""
    return Column(name, Kind.COUNT)


def time_ratio(name: str) -> Column:
    """Return a column of times as multiples of another time of the same run."""
    return Column(name, Kind.TIME_RATIO)


def measured(name: str = "measured") -> Column:
    """Each row says what its figure is."""
    return Column(name, Kind.BY_ROW)


def compared_verdict(name: str = "verdict") -> Column:
    """Return a column whose "ok" may not become "SHORT": for rows whose figure is no number."""
    return Column(name, Kind.VERDICT)
