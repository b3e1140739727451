"""A row of figures measured on photographs that are no part of the project, and where those lie.

A program of rows is a module with a tuple `ROWS` of functions; `real_photographs` prints what each returns.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array

REAL = Path(__file__).resolve().parents[3] / "shared" / "real"


@dataclass(frozen=True, slots=True)
class PhotographRow:
    """What was measured, against what it is to be.

    Parameters
    ----------
    name, measured, target : str
        As printed.
    is_met : bool
        Whether the target is met.
    """

    name: str
    measured: str
    target: str
    is_met: bool


def photographs(folder: str) -> Iterator[tuple[str, UInt8Array]]:
    """Yield name and frame of each photograph in a folder, by name; none where it is not installed."""
    where = REAL / folder / "images"
    for path in sorted(where.iterdir()) if where.is_dir() else ():
        yield path.name, np.asarray(cv2.imread(str(path), cv2.IMREAD_COLOR), dtype=np.uint8)


def table_of(folder: str, name: str) -> list[dict[str, str]]:
    """Return the rows of a csv file beside the photographs."""
    with (REAL / folder / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
