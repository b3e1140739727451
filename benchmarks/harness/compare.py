"""Compare a run's figures with earlier ones of the same program and size: which got worse by more than their noise.

A run repeats its seed, so that the same code gives the same figures but for times. The tolerance is for changes that
move figures without making them worse: it is what another seed could give. Of `n` samples in both runs, a figure is
worse if

- a rate (per cent or a/b) falls, or a loss rises, by more than 3 standard deviations of the difference of two
  binomial ratios, both taken to be the earlier one;
- an error rises, or a score falls, by more than the factor 1 + 3 sqrt(2 / n): the relative standard deviation of a
  median or root mean square of n samples is about 1 / sqrt(n) (a factor of 2 where n is not said). Of fewer than 20
  samples it is not compared: one kick in eight that went otherwise changed a log loss by a factor of 7;
- a count rises by more than 3 standard deviations of a Poisson count;
- a ratio of times rises by more than the factor 5: quick runs time a few calls, and on a busy machine two runs of the
  same code were up to 1.7 times apart. This finds only what got slower by far; the default runs say the rest;
- a verdict that stands for a figure without a number turns from "ok" to "SHORT";
- a figure, row or table is missing. What says "not installed" is left out.

Times in seconds are not compared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from benchmarks.harness.figures import Cell, Column, Figures, FigureTable, Kind, Row, cell_text

SIGMAS = 3.0
UNKNOWN_SAMPLES_FACTOR = 2.0
MIN_SAMPLES = 20
TIME_FACTOR = 5.0
NOT_INSTALLED = "not installed"


@dataclass(frozen=True)
class Worse:
    """A figure that got worse, and where it stands."""

    table: str
    row: str
    column: str
    before: str
    now: str
    limit: str

    def __str__(self) -> str:
        """One line."""
        where = ", ".join(part for part in (f"table {self.table}", self.row, self.column) if part)
        return f"{where}: {self.now}, was {self.before} ({self.limit})"


@dataclass(frozen=True)
class Comparison:
    """How many figures were compared, and those that got worse."""

    compared: int
    worse: tuple[Worse, ...]


def compare(before: Figures, now: Figures) -> Comparison:
    """Compare two runs of one program."""
    compared = 0
    worse: list[Worse] = []
    tables = {table.name: table for table in now.tables}
    for table in before.tables:
        other = tables.get(table.name)
        if other is None:
            worse.append(Worse(table.name, "", "", "there", "missing", "tables may not vanish"))
            continue
        count, found = _compare_tables(table, other)
        compared += count
        worse += found
    return Comparison(compared, tuple(worse))


def number(cell: Cell) -> tuple[float, int | None] | None:
    """Return a cell's value, and the samples that an "a/b" names; None if it is no number."""
    if cell is None or isinstance(cell, bool):
        return None
    if isinstance(cell, str):
        part, slash, whole = cell.partition("/")
        try:
            if slash:
                return 100.0 * int(part) / int(whole), int(whole)
            return float(cell), None
        except (ValueError, ZeroDivisionError):
            return None
    return float(cell), None


def is_worse(column: Column, kind: Kind, before: float, now: float, samples: int | None) -> str:
    """Return the limit that a figure exceeds, in words; empty if it is not worse.

    Parameters
    ----------
    column : Column
        Its `floor` is a difference that never counts.
    kind : Kind
        Of the figure.
    before, now : float
        The figures; rates in per cent.
    samples : int or None
        Independent samples in each run.
    """
    if math.isnan(now) and not math.isnan(before):
        return "no number now"
    if kind in (Kind.RATE, Kind.LOSS):
        n = samples or 1
        # Laplace's rule of succession: a rate of 100 % has noise, too
        ratio = (n * before / 100 + 1) / (n + 2)
        slack = 100 * SIGMAS * math.sqrt(2 * ratio * (1 - ratio) / n)
        lost = before - now if kind is Kind.RATE else now - before
        return f"at most {slack:.3g} points worse with {n} samples" if lost > slack else ""
    if kind is Kind.COUNT:
        slack = SIGMAS * math.sqrt(max(before, 1.0))
        return f"at most {slack:.3g} more" if now - before > slack else ""
    if kind in (Kind.ERROR, Kind.SCORE) and samples is not None and samples < MIN_SAMPLES:
        return ""
    if kind is Kind.ERROR:
        before, now = abs(before), abs(now)
    factor = TIME_FACTOR if kind is Kind.TIME_RATIO else UNKNOWN_SAMPLES_FACTOR
    if kind in (Kind.ERROR, Kind.SCORE) and samples:
        factor = 1 + SIGMAS * math.sqrt(2 / samples)
    bad, good = (before, now) if kind is Kind.SCORE else (now, before)
    return f"at most a factor of {factor:.3g}" if bad > factor * good and bad - good > column.floor else ""


