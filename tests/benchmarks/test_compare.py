"""Which figures count as worse than earlier ones, and the exit status that follows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.__main__ import main
from benchmarks.harness.compare import compare, is_worse, number
from benchmarks.harness.figures import Column, Figures, FigureTable, Kind, Row, write_figures

COMPARED = [kind for kind in Kind if kind not in (Kind.TEXT, Kind.LABEL, Kind.VERDICT, Kind.BY_ROW)]


def figures(*rows: Row, columns: Sequence[Column] = (), notes: Sequence[str] = ()) -> Figures:
    """Return a run with one table."""
    table = FigureTable("poses", "", tuple(columns), list(rows), list(notes))
    return Figures("goal/table", "", "quick", 1, "2026-11-22", "a machine", {}, tables=[table])


def one(kind: Kind, cell: object, samples: int | None = None, label: str = "near") -> Figures:
    """Return a run with one figure."""
    row = Row((label, cell), samples=samples)  # type: ignore[arg-type]
    return figures(row, columns=(Column("place", Kind.LABEL), Column("it", kind)))


@pytest.mark.parametrize(
    ("kind", "before", "now", "samples", "worse"),
    [
        # 3 sigma of the difference of two ratios of 60: 7 points at 100 %, 27 at 50 %
        (Kind.RATE, "100", "96.70", 60, False),
        (Kind.RATE, "100", "90.00", 60, True),
        (Kind.RATE, "50.00", "30.00", 60, False),
        (Kind.RATE, "50.00", "20.00", 60, True),
        (Kind.RATE, "60/60", "50/60", None, True),
        (Kind.LOSS, "0.00", "3.30", 60, False),
        (Kind.LOSS, "0.00", "10.00", 60, True),
        # 1 + 3 sqrt(2 / 72) = 1.5
        (Kind.ERROR, 1.0, 1.49, 72, False),
        (Kind.ERROR, 1.0, 1.51, 72, True),
        (Kind.ERROR, -1.0, 1.51, 72, True),
        (Kind.ERROR, 1.0, 1.99, None, False),
        (Kind.ERROR, 1.0, 2.01, None, True),
        (Kind.ERROR, 0.0, 0.1, None, True),
        # heavy tails of few samples
        (Kind.ERROR, 1.0, 9.0, 19, False),
        (Kind.SCORE, 0.9, 0.61, 72, False),
        (Kind.SCORE, 0.9, 0.59, 72, True),
        (Kind.COUNT, 0, 3, None, False),
        (Kind.COUNT, 0, 4, None, True),
        (Kind.COUNT, 100, 130, None, False),
        (Kind.COUNT, 100, 131, None, True),
        (Kind.TIME_RATIO, "5.00", "24.90", None, False),
        (Kind.TIME_RATIO, "5.00", "25.10", None, True),
        (Kind.VERDICT, "ok", "SHORT", None, True),
        (Kind.TEXT, 1.0, 99.0, None, False),
        # a figure that is none any more
        (Kind.ERROR, 1.0, None, None, True),
        (Kind.ERROR, 1.0, "nan", None, True),
        (Kind.ERROR, None, 1.0, None, False),
        (Kind.ERROR, 1.0, "not installed", None, False),
    ],
)
def test_what_is_worse(kind: Kind, before: object, now: object, samples: int | None, worse: bool) -> None:
    found = compare(one(kind, before, samples), one(kind, now, samples))
    assert bool(found.worse) == worse
    assert all("near, it: " in str(one_worse) for one_worse in found.worse)


@given(st.sampled_from(COMPARED), st.floats(0.0, 100.0), st.integers(1, 1000))
def test_the_same_figure_is_never_worse(kind: Kind, value: float, samples: int) -> None:
    assert not is_worse(Column("it", kind), kind, value, value, samples)


@given(st.sampled_from(COMPARED), st.floats(0.0, 100.0), st.floats(0.0, 100.0), st.integers(1, 1000))
def test_of_two_figures_at_most_one_is_worse(kind: Kind, one: float, other: float, samples: int) -> None:
    column = Column("it", kind)
    assert not (is_worse(column, kind, one, other, samples) and is_worse(column, kind, other, one, samples))


def test_a_floor_is_never_worse() -> None:
    column = Column("s", Kind.ERROR, floor=0.5)
    assert not is_worse(column, Kind.ERROR, 0.0, 0.5, None)
    assert is_worse(column, Kind.ERROR, 0.0, 0.51, None)


def test_a_row_says_its_own_kind() -> None:
    columns = (Column("what", Kind.LABEL), Column("measured", Kind.BY_ROW))
    before = figures(Row(("losses", 0), Kind.COUNT), Row(("words", "some")), columns=columns)
    now = figures(Row(("losses", 9), Kind.COUNT), Row(("words", "others")), columns=columns)
    found = compare(before, now)
    assert [worse.row for worse in found.worse] == ["losses"]
    assert found.compared == 1


def test_rows_are_paired_by_their_labels() -> None:
    columns = (Column("light", Kind.LABEL), Column("method", Kind.LABEL), Column("mm", Kind.ERROR))
    before = figures(Row(("dark", "ours", 1.0)), Row(("", "theirs", 9.0)), Row(("lit", "ours", 5.0)), columns=columns)
    now = figures(Row(("lit", "ours", 5.0)), Row(("dark", "ours", 1.0)), Row(("", "theirs", 9.0)), columns=columns)
    assert not compare(before, now).worse
    # a label that holds a number changes: such rows are paired in their order
    renamed = figures(Row(("3 seen", "ours", 1.0)), columns=columns)
    assert not compare(renamed, figures(Row(("4 seen", "ours", 1.0)), columns=columns)).worse


def test_columns_of_one_name_are_paired_by_rank() -> None:
    columns = (Column("a"), Column("ratio", Kind.ERROR), Column("ratio", Kind.ERROR))
    assert not compare(
        figures(Row(("x", 1.0, 9.0)), columns=columns), figures(Row(("x", 1.0, 9.0)), columns=columns)
    ).worse


def test_what_is_missing_is_worse() -> None:
    columns = (Column("place", Kind.LABEL), Column("it", Kind.ERROR))
    both = figures(Row(("near", 1.0)), Row(("far", 1.0)), columns=columns)
    assert [worse.row for worse in compare(both, figures(Row(("near", 1.0)), columns=columns)).worse] == ["far"]
    nothing = figures(columns=columns)
    nothing.tables.clear()
    assert [worse.table for worse in compare(both, nothing).worse] == ["poses"]
    absent = figures(Row(("photograph", "not installed")), columns=columns)
    assert not compare(both, absent).worse


def test_numbers_of_cells() -> None:
    assert number("19/20") == (95.0, 20)
    assert number("1e-3") == (1e-3, None)
    assert number(3) == (3.0, None)
    assert [number(cell) for cell in (None, "", "-", "1/0", "many/few", "not located")] == [None] * 6


@pytest.mark.parametrize(("now", "status", "said"), [("20/20", 0, "ok, 1 figures compared"), ("9/20", 1, "1 WORSE")])
def test_the_check_leaves_with_its_status(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    now: str,
    status: int,
    said: str,
) -> None:
    name = "goal/goal_sensitivity"
    monkeypatch.setattr("benchmarks.__main__.QUICK_FOLDER", tmp_path)
    write_figures(one(Kind.RATE, "20/20"), tmp_path / f"{name}.json")

    def run(program: str, options: Sequence[str]) -> tuple[int, str]:
        assert program == name
        assert options[:2] == ["--quick", "--json"]
        write_figures(one(Kind.RATE, now), Path(options[2]))
        return 0, ""

    assert main(["--quick", "--check", name], run) == status
    out = capsys.readouterr().out
    assert said in out
    assert len([line for line in out.splitlines() if line.startswith(name)]) == 1


def test_a_program_that_fails_fails_the_check(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--quick", "goal/goal_table"], lambda name, options: (3, "it broke")) == 1
    assert "exit status 3: it broke" in capsys.readouterr().out


def test_an_update_replaces_the_last_figures(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("benchmarks.__main__.QUICK_FOLDER", tmp_path)

    def run(program: str, options: Sequence[str]) -> tuple[int, str]:
        write_figures(one(Kind.RATE, "9/20"), Path(options[-1]))
        return 0, ""

    assert main(["--quick", "--update", "goal/goal_table"], run) == 0
    assert main(["--quick", "--check", "goal/goal_table"], run) == 0
    assert main(["--quick", "--check", "goal/goal_frame"], run) == 1  # nothing to compare with


def test_an_unknown_program_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["goal/other"])
    assert left.value.code == 2
    assert "no program 'goal/other'" in capsys.readouterr().err
