"""What all programs have in common: arguments, first lines, tables, verdicts and the file of figures.

A program is a `main` decorated by `program`, and makes a `Table` for each group of rows. Tables print as they fill. At
the end they go to a JSON file: to that of ``--json FILE``, or, for a run of default size and seed, to
``benchmarks/figures/FOLDER/NAME.json``, from which the pages are made.
"""

from __future__ import annotations

import argparse
import datetime
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

import cv2

from benchmarks.harness.columns import read_columns
from benchmarks.harness.figures import (
    FOLDER,
    Cell,
    Column,
    Figures,
    FigureTable,
    Kind,
    Row,
    cell_text,
    write_figures,
)
from benchmarks.harness.machine import describe, machine, versions
from benchmarks.harness.pool import add_pool_options, open_pool

DEFAULT_SEED = 20010305


@dataclass
class _Run:
    """The run of this process: a process runs one program."""

    figures: Figures
    path: Path | None
    began_s: float
    is_checked: bool
    is_short: bool = False


_run: _Run | None = None


def parse_arguments(
    description: str,
    argv: Sequence[str] | None = None,
    *,
    options: Mapping[str, Any] | None = None,
    pooled: bool = False,
) -> argparse.Namespace:
    """Read the arguments that all programs take, print the first lines, and begin the file of figures.

    Parameters
    ----------
    description : str
        What is measured: the program's docstring. Its first line heads the output.
    argv : sequence of str, optional
        Those of the command line unless given.
    options : mapping, optional
        The program's own options: by name, what `ArgumentParser.add_argument` takes. Figures of a run with any of them
        set go to no file but that of ``--json``.
    pooled : bool
        Whether the program has pieces for several processes: ``--jobs`` and ``--dask`` say which, for `open_pool`.

    Returns
    -------
    Namespace
        ``quick``, ``full`` and ``check`` (bool), ``seed`` (int), ``json`` (path or None), and the program's own.
    """
    global _run
    parser = argparse.ArgumentParser(
        description=description.strip(), formatter_class=argparse.RawDescriptionHelpFormatter
    )
    own = [parser.add_argument(name, **settings) for name, settings in (options or {}).items()]
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--quick", action="store_true", help="fewer samples: a first look")
    size.add_argument("--full", action="store_true", help="more samples: takes longer than 4 minutes")
    parser.add_argument("--check", action="store_true", help="exit status 1 if a row is SHORT")
    parser.add_argument("--seed", type=int, default=DEFAULT_SEED, metavar="N", help=f"default: {DEFAULT_SEED}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to this file")
    if pooled:
        add_pool_options(parser)
    arguments = parser.parse_args(argv)
    figures = Figures(
        program=program_name(Path(sys.argv[0])),
        title=description.strip().splitlines()[0],
        size="quick" if arguments.quick else "full" if arguments.full else "default",
        seed=arguments.seed,
        date=datetime.date.today().isoformat(),
        machine=machine(),
        versions=versions(),
    )
    is_standard = figures.size == "default" and figures.seed == DEFAULT_SEED
    is_standard &= all(getattr(arguments, option.dest) == option.default for option in own)
    path = arguments.json or (FOLDER / f"{figures.program}.json" if is_standard else None)
    _run = _Run(figures, path, time.perf_counter(), arguments.check)
    print(figures.title)
    print(f"{describe(figures.machine, figures.versions)}; seed {figures.seed}")
    return arguments


def program(
    options: Mapping[str, Any] | None = None, *, pooled: bool = False
) -> Callable[[Callable[..., None]], Callable[[], None]]:
    """Make a program of a function that takes its arguments, and a pool if it is `pooled`.

    It runs at once where its module is run as a program, so it stands last in its file. OpenCV is kept to one thread:
    times are those of one, and the workers of a pool share the processors among them.

    Parameters
    ----------
    options, pooled
        As in `parse_arguments`.
    """

    def decorate(measure: Callable[..., None]) -> Callable[[], None]:
        @wraps(measure)
        def main() -> None:
            arguments = parse_arguments(str(measure.__globals__["__doc__"]), options=options, pooled=pooled)
            cv2.setNumThreads(0)
            if pooled:
                with open_pool(arguments) as pool:
                    measure(arguments, pool)
            else:
                measure(arguments)
            finish()

        if measure.__module__ == "__main__":
            main()
        return main

    return decorate