def _compare_tables(before: FigureTable, now: FigureTable) -> tuple[int, list[Worse]]:
    compared = 0
    worse = []
    names = [column.name for column in now.columns]
    is_absent = any(NOT_INSTALLED in row.cells for row in now.rows)
    for row, other in _pairs(before, now):
        label = _label(before, row)
        if other is None and is_absent:
            continue
        if other is None:
            worse.append(Worse(before.name, label, "", "there", "missing", "rows may not vanish"))
            continue
        if NOT_INSTALLED in other.cells:
            continue
        for index, column in enumerate(before.columns):
            kind = row.kind if column.kind is Kind.BY_ROW else column.kind
            if kind in (Kind.TEXT, Kind.LABEL):
                continue
            same = _same_column(before, index, names)
            cell = row.cells[index]
            found = None if same is None else other.cells[same]
            limit = _compare_cells(column, kind, row, cell, other, found)
            compared += 1
            if limit:
                worse.append(Worse(before.name, label, column.name, cell_text(cell), cell_text(found), limit))
    return compared, worse


def _compare_cells(column: Column, kind: Kind, row: Row, cell: Cell, other: Row, found: Cell) -> str:
    if kind is Kind.VERDICT:
        return 'may not turn from "ok"' if cell == "ok" and found != "ok" else ""
    old, new = number(cell), number(found)
    if old is None:
        return ""
    if new is None:
        return "no number now"
    counts = [n for n in (old[1] or row.samples, new[1] or other.samples) if n]
    return is_worse(column, kind, old[0], new[0], min(counts, default=None))


def _same_column(table: FigureTable, index: int, names: list[str]) -> int | None:
    """Index of the column of that name; of several of one name the one with the same rank."""
    name = table.columns[index].name
    rank = [column.name for column in table.columns[:index]].count(name)
    same = [k for k, other in enumerate(names) if other == name]
    return same[rank] if rank < len(same) else None


def _label(table: FigureTable, row: Row) -> str:
    cells = [c for c, column in zip(row.cells, table.columns, strict=True) if column.kind is Kind.LABEL]
    return ", ".join(cell_text(cell) for cell in cells if cell not in (None, ""))


def _keys(table: FigureTable) -> list[tuple[str, str, int]]:
    """Name each row by the last first cell that is not empty, its own labels, and how many were named so before."""
    keys: list[tuple[str, str, int]] = []
    first = ""
    for row in table.rows:
        first = cell_text(row.cells[0]) if row.cells[0] not in (None, "") else first
        name = (first, _label(table, row))
        keys.append((*name, sum(key[:2] == name for key in keys)))
    return keys


def _pairs(before: FigureTable, now: FigureTable) -> list[tuple[Row, Row | None]]:
    """Pair rows by their labels; those left over, whose labels say a number, in their order if as many are left."""
    theirs = dict(zip(_keys(now), now.rows, strict=True))
    ours = _keys(before)
    left = [row for key, row in theirs.items() if key not in set(ours)]
    lost = [key for key in ours if key not in theirs]
    spare = iter(left if len(left) == len(lost) else [])
    return [
        (row, theirs[key] if key in theirs else next(spare, None)) for key, row in zip(ours, before.rows, strict=True)
    ]
