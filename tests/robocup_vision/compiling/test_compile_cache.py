"""Loops are compiled and kept wherever the library is installed, read-only and without a home folder, too."""

import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import numba
import pytest

import field_models
import robocup_vision
from field_models.errors import RobocupVisionError
from robocup_vision.compiling.compile_cache import CompileCacheWarning, ensure_compile_cache, remove_stale_loops

LOOP = """
import numpy as np
from robocup_vision.kernels.algebra.three import adjugate_3x3
print(adjugate_3x3(np.eye(3), np.empty((3, 3))))
"""


@pytest.fixture
def kernels(tmp_path):
    """Return a folder of loops beside which nothing can be written, not even by root."""
    folder = tmp_path / "kernels"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "__pycache__").touch()
    return folder


@pytest.fixture
def homeless(tmp_path, monkeypatch):
    """Make sure that nothing can be written under the user's home, and that temporary files go to a known place."""
    nowhere, temporary = tmp_path / "nowhere", tmp_path / "temporary"
    nowhere.touch()
    temporary.mkdir()
    monkeypatch.setenv("HOME", str(nowhere))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    return temporary


def test_a_temporary_folder_is_used_and_told_once(kernels, homeless):
    with pytest.warns(CompileCacheWarning, match=f"{kernels}.*{homeless}.*NUMBA_CACHE_DIR"):
        ensure_compile_cache(kernels)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ensure_compile_cache(kernels)
    folder = Path(numba.config.CACHE_DIR)
    assert folder.parent == homeless
    assert folder.stat().st_mode & 0o077 == 0
    assert os.environ["NUMBA_CACHE_DIR"] == str(folder)


def test_the_next_start_finds_the_same_folder(kernels, homeless, monkeypatch):
    with pytest.warns(CompileCacheWarning):
        ensure_compile_cache(kernels)
    first = numba.config.CACHE_DIR
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    with pytest.warns(CompileCacheWarning):
        ensure_compile_cache(kernels)
    assert first == numba.config.CACHE_DIR


def test_a_folder_that_others_can_write_is_not_trusted(kernels, homeless):
    planted = homeless / f"robocup_vision-compiled-{os.getuid()}"
    planted.mkdir()
    planted.chmod(0o777)
    with pytest.warns(CompileCacheWarning):
        ensure_compile_cache(kernels)
    assert Path(numba.config.CACHE_DIR).parent == homeless
    assert Path(numba.config.CACHE_DIR) != planted


def test_the_variable_is_followed(kernels, homeless, tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "named"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ensure_compile_cache(kernels)
    assert str(tmp_path / "named") == numba.config.CACHE_DIR
    assert not list(homeless.iterdir())


def test_a_named_folder_that_cannot_be_written_is_told(kernels, homeless, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", f"{homeless.parent}/nowhere/cache")
    with pytest.warns(CompileCacheWarning, match="NUMBA_CACHE_DIR=.*/nowhere/cache cannot be written"):
        ensure_compile_cache(kernels)


def test_a_writable_place_is_left_to_numba(kernels, homeless):
    (kernels / "__pycache__").unlink()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ensure_compile_cache(kernels)
    assert numba.config.CACHE_DIR == ""


def test_no_place_at_all_is_one_line(kernels, homeless, monkeypatch):
    def refuse(*_, **__):
        raise FileNotFoundError("no usable temporary directory")

    monkeypatch.setattr("tempfile.gettempdir", refuse)
    with pytest.raises(RobocupVisionError, match=r"no folder for compiled code.*NUMBA_CACHE_DIR"):
        ensure_compile_cache(kernels)


def indexes(kernels):
    return sorted(path.name for path in (kernels / "__pycache__").glob("*.nbi"))


def test_loops_of_other_sources_are_removed(kernels, homeless, tmp_path):
    (kernels / "__pycache__").unlink()
    (kernels / "__pycache__").mkdir()
    (kernels / "room").mkdir()
    constants, package = kernels / "room" / "constants.py", f"{tmp_path.name}.kernels"
    (kernels / "alone.py").write_text("SIZE = 1\n", encoding="ascii")
    (kernels / "loop.py").write_text(f"from {package}.middle import (\n    MORE,\n)\n", encoding="ascii")
    (kernels / "middle.py").write_text(f"from {package}.room import constants\n", encoding="ascii")
    constants.write_text("SIZE = 1\n", encoding="ascii")
    every = ["alone.f-1.nbi", "loop.f-1.nbi", "middle.f-1.nbi"]
    for changed, left in (
        (kernels / "alone.py", every[1:]),
        (kernels / "middle.py", every[:1]),
        (constants, every[:1]),
        (kernels / "loop.py", [every[0], every[2]]),
    ):
        remove_stale_loops(kernels)
        for name in every:
            (kernels / "__pycache__" / name).touch()
        remove_stale_loops(kernels)
        assert indexes(kernels) == every
        changed.write_text(changed.read_text(encoding="ascii") + "OTHER = 2\n", encoding="ascii")
        remove_stale_loops(kernels)
        assert indexes(kernels) == left


def test_loops_that_cannot_be_removed_are_left(kernels, homeless, monkeypatch):
    (kernels / "__pycache__").unlink()
    (kernels / "__pycache__").mkdir()
    (kernels / "__pycache__" / "loop.nbi").touch()

    def refuse(*_, **__):
        raise PermissionError("read-only")

    monkeypatch.setattr(Path, "unlink", refuse)
    remove_stale_loops(kernels)
    assert indexes(kernels) == ["loop.nbi"]
    assert not (kernels / "__pycache__" / "loops.json").exists()


@pytest.mark.slow
def test_loops_compile_in_a_read_only_installation(tmp_path, homeless):
    for package in (robocup_vision, field_models):
        source = Path(package.__file__).parent
        shutil.copytree(source, tmp_path / source.name, ignore=shutil.ignore_patterns("__pycache__"))
    for init in (tmp_path / "robocup_vision" / "kernels").rglob("__init__.py"):
        (init.parent / "__pycache__").touch()
    done = subprocess.run(
        [sys.executable, "-c", LOOP], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.stdout == "1.0\n", done.stderr
    assert done.stderr.count("CompileCacheWarning") == 1
    assert list(homeless.glob("robocup_vision-compiled-*/*/*.nbc"))
