"""Errors on files to be written: one line that names the file and why."""

from pathlib import Path

import pytest

from field_models.errors import FileError
from robocup_vision.files.output_folder import require_folder, telling_write_errors


def test_an_error_of_the_system_names_the_file_and_the_reason(tmp_path: Path) -> None:
    out = tmp_path / "absent" / "out.csv"
    told = pytest.raises(FileError, match=r"out\.csv: cannot be written \(No such file or directory\)")
    with told, telling_write_errors(out):
        out.write_text("x")


def test_other_errors_pass_through(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), telling_write_errors(tmp_path / "out.csv"):
        raise ZeroDivisionError


def test_a_folder_that_is_not_there_is_told_before_the_work(tmp_path: Path) -> None:
    require_folder(tmp_path / "out.csv")
    with pytest.raises(FileError, match="its folder does not exist"):
        require_folder(tmp_path / "absent" / "out.csv")
