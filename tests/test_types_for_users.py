"""A user's project checks strictly: programs of README, docs/ and examples/, against the files that a wheel holds."""

import os
import re
import shutil
import subprocess
import sys

import pytest
from pages import DOCS, PAGES, ROOT, blocks

PROGRAMS = {
    f"page_{page.stem}_{number}.py": program
    for page in PAGES
    if page.name == "README.md" or page.is_relative_to(DOCS)
    for number, program in enumerate(blocks(page, "python"))
}


@pytest.fixture(scope="module")
def unpacked_wheel(tmp_path_factory):
    """Return a folder of the files that a wheel holds, made by the setuptools that is installed."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    hidden = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for package in ("field_models", "robocup_vision", "sim2d"):
        shutil.copytree(ROOT / package, source / package, ignore=hidden)
    shutil.copy(ROOT / "README.md", source)
    # an older setuptools does not know the licence's form, which changes no file of the packages
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (source / "pyproject.toml").write_text(re.sub(r"^license.*\n", "", project, flags=re.MULTILINE), encoding="utf-8")
    build = ["-c", "from setuptools import setup; setup()", "build_py", "--build-lib", str(folder / "site")]
    done = subprocess.run([sys.executable, *build], cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (folder / "site" / "robocup_vision" / "py.typed").is_file()
    return folder / "site"


@pytest.mark.slow
def test_programs_are_right_for_a_type_checker(unpacked_wheel, tmp_path):
    """Only this finds types that are wrong for who installs the package."""
    assert len(PROGRAMS) > 15
    for name, program in PROGRAMS.items():
        (tmp_path / name).write_text(program, encoding="utf-8")
    for path in (ROOT / "examples").glob("*.py"):
        shutil.copy(path, tmp_path)
    files = sorted(path.name for path in tmp_path.glob("*.py"))
    # as of an installed package, only what the user's own files do is told
    (tmp_path / "mypy.ini").write_text("[mypy]\nstrict = true\nfollow_imports = silent\n", encoding="utf-8")
    run = subprocess.run(
        [sys.executable, "-m", "mypy", "--cache-dir", str(tmp_path / "cache"), *files],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": "", "MYPYPATH": str(unpacked_wheel)},
    )
    assert run.returncode == 0, run.stdout
