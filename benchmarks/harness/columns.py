"""Short names for a table's columns by kind."""

from __future__ import annotations

from functools import partial

from benchmarks.harness.figures import Column, Kind

#: names the row, beside the first column
label = partial(Column, kind=Kind.LABEL)
#: per cent, or "a/b", of independent samples: more is better
rate = partial(Column, kind=Kind.RATE)
#: the same, less is better
loss = partial(Column, kind=Kind.LOSS)
#: a figure of merit: more is better
score = partial(Column, kind=Kind.SCORE)
#: how often something bad happened
count = partial(Column, kind=Kind.COUNT)
#: times as multiples of another time of the same run
time_ratio = partial(Column, kind=Kind.TIME_RATIO)


def error(name: str, floor: float = 0.0) -> Column:
    """Return a column of errors or ratios of errors: less is better, and differences up to `floor` do not count."""
    return Column(name, Kind.ERROR, floor)


def measured(name: str = "measured") -> Column:
    """Return a column whose rows say what their figures are."""
    return Column(name, Kind.BY_ROW)


def compared_verdict(name: str = "verdict") -> Column:
    """Return a column whose "ok" may not become "SHORT": for rows whose figure is no number."""
    return Column(name, Kind.VERDICT)
