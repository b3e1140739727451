"""The files of figures: written by a table, read again, rendered as Markdown."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from benchmarks.__main__ import render_pages
from benchmarks.harness import Kind, Table, judge, percent, verdict
from benchmarks.harness.columns import read_columns
from benchmarks.harness.figures import FigureError, Figures, FigureTable, Row, cell_text, read_figures, write_figures
from benchmarks.harness.markdown import page_programs, render_page
from benchmarks.harness.report import finish, parse_arguments

DOCSTRING = "What is measured.\n\nHow."


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """Return the file of a small program."""
    return run(tmp_path / "goal" / "table.json")


def run(path: Path) -> Path:
    """Do what a program does."""
    parse_arguments(DOCSTRING, ["--quick", "--json", str(path)])
    head = "place     | located: rate | |mm|: error 0.1 | target | verdict"
    table = Table(head, "Poses", name="poses", samples=20)
    table.row("near", "19/20", 1.23456789, "<= 2", verdict(True))
    table.row("far", percent(0.5), math.inf, None, verdict(False), samples=10)
    mixed = Table("what | measured: by row")
    mixed.row("losses", 3, kind=Kind.COUNT)
    mixed.note("of all")
    finish()
    return path


def test_a_table_becomes_json(written: Path) -> None:
    figures = read_figures(written)
    assert (figures.title, figures.size, figures.seed, figures.origin) == (
        "What is measured.",
        "quick",
        20010305,
        "run",
    )
    assert figures.machine
    assert set(figures.versions) >= {"Python", "numpy"}
    poses = figures.table("poses")
    assert [(c.name, c.kind) for c in poses.columns] == [
        ("place", Kind.LABEL),
        ("located", Kind.RATE),
        ("|mm|", Kind.ERROR),
        ("target", Kind.TEXT),
        ("verdict", Kind.TEXT),
    ]
    assert poses.columns[2].floor == 0.1
    assert poses.rows == [
        Row(("near", "19/20", 1.23457, "<= 2", "ok"), samples=20),
        Row(("far", "50.00", "inf", None, "SHORT"), samples=10),
    ]
    assert figures.tables[1] == FigureTable(
        "2", "", figures.tables[1].columns, [Row(("losses", 3), Kind.COUNT)], ["of all"]
    )


def test_a_file_read_and_written_is_the_same(written: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.json"
    write_figures(read_figures(written), again)
    assert again.read_bytes() == written.read_bytes()


def test_a_table_prints_what_it_keeps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(tmp_path / "figures.json")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "What is measured."
    assert lines[3:6] == [
        "Poses",
        "place      located    |mm|  target  verdict",
        "---------  -------  ------  ------  -------",
    ]
    assert lines[6].split() == ["near", "19/20", "1.23", "<=", "2", "ok"]
    assert lines[-1] == "some acceptance rows are SHORT"


def test_a_row_has_a_cell_a_column() -> None:
    with pytest.raises(ValueError, match="a row must have 2 cells, got 1"):
        Table("a | b").row("x")


def test_check_leaves_with_status_1_when_a_row_is_short(tmp_path: Path) -> None:
    path = tmp_path / "figures.json"
    for told in (verdict, judge):
        parse_arguments(DOCSTRING, ["--check", "--json", str(path)])
        told(True)
        finish()
        told(False)
        with pytest.raises(SystemExit) as left:
            finish()
        assert left.value.code == 1
    assert path.is_file()


def test_only_a_run_of_default_size_and_seed_replaces_the_figures(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("benchmarks.harness.report.FOLDER", tmp_path)
    monkeypatch.setattr("sys.argv", [str(tmp_path / "goal" / "table.py")])
    for options in (["--quick"], ["--full"], ["--seed", "7"]):
        parse_arguments(DOCSTRING, options)
        finish()
    assert not list(tmp_path.iterdir())
    parse_arguments(DOCSTRING, [])
    finish()
    assert read_figures(tmp_path / "goal" / "table.json").program == "goal/table"


def test_heads_say_names_kinds_and_floors() -> None:
    columns = read_columns(("paper: mm, ms  | ms: time ratio", "worst s: error 0.5", "verdict: verdict | a: b"))
    assert [(c.name.strip(), c.kind, c.floor) for c in columns] == [
        ("paper: mm, ms", Kind.TEXT, 0.0),
        ("ms", Kind.TIME_RATIO, 0.0),
        ("worst s", Kind.ERROR, 0.5),
        ("verdict", Kind.VERDICT, 0.0),
        ("a: b", Kind.TEXT, 0.0),
    ]


def test_cells_as_text() -> None:
    assert [cell_text(cell) for cell in (None, "as it is", 7, 0.012345, 123.45)] == [
        "-",
        "as it is",
        "7",
        "0.0123",
        "123",
    ]
    assert [percent(ratio) for ratio in (None, 1.0, 0.99999, 0.5)] == ["-", "100", "99.99", "50.00"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "No such file"),
        ("{", "truncated"),
        ("[]", "format: must be 1"),
        ('{"format": 2}', "format: must be 1"),
        ('{"format": 1}', "missing required field `program`"),
        ('{"format": 1, "tables": []}', "missing required field `program`"),
        ('{"format": 1, "tables": [{"name": "a", "columns": [{"name": "x", "kind": "colour"}]}]}', "colour"),
        (
            '{"format": 1, "program": "", "title": "", "size": "", "seed": 1, "date": "", "machine": "", '
            '"versions": {}, "tables": [{"name": "a", "title": "", "columns": [], "rows": [{"cells": [1]}]}]}',
            "table 'a': a row must have 0 cells, got 1",
        ),
    ],
)
def test_a_broken_file_says_what_is_wrong(tmp_path: Path, text: str | None, message: str) -> None:
    path = tmp_path / "broken.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(FigureError, match=message) as raised:
        read_figures(path)
    assert str(path) in str(raised.value)


PAGE = """# Page

