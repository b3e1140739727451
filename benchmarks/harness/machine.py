"""The machine and the versions that figures depend on."""

from __future__ import annotations

import math
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = ("numpy", "opencv-python-headless", "numba")


def machine() -> str:
    """Name of the processor, and how many there are."""
    return f"{_cpu()}, {os.cpu_count()} CPUs"


def versions() -> dict[str, str]:
    """Version of Python and of the packages that do the arithmetic."""
    return {"Python": platform.python_version(), **{name: _version(name) for name in _PACKAGES}}


def resident_mb(process: int | str = "self") -> float:
    """Return what a process, this one unless named, holds in memory; NaN where the system does not tell."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return math.nan
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def describe(machine: str, versions: dict[str, str]) -> str:
    """Join machine and versions into one line."""
    return f"{machine}; " + ", ".join(f"{name} {number}" for name, number in versions.items())


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
