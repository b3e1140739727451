"""What every benchmark shares: its arguments, its first line, its tables and its verdicts.

Run as ``python benchmarks/NAME.py [--quick|--full] [--check] [--seed N]``. Each acceptance row ends in "ok" or "SHORT";
with --check the exit status is 1 if a row is SHORT.
"""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

DEFAULT_SEED = 20010305
_PACKAGES = ("numpy", "opencv-python-headless", "numba")


def parse_arguments(description: str, argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Read the arguments that all benchmarks take, and print the first lines.

    Parameters
    ----------
    description : str
        What is measured: the benchmark's docstring. Its first line heads the output.
    argv : sequence of str, optional
        Those of the command line unless given.

    Returns
    -------
    Namespace
        ``quick``, ``full`` and ``check`` (bool), ``seed`` (int).
    """
    parser = argparse.ArgumentParser(
        description=description.strip(), formatter_class=argparse.RawDescriptionHelpFormatter
    )
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--quick", action="store_true", help="fewer samples: a first look")
    size.add_argument("--full", action="store_true", help="more samples: takes longer than 4 minutes")
    parser.add_argument("--check", action="store_true", help="exit status 1 if a row is SHORT")
    parser.add_argument("--seed", type=int, default=DEFAULT_SEED, metavar="N", help=f"default: {DEFAULT_SEED}")
    arguments = parser.parse_args(argv)
    print(description.strip().splitlines()[0])
    print(f"{system_line()}; seed {arguments.seed}")
    return arguments


def system_line() -> str:
    """One line on the machine and the versions that the figures depend on."""
    packages = ", ".join(f"{name} {_version(name)}" for name in _PACKAGES)
    return f"{_cpu()}, {os.cpu_count()} CPUs; Python {platform.python_version()}, {packages}"


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


class Table:
    """Prints rows as they come, under one line of column names.

    Parameters
    ----------
    columns : sequence of str
        Names; spaces around a name widen its column. The first column is set left, all others right.
    title : str, optional
        A line above.
    """

    def __init__(self, columns: Sequence[str], title: str = "") -> None:
        self._widths = [max(len(name), 6) for name in columns]
        print(f"\n{title}" if title else "")
        self.row(*(name.strip() for name in columns))
        print("  ".join("-" * width for width in self._widths), flush=True)

    def row(self, *cells: object) -> None:
        """Print one row: strings as they are, floats with three digits that count, None as a dash."""
        if len(cells) != len(self._widths):
            raise ValueError(f"a row must have {len(self._widths)} cells, got {len(cells)}")
        texts = [_text(cell) for cell in cells]
        first = texts[0].ljust(self._widths[0])
        rest = [text.rjust(width) for text, width in zip(texts[1:], self._widths[1:], strict=True)]
        print("  ".join([first, *rest]).rstrip(), flush=True)


def _text(cell: object) -> str:
    if cell is None:
        return "-"
    if isinstance(cell, float):
        return f"{cell:.0f}" if abs(cell) >= 100 else f"{cell:.3g}"
    return str(cell)


def percent(share: float | None) -> str:
    """Percentage of a share, never rounded up to 100; a dash for None."""
    if share is None:
        return "-"
    text = f"{100 * share:.2f}"
    return "100" if share == 1 else "99.99" if text == "100.00" else text


def verdict(ok: bool) -> str:
    """Return "ok" or "SHORT"."""
    return "ok" if ok else "SHORT"


def finish(check: bool, all_ok: bool) -> None:
    """Print the last line, and leave with status 1 if something is SHORT and `check` asks for it."""
    print("\nevery acceptance row is ok" if all_ok else "\nsome acceptance rows are SHORT")
    if check and not all_ok:
        raise SystemExit(1)
