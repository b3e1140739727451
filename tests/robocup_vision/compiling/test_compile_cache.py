"""Loops are compiled and kept wherever the library is installed, read-only and without a home folder, too."""

import importlib
import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import numba
import pytest

import field_models
import robocup_vision
from field_models.errors import RobocupVisionError
from robocup_vision.compiling import compile_cache
from robocup_vision.compiling.compile_cache import (
    CompileCacheWarning,
    JitStaysOnWarning,
    ensure_compile_cache,
    source_digest,
)

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


@pytest.fixture
def make_package(tmp_path, monkeypatch):
    """Return a function that writes modules of a package of loops, and imports one of them anew."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(compile_cache, "_LOOPS", ("probe_kernels",))
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    folder = tmp_path / "probe_kernels"
    (folder / "room").mkdir(parents=True)
    (folder / "__init__.py").touch()
    (folder / "room" / "__init__.py").touch()

    def import_anew(name, **texts):
        for module, text in texts.items():
            (folder / f"{module.replace('__', '/')}.py").write_text(text, encoding="ascii")
        for known in [known for known in sys.modules if known.startswith("probe_kernels")]:
            del sys.modules[known]
        source_digest.cache_clear()
        importlib.invalidate_caches()
        return importlib.import_module(f"probe_kernels.{name}")

    yield import_anew
    for known in [known for known in sys.modules if known.startswith("probe_kernels")]:
        del sys.modules[known]
    source_digest.cache_clear()


LOOPS = {
    "alone": "SIZE = 1\n",
    "room__constants": "SIZE = 1\n",
    "middle": "from probe_kernels.room import constants\nMORE = constants.SIZE\n",
    "loop": "from probe_kernels.middle import (\n    MORE,\n)\n",
}


@pytest.mark.parametrize(
    ("changed", "stale"),
    [
        ("alone", {"alone"}),
        ("room__constants", {"room__constants", "middle", "loop"}),
        ("middle", {"middle", "loop"}),
        ("loop", {"loop"}),
    ],
)
def test_what_imports_a_changed_source_is_told_from_what_does_not(make_package, changed, stale):
    names = {module: f"probe_kernels.{module.replace('__', '.')}" for module in LOOPS}
    make_package("loop", **LOOPS)
    importlib.import_module("probe_kernels.alone")
    before = {module: source_digest(name) for module, name in names.items()}
    make_package("loop", **{changed: LOOPS[changed] + "OTHER = 2\n"})
    importlib.import_module("probe_kernels.alone")
    after = {module: source_digest(name) for module, name in names.items()}
    assert None not in before.values()
    assert {module for module in LOOPS if before[module] != after[module]} == stale


def test_code_of_no_file_has_no_digest():
    assert source_digest("no_such_module") is None
    assert source_digest("sys") is None


def test_a_loop_is_compiled_anew_for_a_changed_constant_of_another_file_and_kept_for_copied_files(make_package):
    loop = "from probe_kernels.room.constants import SIZE\n{}\n\n@compiled\ndef size():\n    return SIZE\n"
    loop = loop.format("from robocup_vision.compiling.loops import compiled")
    first = make_package("loop", room__constants="SIZE = 1\n", loop=loop)
    assert first.size() == 1
    changed = make_package("loop", room__constants="SIZE = 2\n")
    assert changed.size() == 2
    os.utime(changed.__file__, (1e9, 1e9))
    again = make_package("loop")
    assert again.size() == 2
    assert sum(again.size.stats.cache_hits.values()) == 1


def test_a_loop_whose_kept_types_name_a_class_that_is_no_more_is_compiled_anew(make_package):
    loop = "from probe_kernels.alone import {0}\nfrom robocup_vision.compiling.loops import compiled\n\n"
    loop += "@compiled\ndef size(pair):\n    return pair.left\n\n\nPAIR = {0}(1, 2)\n"
    pair = "from typing import NamedTuple\n\n\nclass {}(NamedTuple):\n    left: int\n    right: int\n"
    first = make_package("loop", alone=pair.format("Pair"), loop=loop.format("Pair"))
    assert first.size(first.PAIR) == 1
    renamed = make_package("loop", alone=pair.format("Couple"), loop=loop.format("Couple"))
    assert renamed.size(renamed.PAIR) == 1


def test_loops_that_came_with_an_installation_that_cannot_be_written_are_taken_along(kernels, tmp_path, monkeypatch):
    (kernels / "__pycache__").unlink()
    own, users = kernels / "__pycache__", tmp_path / "users"
    own.mkdir()
    probe = SimpleNamespace(stats=SimpleNamespace(cache_path=str(users)))
    monkeypatch.setattr(compile_cache, "_probe", lambda source: probe)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    ensure_compile_cache(kernels)
    assert not users.exists()
    for name, text in (("loop.nbi", "index"), ("loop.1.nbc", "code"), ("loop.pyc", "other")):
        (own / name).write_text(text, encoding="ascii")
    ensure_compile_cache(kernels)
    assert sorted(path.name for path in users.iterdir()) == ["loop.1.nbc", "loop.nbi"]
    # what was compiled here since stays, until another installation comes
    (users / "loop.nbi").write_text("more", encoding="ascii")
    ensure_compile_cache(kernels)
    assert (users / "loop.nbi").read_text(encoding="ascii") == "more"
    later = (users / "loop.nbi").stat().st_mtime + 10
    os.utime(own / "loop.nbi", (later, later))
    ensure_compile_cache(kernels)
    assert (users / "loop.nbi").read_text(encoding="ascii") == "index"

    def refuse(*_, **__):
        raise OSError("no space left")

    monkeypatch.setattr("shutil.copyfile", refuse)
    os.utime(own / "loop.nbi", (later + 10, later + 10))
    ensure_compile_cache(kernels)
    assert (users / "loop.nbi").read_text(encoding="ascii") == "index"


@pytest.mark.slow
def test_loops_compile_in_a_read_only_installation(tmp_path, homeless):
    """Only this finds a package in a folder that nobody may write whose loops do not start."""
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


def test_compiling_that_is_disabled_is_enabled_and_told(kernels, monkeypatch):
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    with pytest.warns(JitStaysOnWarning, match="NUMBA_DISABLE_JIT is not obeyed"):
        ensure_compile_cache(kernels)
    assert not numba.config.DISABLE_JIT
