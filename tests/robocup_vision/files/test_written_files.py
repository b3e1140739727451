"""Files that are written: folders at once or not at all, unfinished runs, errors that name the file."""

from __future__ import annotations

import errno
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from field_models.errors import FileError
from robocup_vision.files.images import write_png
from robocup_vision.files.output_folder import (
    refuse_foreign_files,
    require_folder,
    telling_write_errors,
    written_at_once,
)
from robocup_vision.files.resume_file import ResumeFile
from robocup_vision.files.text_files import write_json, write_lines, write_text

OWN = ("figures.json", "robot_*.mcap")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_files_of_others_are_refused(tmp_path: Path) -> None:
    refuse_foreign_files(tmp_path / "absent", OWN)
    for name in ("figures.json", "robot_3.mcap", ".gitignore"):
        (tmp_path / name).touch()
    refuse_foreign_files(tmp_path, OWN)
    (tmp_path / "notes.txt").touch()
    with pytest.raises(FileError, match=r"holds files of others \(notes\.txt\), nothing was written.*--force"):
        refuse_foreign_files(tmp_path, OWN)
    (tmp_path / "thesis").mkdir()
    with pytest.raises(FileError, match=r"\(notes\.txt and 1 more\)"):
        refuse_foreign_files(tmp_path, OWN)
    with pytest.raises(FileError, match=r"notes\.txt: cannot be written \(.+\)"):
        refuse_foreign_files(tmp_path / "notes.txt", OWN)


def test_a_new_folder_appears_when_all_is_written(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    with written_at_once(out, OWN) as work:
        (work / "images").mkdir()
        (work / "figures.json").touch()
        assert not out.exists()
    assert names(out) == ["figures.json", "images"]
    assert names(out.parent) == ["out"]


def test_files_of_an_earlier_run_are_replaced_and_all_else_stays(tmp_path: Path) -> None:
    for name in ("figures.json", "robot_0.mcap", "notes.txt"):
        (tmp_path / name).write_text("old")
    with written_at_once(tmp_path, OWN) as work:
        (work / "figures.json").write_text("new")
        assert (tmp_path / "figures.json").read_text() == "old"
    assert names(tmp_path) == ["figures.json", "notes.txt"]
    assert (tmp_path / "figures.json").read_text() == "new"


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_failure_leaves_the_folder_as_it_was(tmp_path: Path, error: type[BaseException]) -> None:
    def fail(folder: Path) -> None:
        with written_at_once(folder, OWN) as work:
            (work / "figures.json").write_text("half")
            raise error

    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "figures.json").write_text("old")
    for folder in (tmp_path / "deep" / "new", tmp_path / "kept"):
        with pytest.raises(error):
            fail(folder)
    assert names(tmp_path) == ["kept"]
    assert names(tmp_path / "kept") == ["figures.json"]
    assert (tmp_path / "kept" / "figures.json").read_text() == "old"


def test_what_is_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match=r"file: cannot be written \(.+\)"), written_at_once(tmp_path / "file", OWN):
        pass
    (tmp_path / "figures.json").mkdir()
    with pytest.raises(FileError, match=r"cannot be written \(.+\)"), written_at_once(tmp_path, OWN) as work:
        (work / "figures.json").touch()


def full_disk(path: Path) -> None:
    raise OSError(errno.ENOSPC, "No space left on device", str(path))


def full_disk_as_a_writer_tells_it(path: Path) -> None:
    with telling_write_errors(path):
        full_disk(path)


@pytest.mark.parametrize("write", [full_disk, full_disk_as_a_writer_tells_it])
@pytest.mark.parametrize("folder_is_there", [False, True])
def test_a_full_disk_is_told_with_the_file_that_the_user_knows(
    tmp_path: Path, write: Callable[[Path], None], folder_is_there: bool
) -> None:
    out = tmp_path / "out"
    if folder_is_there:
        out.mkdir()
    with pytest.raises(FileError) as told, written_at_once(out, OWN) as work:
        write(work / "images" / "0003.png")
    assert str(told.value) == f"{out}/images/0003.png: cannot be written (No space left on device)"
    assert [path.name for path in tmp_path.rglob("*")] == ["out"] * folder_is_there


