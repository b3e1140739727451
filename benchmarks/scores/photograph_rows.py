"""A row of figures measured on photographs that are no part of the project, and where those lie.

A program of rows is a module with a tuple `ROWS` of functions; `real_photographs` prints what each returns.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.estimates import PoseEstimate
from robocup_vision.files.csv_table import read_poses
from robocup_vision.geometry import Pose2

REAL = Path(__file__).resolve().parents[3] / "shared" / "real"
# of the small-size robot: one half of it, in a laboratory
ONBOARD_FIELD = Path(__file__).resolve().parents[2] / "tests" / "data" / "onboard_ssl_half_field.toml"
# of the priors that are drawn: x, y (m), heading (rad)
PRIOR_STD = np.array([0.1, 0.1, math.radians(5.0)])


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


def photographs_of_other_things(size_px: tuple[int, int]) -> Iterator[UInt8Array]:
    """Yield each photograph of something that is no field, scaled to a camera's size; none if not installed."""
    for _, frame in photographs("negatives"):
        yield np.asarray(cv2.resize(frame, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def known_poses(folder: str) -> dict[str, Pose2]:
    """Return the known pose of each photograph that has one."""
    return read_poses(REAL / folder / "truth.csv", [path.name for path in (REAL / folder / "images").iterdir()])


def drawn_prior(pose: Pose2, rng: np.random.Generator) -> PoseEstimate:
    """Return a prior drawn about a known pose."""
    x, y, theta = (pose.array + rng.normal(0.0, PRIOR_STD)).tolist()
    return PoseEstimate(Pose2(x, y, theta), np.diag(PRIOR_STD**2), 1.0, 0.0)


def table_of(folder: str, name: str) -> list[dict[str, str]]:
    """Return the rows of a csv file beside the photographs."""
    with (REAL / folder / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
