"""Renders files of figures as Markdown between markers, so that no figure in a page is copied by hand.

A page holds markers, each on a line of its own:

    <!-- figures: mirror/omni_accuracy -->            all tables of that program
    <!-- figures: mirror/omni_accuracy: poses, balls -->   some, by name
    <!-- figures: headlines -->                       the list of figures/headlines.json
    <!-- figures: short -->                           all rows that are short of their targets
    <!-- end of figures -->

What stands between a marker and the end is replaced; all other text stays.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from benchmarks.harness.figures import (
    FOLDER,
    QUICK_FOLDER,
    Cell,
    FigureError,
    Figures,
    FigureTable,
    cell_text,
    read_figures,
)
from benchmarks.harness.machine import describe

HEADLINES, SHORT = "headlines", "short"
_BLOCK = re.compile(
    r"^(?P<begin><!-- figures: (?P<what>[^\n]*?) -->)\n(?P<body>.*?)^(?P<end><!-- end of figures -->)$",
    re.MULTILINE | re.DOTALL,
)
_MARKER = re.compile(r"^<!-- (?:figures: |end of figures)", re.MULTILINE)


def render_page(text: str, folder: Path = FOLDER) -> str:
    """Replace what stands between a page's markers.

    Parameters
    ----------
    text : str
        The page.
    folder : Path
        Where the files of figures are.

    Raises
    ------
    FigureError
        A marker has no end, or asks for a file, table, row or column that is not there.
    """
    rendered = _BLOCK.sub(lambda m: f"{m['begin']}\n{_block(m['what'], folder)}{m['end']}", text)
    if len(_MARKER.findall(text)) != 2 * len(_BLOCK.findall(text)):
        raise FigureError('a marker "figures" has no "end of figures", or the other way round')
    return rendered


def page_programs(text: str) -> list[str]:
    """Programs whose figures a page shows."""
    return [match["what"].partition(":")[0].strip() for match in _BLOCK.finditer(text)]


def render_table(table: FigureTable) -> str:
    """Render a table, its title above and its notes below."""
    lines = []
    if table.title:
        lines += [f"{table.title}:" if table.title[-1] not in ":;." else table.title, ""]
    lines.append(_line([column.name for column in table.columns]))
    lines.append("|" + "---|" * len(table.columns))
    lines += [_line(["" if cell in (None, "-") else cell_text(cell) for cell in row.cells]) for row in table.rows]
    for note in table.notes:
        lines += ["", note]
    return "\n".join(lines) + "\n"


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cell.strip().replace("|", "\\|") for cell in cells) + " |"


def _block(what: str, folder: Path) -> str:
    if what == HEADLINES:
        return render_headlines(folder)
    if what == SHORT:
        return render_short(folder)
    program, _, names = what.partition(":")
    figures = read_figures(folder / f"{program.strip()}.json")
    tables = [figures.table(name.strip()) for name in names.split(",")] if names else figures.tables
    return "\n".join([_origin(figures), *(render_table(table) for table in tables), ""])


def _origin(figures: Figures) -> str:
    how = "" if figures.origin == "run" else f"; {figures.origin}"
    where = describe(figures.machine, figures.versions)
    return f"{figures.date}, {figures.size} size, seed {figures.seed}; {where}{how}.\n"


def render_headlines(folder: Path) -> str:
    """Render the list of figures that a front page shows.

    ``headlines.json`` is a list; each entry says `what` is measured, its `program`, `table` and `row` (the beginning of
    the row's labels), and a `text` with column names in braces.
    """
    path = folder / f"{HEADLINES}.json"
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as error:
        raise FigureError(f"{path}: {error}") from None
    lines = ["| what | figure | program | measured on |", "|---|---|---|---|"]
    for entry in entries:
        figures = read_figures(folder / f"{entry['program']}.json")
        cells = _row_cells(figures, entry["table"], entry["row"])
        try:
            text = entry["text"].format(**cells)
        except KeyError as error:
            raise FigureError(f"{path}: {entry['what']!r}: no column {error} in {sorted(cells)}") from None
        lines.append(_line([entry["what"], text, f"`{figures.program}`", figures.date]))
    return "\n".join(lines) + "\n\n"


def render_short(folder: Path) -> str:
    """Render the rows of all programs, of the runs kept in a folder, that are short of their targets."""
    lines = ["| program | row | figures |", "|---|---|---|"]
    for path in sorted(folder.glob("*/*.json")):
        if path.parent == folder / QUICK_FOLDER.name:
            continue
        figures = read_figures(path)
        for table in figures.tables:
            first: Cell = ""
            for row in table.rows:
                first = first if row.cells[0] in (None, "") else row.cells[0]
                texts = [cell_text(cell).strip() for cell in row.cells]
                if "SHORT" not in texts:
                    continue
                pairs = zip(table.columns[1:], texts[1:], strict=True)
                said = [f"{column.name.strip()} {text}" for column, text in pairs if text not in ("", "-", "SHORT")]
                lines.append(_line([f"`{figures.program}`", cell_text(first), "; ".join(said)]))
    return "\n".join(lines) + "\n\n"


def _row_cells(figures: Figures, table_name: str, labels: str) -> dict[str, str]:
    """Cells by column of the row whose first cells, without indents, joined by ", ", begin so; empty: as above."""
    table = figures.table(table_name)
    first: Cell = ""
    for row in table.rows:
        first = first if row.cells[0] in (None, "") else row.cells[0]
        name = ", ".join(cell_text(cell).strip() for cell in (first, *row.cells[1:]) if cell not in (None, ""))
        if f"{name}, ".startswith(f"{labels}, "):
            names = [column.name for column in table.columns]
            return {key: cell_text(cell) for key, cell in zip(names, row.cells, strict=True)}
    raise FigureError(f"{figures.program}: table {table_name!r}: no row {labels!r}")
