"""The folder of a run's files: made where it is missing, cleared of an earlier run's files and of nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from field_models.errors import FileError
from robocup_vision.evaluation.result_files import prepare_folder


def test_a_missing_folder_is_made_with_those_it_lies_in(tmp_path: Path) -> None:
    folder = tmp_path / "out" / "run"
    prepare_folder(folder, ("figures.json",))
    assert list(folder.iterdir()) == []


def test_files_of_an_earlier_run_go_and_all_else_stays(tmp_path: Path) -> None:
    for name in ("figures.json", "report.html", "notes.txt"):
        (tmp_path / name).write_text("kept?")
    prepare_folder(tmp_path, ("figures.json", "report.html", "film.webm"))
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_what_is_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match=r"file: cannot be written \(File exists\)"):
        prepare_folder(tmp_path / "file", ())
    (tmp_path / "figures.json").mkdir()
    # a folder of a file's name; how that is called differs between systems
    with pytest.raises(FileError, match=r"cannot be written \(.+\)"):
        prepare_folder(tmp_path, ("figures.json",))