def program_name(path: Path) -> str:
    """Return FOLDER/NAME of a program's file."""
    path = path.resolve()
    return f"{path.parent.name}/{path.stem}"


class Table:
    """Prints rows as they come, under one line of column names, and keeps them for the file of figures.

    Parameters
    ----------
    columns : str or sequence of str
        As `read_columns` takes them. Spaces around a name widen its column. The first column names the row and is set
        left, all others right. Words are not compared with earlier figures.
    title : str, optional
        A line above.
    name : str, optional
        By which other files refer to the table; its number in the output unless given.
    samples : int, optional
        How many independent samples a row has, unless it says so itself: the noise of its figures follows from them.
    """

    def __init__(
        self, columns: str | Sequence[str], title: str = "", *, name: str = "", samples: int | None = None
    ) -> None:
        given = read_columns(columns)
        self._widths = [max(len(column.name), 6) for column in given]
        kept = [Column(column.name.strip(), column.kind, column.floor) for column in given]
        if kept[0].kind is Kind.TEXT:
            kept[0] = Column(kept[0].name, Kind.LABEL)
        self._samples = samples
        self._table = FigureTable(name, title.strip(), tuple(kept))
        if _run is not None:
            self._table.name = name or str(len(_run.figures.tables) + 1)
            _run.figures.tables.append(self._table)
        print(f"\n{title}" if title else "")
        self._print([column.name for column in kept])
        print("  ".join("-" * width for width in self._widths), flush=True)

    def row(self, *cells: Cell, kind: Kind = Kind.TEXT, samples: int | None = None) -> None:
        """Print one row, and keep it.

        Parameters
        ----------
        *cells : str, int, float or None
            Printed as `cell_text` says.
        kind : Kind, optional
            Of the row's figure, in a table that has a column of kind BY_ROW.
        samples : int, optional
            How many independent samples it has, if not as many as the table says.
        """
        if len(cells) != len(self._widths):
            raise ValueError(f"a row must have {len(self._widths)} cells, got {len(cells)}")
        self._table.rows.append(Row(cells, kind, self._samples if samples is None else samples))
        self._print([cell_text(cell) for cell in cells])

    def note(self, text: str) -> None:
        """Print a line of text, and keep it below the table."""
        self._table.notes.append(text.strip())
        print(text, flush=True)

    def _print(self, texts: Sequence[str]) -> None:
        first = texts[0].ljust(self._widths[0])
        rest = [text.rjust(width) for text, width in zip(texts[1:], self._widths[1:], strict=True)]
        print("  ".join([first, *rest]).rstrip(), flush=True)


def percent(ratio: float | None) -> str:
    """Percentage of a ratio, never rounded up to 100; a dash for None."""
    if ratio is None:
        return "-"
    text = f"{100 * ratio:.2f}"
    return "100" if ratio == 1 else "99.99" if text == "100.00" else text


def verdict(ok: bool) -> str:
    """Return "ok" or "SHORT", and keep it for the last line."""
    judge(ok)
    return "ok" if ok else "SHORT"


def judge(ok: bool) -> None:
    """Keep for the last line what no verdict shows."""
    if _run is not None and not ok:
        _run.is_short = True


def finish() -> None:
    """Print the last line, write the figures, and leave with status 1 if something is SHORT and ``--check`` is set."""
    is_short = _run is not None and _run.is_short
    print("\nsome acceptance rows are SHORT" if is_short else "\nevery acceptance row is ok")
    if _run is not None and _run.path is not None:
        _run.figures.seconds = round(time.perf_counter() - _run.began_s, 1)
        write_figures(_run.figures, _run.path)
    if is_short and _run is not None and _run.is_checked:
        raise SystemExit(1)
