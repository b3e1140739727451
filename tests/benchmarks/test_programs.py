"""Every program in benchmarks/ says what it measures, stands in the page, has quick figures, and tells its options."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.__main__ import PAGES
from benchmarks.harness import programs
from benchmarks.harness.figures import FOLDER, QUICK_FOLDER, read_figures
from benchmarks.harness.markdown import page_programs, render_page
from benchmarks.harness.programs import ROOT, program_names

PROGRAMS = program_names()


def test_there_are_programs() -> None:
    assert "mirror/omni_accuracy" in PROGRAMS
    assert not [name for name in PROGRAMS if name.startswith(("harness", "worlds", "scores"))]


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_says_what_it_measures(name: str) -> None:
    tree = ast.parse((ROOT / "benchmarks" / f"{name}.py").read_text(encoding="utf-8"))
    docstring = ast.get_docstring(tree) or ""
    first, _, rest = docstring.partition("\n")
    assert first.endswith(".")
    assert rest.strip()
    assert [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "main"]


def test_the_index_lists_each_program_whose_page_shows_its_figures() -> None:
    index = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    assert [name for name in PROGRAMS if f"\n| [{name}](../docs/benchmarks/{name}.md) |" not in index] == []
    for name in PROGRAMS:
        assert page_programs((ROOT / "docs" / "benchmarks" / f"{name}.md").read_text(encoding="utf-8")) == [name]


@pytest.mark.parametrize("folder", [FOLDER, QUICK_FOLDER], ids=["default", "quick"])
def test_figures_of_each_program_and_of_no_other_are_kept(folder: Path) -> None:
    files = [path for path in folder.glob("*/*.json") if path.parent != QUICK_FOLDER]
    assert sorted(f"{path.parent.name}/{path.stem}" for path in files) == sorted(PROGRAMS)
    for path in files:
        figures = read_figures(path)
        assert figures.program == f"{path.parent.name}/{path.stem}"
        assert figures.tables
        if folder == QUICK_FOLDER:
            assert (figures.size, figures.origin) == ("quick", "run")


@pytest.mark.parametrize("page", PAGES)
def test_pages_show_the_figures_that_are_kept(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert render_page(text) == text, "run `make figures`"


ALL_HELP = """
import contextlib, importlib, io, sys
for name in sys.argv[1:]:
    said, sys.argv = io.StringIO(), [name, "--help"]
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(said):
        importlib.import_module("benchmarks." + name.replace("/", ".")).main()
    missing = {"--quick", "--full", "--check", "--seed", "--json"} - set(said.getvalue().replace("]", " ").split())
    if missing:
        print(name, sorted(missing))
"""


@pytest.mark.slow
def test_each_program_prints_its_options() -> None:
    """Only this finds a program whose options or help texts cannot be read."""
    command = [sys.executable, "-c", ALL_HELP, *PROGRAMS]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


@pytest.mark.slow
def test_a_program_runs_as_a_file_and_as_a_module(tmp_path: Path) -> None:
    """Only this finds a program that one of the two ways of starting it cannot run, or names otherwise."""
    file, module = ROOT / "benchmarks" / "goal" / "goal_sensitivity.py", "benchmarks.goal.goal_sensitivity"
    for number, command in enumerate(([str(file)], ["-m", module])):
        path = tmp_path / f"{number}.json"
        done = subprocess.run(
            [sys.executable, *command, "--quick", "--json", str(path)],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
    first, second = (read_figures(tmp_path / f"{number}.json") for number in (0, 1))
    assert first.tables == second.tables
    assert first.program == second.program == "goal/goal_sensitivity"


def test_a_digest_is_of_sources_and_tables_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(programs, "ROOT", tmp_path)
    source = tmp_path / "robocup_vision" / "vision.py"
    source.parent.mkdir()
    source.write_text("A = 1\n", encoding="ascii")
    before = programs.sources_digest()
    (source.parent / "vision.pyc").write_text("cached", encoding="ascii")
    assert programs.sources_digest() == before
    source.write_text("A = 2\n", encoding="ascii")
    assert programs.sources_digest() != before