def test_an_error_about_a_file_elsewhere_keeps_its_name(tmp_path: Path) -> None:
    with pytest.raises(FileError) as told, written_at_once(tmp_path / "out", OWN):
        raise FileError(tmp_path / "field.toml", "must be positive", key="length_m", value=-1.0)
    assert str(told.value) == f"{tmp_path}/field.toml: key 'length_m': must be positive, got -1.0"


def test_an_error_of_the_system_names_the_file_and_the_reason(tmp_path: Path) -> None:
    out = tmp_path / "absent" / "out.csv"
    told = pytest.raises(FileError, match=r"out\.csv: cannot be written \(No such file or directory\)")
    with told, telling_write_errors(out):
        out.write_text("x")


@pytest.mark.parametrize(
    ("write", "value"),
    [
        (write_text, "x"),
        (write_lines, ["x"]),
        (write_json, {"x": 1}),
        (write_png, np.zeros((2, 3, 3), np.uint8)),
    ],
)
def test_a_writer_names_the_file_that_it_cannot_write(
    tmp_path: Path, write: Callable[[Path, Any], None], value: Any
) -> None:
    write(tmp_path / "out", value)
    assert (tmp_path / "out").stat().st_size > 0
    with pytest.raises(FileError, match=r"absent/out: cannot be written \(No such file or directory\)"):
        write(tmp_path / "absent" / "out", value)


def test_a_name_that_is_no_text_can_be_written(tmp_path: Path) -> None:
    write_lines(tmp_path / "out", ["a\udcff", "b"])
    assert (tmp_path / "out").read_text() == "a\\udcff\nb\n"


def test_other_errors_pass_through(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), telling_write_errors(tmp_path / "out.csv"):
        raise ZeroDivisionError


def test_a_folder_that_is_not_there_is_told_before_the_work(tmp_path: Path) -> None:
    require_folder(tmp_path / "out.csv")
    with pytest.raises(FileError, match="its folder does not exist"):
        require_folder(tmp_path / "absent" / "out.csv")


RUN = {"format": 1, "seed": 5}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return the file of a run that ended after two pieces."""
    file = tmp_path / "deep" / "unfinished.jsonl"
    with ResumeFile(file, RUN, resume=False) as kept:
        kept.add(3, {"score": [1, 0]})
        kept.add(0, 0.1)
    return file


def test_what_was_finished_is_found(path: Path) -> None:
    with path.open("a") as stream:
        stream.write('[7, {"sco')  # the machine went off
    for _ in range(2):
        with ResumeFile(path, RUN, resume=True) as kept:
            assert kept.found == {3: {"score": [1, 0]}, 0: 0.1}
    kept.delete()
    assert not path.exists()


def test_without_resume_it_begins_anew(path: Path) -> None:
    with ResumeFile(path, RUN, resume=False) as kept:
        assert kept.found == {}
    with ResumeFile(path, RUN, resume=True) as kept:
        assert kept.found == {}


def test_what_does_not_fit_is_named(path: Path) -> None:
    with pytest.raises(FileError, match=r"unfinished\.jsonl: is of another run: seed was 5, is now 6; begin anew"):
        ResumeFile(path, {**RUN, "seed": 6}, resume=True)
    for text in ("nonsense\n", '{"format": 1, "seed": 5}\n[1, 2, 3]\n', ""):
        path.write_text(text)
        with pytest.raises(FileError, match="is damaged; begin anew without --resume"):
            ResumeFile(path, RUN, resume=True)
    (path.parent / "file").touch()
    with pytest.raises(FileError, match="cannot be written"):
        ResumeFile(path.parent / "file" / "unfinished.jsonl", RUN, resume=False)
