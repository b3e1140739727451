"""Writes the result files of a run, for other programs: results.csv, steering.csv, summary.json and trajectory.tum.

It also prepares the folder of a run, and encodes kept results of an interrupted run.
"""

from __future__ import annotations

import csv
import hashlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from robocup_vision.closing import Closing
from robocup_vision.evaluation.dataset import Dataset, FrameTime
from robocup_vision.evaluation.detections import KindFigures
from robocup_vision.evaluation.overlays import Crop
from robocup_vision.evaluation.scoring import Figures, Row, pose_error
from robocup_vision.evaluation.steering import SteerPlan
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.files.text_files import write_json, write_lines
from robocup_vision.files.value_codec import ValueCodec

RESULT_COLUMNS = (
    "image",
    "status",
    "x_m",
    "y_m",
    "theta_rad",
    "std_x_m",
    "std_y_m",
    "std_theta_rad",
    "candidates",
    "inliers",
    "residual_px",
    "ms",
    "error_m",
    "error_rad",
    "reason",
)
STEERING_COLUMNS = (
    "image",
    "target_rad",
    "velocity_x_mps",
    "velocity_y_mps",
    "command_x_mps",
    "command_y_mps",
    "safe",
    "reason",
    "ms",
)
SUMMARY_KEYS = (
    "method",
    "images",
    "left_out",
    "with_truth",
    "located",
    "within_5cm_3deg",
    "within_10cm_5deg",
    "median_error_m",
    "rms_x_m",
    "rms_y_m",
    "rms_theta_rad",
    "nees_mean",
    "median_ms",
    "detections",
)
_MODULE = "robocup_vision.evaluation"
RESULT_CODEC = ValueCodec(
    {
        "FrameResult": __name__,
        "Row": f"{_MODULE}.scoring",
        "SteerResult": f"{_MODULE}.scoring",
        "Detection": f"{_MODULE}.detections",
        "Crop": f"{_MODULE}.overlays",
        "PoseEstimate": "robocup_vision.estimates",
        "Pose2": "robocup_vision.geometry",
    }
)


def prepare_folder(folder: Path, names: Iterable[str]) -> None:
    """Make a folder and its parents, and delete files of these names, which an earlier run has written into it.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    with telling_write_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        # otherwise the files of an earlier run would be taken for those of an interrupted one
        for name in names:
            (folder / name).unlink(missing_ok=True)


class RowsFile(Closing):
    """A table with one line per image, written to the file at once; `cells` returns the entries of a row.

    Raises
    ------
    FileError
        If it cannot be written.
    """

    def __init__(self, path: Path, columns: Sequence[str], cells: Callable[[Row], Sequence[str]]) -> None:
        self._path, self._cells = path, cells
        with telling_write_errors(path):
            # the name of an image may not be valid Unicode
            self._stream = path.open("w", encoding="utf-8", errors="backslashreplace", newline="")
        self._writer = csv.writer(self._stream, lineterminator="\n")
        self._write(columns)

    def add(self, row: Row) -> None:
        """Write an image's line."""
        self._write(self._cells(row))

    def _write(self, cells: Sequence[str]) -> None:
        with telling_write_errors(self._path):
            self._writer.writerow(cells)
            self._stream.flush()

    def close(self) -> None:
        """Close the file."""
        with telling_write_errors(self._path):
            self._stream.close()


def results_file(path: Path) -> RowsFile:
    """Open results.csv for writing."""
    return RowsFile(path, RESULT_COLUMNS, _cells)


def steering_file(path: Path) -> RowsFile:
    """Open steering.csv for writing."""
    return RowsFile(path, STEERING_COLUMNS, _steering_cells)


def _steering_cells(row: Row) -> list[str]:
    one = row.steering
    if one is None:
        return [row.image] + [""] * (len(STEERING_COLUMNS) - 1)
    numbers = map(_number, (one.target_bearing_rad, *one.velocity_mps, *one.command_mps))
    return [row.image, *numbers, "yes" if one.safe else "no", one.reason, _number(1e3 * one.time_s)]


def _cells(row: Row) -> list[str]:
    pose = [""] * 9
    if row.estimate is not None:
        estimate = row.estimate
        pose = [
            *map(_number, estimate.pose.array),
            *map(_number, estimate.std),
            str(len(estimate.candidates)),
            _number(estimate.inlier_ratio),
            _number(estimate.residual_px),
        ]
    error_m = row.error.position_m if row.error is not None else None
    error_rad = abs(row.error.theta_rad) if row.error is not None and row.error.theta_rad is not None else None
    ms = None if row.time_s is None else 1e3 * row.time_s
    return [row.image, row.status, *pose, _number(ms), _number(error_m), _number(error_rad), row.reason]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.9g}"


def write_summary(
    path: Path, figures: Figures, *, method: str, left_out: int, detections: dict[str, KindFigures] | None
) -> None:
    """Write summary.json; a figure without data is null."""
    found = None if detections is None else {kind: asdict(one) for kind, one in detections.items()}
    known: dict[str, object] = {"method": method, "left_out": left_out, "detections": found}
    values = {key: known[key] if key in known else getattr(figures, key) for key in SUMMARY_KEYS}
    write_json(path, values)


def write_trajectory(path: Path, rows: Sequence[Row], times: Mapping[str, FrameTime] | None) -> None:
    """Write trajectory.tum: ``t x y z qx qy qz qw`` for every located image.

    The time is that of the dataset's frames, or without times the image's row number in results.csv, from 0.
    """
    lines = []
    for index, row in enumerate(rows):
        if row.estimate is None:
            continue
        pose = row.estimate.pose
        t_s = float(index) if times is None else times[row.image].t_s
        qz, qw = math.sin(pose.theta_rad / 2), math.cos(pose.theta_rad / 2)
        # epoch seconds need all 17 digits of a float to keep their microseconds
        lines.append(f"{t_s!r} {pose.x_m:.9g} {pose.y_m:.9g} 0 0 0 {qz:.9g} {qw:.9g}")
    write_lines(path, lines)


@dataclass(frozen=True, slots=True)
class FrameResult:
    """A row of the results, and its pictures for the report."""

    row: Row  #: the row of the results
    jpeg: bytes | None = None  #: the encoded picture
    overlay_problem: str = ""  #: why its overlay was not drawn
    crops: tuple[Crop, ...] = ()  #: pictures of missed boxes and of false detections


def run_json(dataset: Dataset, steering: SteerPlan | None = None) -> dict[str, Any]:
    """Return as JSON values all parameters on which the rows of a dataset depend."""
    return {
        "format": 5,
        "images": len(dataset.image_names),
        "image names": _digest(dataset.image_names),
        "field": dataset.field.name,
        "camera": _digest(dataset.camera if dataset.rig is None else dataset.rig),
        "colors": _digest(dataset.colors),
        "method": dataset.method,
        "pose_of": dataset.pose_of,
        "steering": None if steering is None else repr(steering),
        "boxes": _digest(dataset.boxes),
    }


def _digest(value: object) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()[:12]


def without_truth(result: FrameResult) -> FrameResult:
    """Return a result without truth and error, which `with_truth` takes from the dataset again."""
    return replace(result, row=replace(result.row, truth=None, error=None))


def with_truth(result: FrameResult, dataset: Dataset) -> FrameResult:
    """Return a kept result with the truth of the dataset and the error against it."""
    row, truth = result.row, dataset.truth.get(result.row.image)
    error = None
    if row.estimate is not None and truth is not None:
        error = pose_error(row.estimate, truth, symmetric=dataset.symmetry == "point")
    return replace(result, row=replace(row, truth=truth, error=error))
