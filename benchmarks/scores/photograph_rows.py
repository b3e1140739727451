"""A row of figures measured on photographs that are no part of the project, and where those lie.

A program of rows is a module with a tuple `ROWS` of functions; `real_photographs` prints what each returns, which is
None where its photographs are not installed.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import ParamSpec

import cv2
import numpy as np

from benchmarks.harness import DEFAULT_SEED
from field_models import load_field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera import load_camera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.files.csv_table import read_poses
from robocup_vision.geometry import Pose2
from robocup_vision.view import View
from robocup_vision.vision import Vision

REAL = Path(__file__).resolve().parents[3] / "shared" / "real"
Arguments = ParamSpec("Arguments")
# of the small-size robot: its photographs, and one half of its field, in a laboratory
ONBOARD = ("onboard_ssl", "onboard_ssl_more")
ONBOARD_FIELD = Path(__file__).resolve().parents[2] / "tests" / "data" / "onboard_ssl_half_field.toml"
HAND_PICKED = "line_points_a_center.csv"
# of the priors that are drawn: x, y (m), heading (rad)
PRIOR_STD = np.array([0.1, 0.1, math.radians(5.0)])


@dataclass(frozen=True, slots=True)
class PhotographRow:
    """What was measured, against what it is to be."""

    #: as printed
    name: str
    measured: str
    target: str
    is_met: bool  #: whether the target is met


def needs(
    *folders: str,
) -> Callable[[Callable[Arguments, PhotographRow | None]], Callable[Arguments, PhotographRow | None]]:
    """Let a function of a row return None where one of these folders is not installed."""

    def decorate(measure: Callable[Arguments, PhotographRow | None]) -> Callable[Arguments, PhotographRow | None]:
        @wraps(measure)
        def row(*arguments: Arguments.args, **named: Arguments.kwargs) -> PhotographRow | None:
            return measure(*arguments, **named) if all((REAL / one).is_dir() for one in folders) else None

        return row

    return decorate


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


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A look at a photograph, its known pose, and the prior that it was given."""

    name: str
    view: View
    truth: Pose2 | None = None
    prior: PoseEstimate | None = None


def looks(
    vision: Vision,
    frames: Iterable[tuple[str, UInt8Array]],
    truths: Mapping[str, Pose2] | None = None,
    priors: int = 0,
    rng: np.random.Generator | None = None,
) -> Iterator[Look]:
    """Look at photographs, each by itself: once, or with so many priors drawn about its known pose."""
    rng = rng or np.random.default_rng(DEFAULT_SEED)
    for name, frame in frames:
        truth = None if truths is None else truths.get(name)
        for _ in range(max(priors, 1)):
            vision.forget()
            prior = drawn_prior(truth, rng) if priors and truth is not None else None
            yield Look(name, vision.look(frame, prior=prior), truth, prior)


def onboard_looks(priors: int = 0, method: str | None = None) -> Iterator[Look]:
    """Look by the small-size robot's camera at the photographs whose pose is known."""
    rng = np.random.default_rng(DEFAULT_SEED)
    for folder in ONBOARD:
        truths = known_poses(folder)
        vision = Vision(load_field(ONBOARD_FIELD), load_camera(REAL / folder / "camera.toml"), method=method)
        known = ((name, frame) for name, frame in photographs(folder) if name in truths)
        yield from looks(vision, known, truths, priors, rng)


def hand_picked_px(folder: str) -> FloatArray | None:
    """Return the pixels (N, 2) of lines that somebody picked in a photograph; None where nobody did."""
    if not (REAL / folder / HAND_PICKED).is_file():
        return None
    return np.array([[float(row["u_px"]), float(row["v_px"])] for row in table_of(folder, HAND_PICKED)])


def table_of(folder: str, name: str) -> list[dict[str, str]]:
    """Return the rows of a csv file beside the photographs."""
    with (REAL / folder / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
