"""A wheel that holds compiled loops is a right wheel for this kind of machine, and errors are one line."""

import sys
from zipfile import ZipFile

import pytest
from wheel.wheelfile import WheelFile

from field_models.errors import FileError, RobocupVisionError
from robocup_vision import cli
from robocup_vision.compiling.compiled_wheel import compile_wheel

# stands for the library: "compiles" where numba would, and fails for seven processes
CLI = """
import os
from pathlib import Path

def main(arguments):
    folder = Path(__file__).parent / "kernels" / "__pycache__"
    folder.mkdir(parents=True)
    (folder / "loop.nbi").write_text(" ".join(arguments) + os.environ.get("NUMBA_CACHE_DIR", ""))
    return int(arguments[-1] == "7")
"""
TOLD = "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
NAME = "robocup_vision-0.2.0-py3-none-any.whl"


@pytest.fixture
def wheel(tmp_path):
    """Return a small wheel with this library's name."""
    path = tmp_path / NAME
    with WheelFile(path, "w") as made:
        made.writestr("robocup_vision/__init__.py", "")
        made.writestr("robocup_vision/cli.py", CLI)
        made.writestr("robocup_vision-0.2.0.dist-info/WHEEL", TOLD)
        made.writestr("robocup_vision-0.2.0.dist-info/METADATA", "Name: robocup-vision\nVersion: 0.2.0\n")
    return path


def test_the_new_wheel_holds_loops_and_says_for_which_machines(wheel, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "elsewhere"))
    assert cli.main(["warm-up", "--wheel", str(wheel), "--jobs", "1"]) == 0
    (compiled,) = tmp_path.glob("*-cp*.whl")
    assert capsys.readouterr().out == f"{compiled}\n"
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert compiled.name.startswith(f"robocup_vision-0.2.0-{python}-{python}-")
    # reading checks each file's digest
    with WheelFile(compiled) as read:
        assert read.read("robocup_vision/kernels/__pycache__/loop.nbi") == b"warm-up --jobs 1"
        told = read.read("robocup_vision-0.2.0.dist-info/WHEEL").decode()
    assert f"Tag: {compiled.stem.split('-', 2)[2]}\n" in told
    assert "Root-Is-Purelib: false" in told
    with ZipFile(compiled) as files:
        assert not [name for name in files.namelist() if name.endswith(".pyc")]


def test_loops_that_cannot_be_compiled_leave_no_wheel(wheel, tmp_path):
    with pytest.raises(RobocupVisionError, match="could not be compiled"):
        compile_wheel(wheel, 7)
    assert [path.name for path in tmp_path.iterdir()] == [NAME]


def test_another_wheel_is_refused_by_name(tmp_path):
    with pytest.raises(FileError, match=r"numpy-2\.0-py3-none-any\.whl.*must be a wheel of this library"):
        compile_wheel(tmp_path / "numpy-2.0-py3-none-any.whl", 1)


def test_a_wheel_that_is_not_there_or_broken_is_told(tmp_path):
    with pytest.raises(FileError, match=f"{NAME}.*cannot be read"):
        compile_wheel(tmp_path / NAME, 1)
    (tmp_path / NAME).write_bytes(b"no archive")
    with pytest.raises(FileError, match=f"{NAME}.*cannot be read"):
        compile_wheel(tmp_path / NAME, 1)


def test_the_missing_package_is_named(wheel, monkeypatch):
    monkeypatch.setitem(sys.modules, "wheel.wheelfile", None)
    with pytest.raises(RobocupVisionError, match="pip install wheel"):
        compile_wheel(wheel, 1)
