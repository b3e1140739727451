"""The figures of one program's run as values, and the JSON file that keeps them.

A file holds the program's name and first line, the size of the run (quick, default or full), seed, date, machine,
versions, and its tables in the order printed: the columns with their kinds, and the rows. ``origin`` is "run", or
"converted" for figures that were copied once from a printed table.
"""

from __future__ import annotations

import json
import math
from enum import Enum
from pathlib import Path

import msgspec

FORMAT = 1
FOLDER = Path(__file__).resolve().parents[1] / "figures"
QUICK_FOLDER = FOLDER / "quick"

Cell = str | int | float | None


class FigureError(Exception):
    """A file of figures that cannot be read, or lacks what is asked of it: one line with file and key."""


class Kind(str, Enum):
    """What a figure is, which says how it is compared with an earlier one."""

    TEXT = "text"  # not compared: words, targets, times in seconds
    LABEL = "label"  # names the row
    RATE = "rate"  # per cent, or "a/b", of independent samples; more is better
    LOSS = "loss"  # the same, less is better
    ERROR = "error"  # an error or a ratio of errors; less is better
    SCORE = "score"  # a figure of merit; more is better
    COUNT = "count"  # how often something bad happened; less is better
    TIME_RATIO = "time ratio"  # a time as a multiple of another of the same run; less is better
    VERDICT = "verdict"  # "ok" or "SHORT"
    BY_ROW = "by row"  # each row says its own kind


class Column(msgspec.Struct, frozen=True):
    """A column of a table."""

    name: str  #: as printed
    kind: Kind = Kind.TEXT  #: how its figures are compared
    floor: float = 0.0  #: errors and ratios: differences up to this one are never worse


class Row(msgspec.Struct, frozen=True, omit_defaults=True):
    """A row: its cells, the kind of its figure where the column leaves it to the row, and how many samples it has."""

    cells: tuple[Cell, ...]
    kind: Kind = Kind.TEXT
    samples: int | None = None


class FigureTable(msgspec.Struct):
    """A table: rows under columns, and lines of text below it."""

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: list[Row] = []
    notes: list[str] = []


class Figures(msgspec.Struct):
    """All that one run of a program has measured."""

    program: str
    title: str
    size: str
    seed: int
    date: str
    machine: str
    versions: dict[str, str]
    origin: str = "run"
    seconds: float | None = None
    tables: list[FigureTable] = []

    def table(self, name: str) -> FigureTable:
        """Return a table by its name.

        Raises
        ------
        FigureError
            There is none of that name.
        """
        for table in self.tables:
            if table.name == name:
                return table
        raise FigureError(f"{self.program}: no table {name!r}; there are {[table.name for table in self.tables]}")


def cell_text(cell: Cell) -> str:
    """Text of a cell: strings as they are, floats with three digits that count, None as a dash."""
    if cell is None:
        return "-"
    if isinstance(cell, float):
        return f"{cell:.0f}" if abs(cell) >= 100 else f"{cell:.3g}"
    return str(cell)


def write_figures(figures: Figures, path: Path) -> None:
    """Write a JSON file, a row of a table in each line."""
    head = {
        "format": FORMAT,
        **{name: getattr(figures, name) for name in figures.__struct_fields__ if name != "tables"},
    }
    lines = [f" {_dumps(key)}: {_dumps(value)}," for key, value in head.items()]
    tables = ",\n".join(_table_lines(table) for table in figures.tables)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("{\n" + "\n".join(lines) + f'\n "tables": [\n{tables}\n ]\n}}\n', encoding="utf-8")


def read_figures(path: Path) -> Figures:
    """Read a JSON file.

    Raises
    ------
    FigureError
        It is missing, is no JSON, has another format, or lacks a key.
    """
    try:
        data = msgspec.json.decode(path.read_bytes())
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise FigureError(f"{path}: format: must be {FORMAT}")
        figures = msgspec.convert(data, Figures)
    except OSError as error:
        raise FigureError(f"{path}: {error.strerror}") from None
    except msgspec.MsgspecError as error:
        raise FigureError(f"{path}: {error}") from None
    for table in figures.tables:
        for row in table.rows:
            if (count := len(table.columns)) != len(row.cells):
                raise FigureError(f"{path}: table {table.name!r}: a row must have {count} cells, got {len(row.cells)}")
    return figures


def _dumps(value: object) -> str:
    return json.dumps(msgspec.to_builtins(value), ensure_ascii=False)


def _table_lines(table: FigureTable) -> str:
    rows = ",\n".join(f"    {_dumps(Row(tuple(map(_rounded, r.cells)), r.kind, r.samples))}" for r in table.rows)
    columns = [{"name": c.name, "kind": c.kind.value, **({"floor": c.floor} if c.floor else {})} for c in table.columns]
    return (
        f'  {{"name": {_dumps(table.name)}, "title": {_dumps(table.title)},\n   "columns": {_dumps(columns)},\n'
        f'   "rows": [\n{rows}\n   ],\n   "notes": {_dumps(table.notes)}}}'
    )


def _rounded(cell: Cell) -> Cell:
    """Six digits that count; what JSON cannot say (inf, nan) as text."""
    if isinstance(cell, float):
        return float(f"{cell:.6g}") if math.isfinite(cell) else str(cell)
    return cell
