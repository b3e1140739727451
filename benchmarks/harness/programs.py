"""The programs of this folder: which there are, and how to run one."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_NO_PROGRAMS = ("harness", "worlds", "scores")


def program_names() -> list[str]:
    """All programs, FOLDER/NAME."""
    files = sorted((ROOT / "benchmarks").glob("*/*.py"))
    return [f"{f.parent.name}/{f.stem}" for f in files if f.stem != "__init__" and f.parent.name not in _NO_PROGRAMS]


def run_program(name: str, arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run a program in a process of its own, from the repository's root; what it prints is kept."""
    module = "benchmarks." + name.replace("/", ".")
    return subprocess.run(
        [sys.executable, "-m", module, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )


def sources_digest() -> str:
    """Return a digest of all sources and tables of library, field models and simulator: figures are of these."""
    digest = hashlib.sha256()
    for package in ("field_models", "robocup_vision", "sim2d"):
        for path in sorted((ROOT / package).rglob("*")):
            if path.suffix in (".py", ".toml", ".json", ".npy", ".npz"):
                digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()