Words.

<!-- figures: goal/table: poses -->
old
<!-- end of figures -->
More words.
"""


def test_a_page_is_rendered_between_its_markers(written: Path) -> None:
    folder = written.parents[1]
    page = render_page(PAGE, folder)
    before, after = PAGE.split("old\n")
    assert page.startswith(before)
    assert page.endswith(after)
    lines = page[len(before) : -len(after)].splitlines()
    figures = read_figures(written)
    assert lines[0].startswith(f"{figures.date}, quick size, seed 20010305; {figures.machine}; Python ")
    assert lines[2:] == [
        "Poses:",
        "",
        "| place | located | \\|mm\\| | target | verdict |",
        "|---|---|---|---|---|",
        "| near | 19/20 | 1.23 | <= 2 | ok |",
        "| far | 50.00 | inf |  | SHORT |",
        "",
    ]
    assert render_page(page, folder) == page
    assert page_programs(page) == ["goal/table"]


def test_a_marker_without_a_table_names_all_of_them(written: Path) -> None:
    page = render_page(PAGE.replace(": poses", ""), written.parents[1])
    assert "| losses | 3 |" in page
    assert "\nof all\n" in page


@pytest.mark.parametrize(
    ("page", "message"),
    [
        (PAGE.replace("<!-- end of figures -->\n", ""), 'no "end of figures"'),
        (PAGE.replace("poses", "balls"), "no table 'balls'; there are .'poses', '2'"),
        (PAGE.replace("goal/table", "goal/other"), "other.json: No such file"),
    ],
)
def test_a_page_that_cannot_be_rendered_says_why(written: Path, page: str, message: str) -> None:
    with pytest.raises(FigureError, match=message):
        render_page(page, written.parents[1])


def test_headlines_take_cells_of_rows(written: Path) -> None:
    folder = written.parents[1]
    entry = {"what": "far places", "program": "goal/table", "table": "poses", "row": "far", "text": "{located} %"}
    (folder / "headlines.json").write_text(json.dumps([entry]), encoding="utf-8")
    page = render_page("<!-- figures: headlines -->\n<!-- end of figures -->\n", folder)
    assert f"| far places | 50.00 % | `{read_figures(written).program}` |" in page
    for key, value, message in (
        ("row", "fa", "no row 'fa'"),
        ("text", "{x}", "no column 'x'"),
        ("table", "t", "no table 't'"),
    ):
        (folder / "headlines.json").write_text(json.dumps([{**entry, key: value}]), encoding="utf-8")
        with pytest.raises(FigureError, match=message):
            render_page("<!-- figures: headlines -->\n<!-- end of figures -->\n", folder)


def test_rows_that_are_short_are_listed(written: Path) -> None:
    page = render_page("<!-- figures: short -->\n<!-- end of figures -->\n", written.parents[1])
    program = read_figures(written).program
    assert f"| `{program}` | far | located 50.00; \\|mm\\| inf |" in page
    assert "near" not in page


def test_figures_of_no_run() -> None:
    figures = Figures("a/b", "", "default", 1, "2026-11-21", "", {})
    with pytest.raises(FigureError, match="a/b: no table 'x'"):
        figures.table("x")


def test_pages_are_written_only_if_they_change(written: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    assert render_pages(["page.md"], tmp_path, written.parents[1]) == ["page.md"]
    assert "| near |" in page.read_text(encoding="utf-8")
    assert render_pages(["page.md"], tmp_path, written.parents[1]) == []
    page.write_text(PAGE.replace("poses", "balls"), encoding="utf-8")
    with pytest.raises(FigureError, match=r"page\.md: .*no table 'balls'"):
        render_pages(["page.md"], tmp_path, written.parents[1])
