"""Reads CSV tables strictly: wrong columns, repeated rows and entries that are not numbers are reported by line."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from field_models.errors import FileError
from robocup_vision.files.text_files import read_text
from robocup_vision.geometry import Pose2


@dataclass(frozen=True, slots=True)
class CsvRow:
    """One line of a table."""

    path: Path  #: the file, for error messages
    line: int  #: number of the line in the file, from 1
    entries: dict[str, str]  #: text under each column

    def number(self, column: str) -> float:
        """Return a finite number.

        Raises
        ------
        FileError
            If the entry is empty, not a number, NaN or infinite.
        """
        text = self.entries[column]
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise FileError(self.path, f"line {self.line}: {column} must be a finite number", value=text)
        return value

    def number_or_none(self, column: str) -> float | None:
        """Return a finite number, or None if the entry is empty."""
        return self.number(column) if self.entries[column] else None


def read_csv(
    path: str | Path,
    required: Sequence[str],
    optional: Sequence[str] = (),
    *,
    single: Sequence[str] = (),
    ignore_others: bool = False,
    repeats: bool = False,
) -> list[CsvRow]:
    """Read a table. Its first required column names an image, which must be unique unless `repeats`.

    All or none of the optional columns must be present, any of the single ones may be; others need `ignore_others`.

    Raises
    ------
    FileError
        If the file cannot be read, a column is missing, unknown or named twice, a line has more or fewer entries than
        the header, or an image is listed twice.
    """
    path = Path(path)
    try:
        reader = csv.reader(io.StringIO(read_text(path), newline=""))
        lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader if any(map(str.strip, cells))]
    except csv.Error as error:
        raise FileError(path, f"is not a valid CSV file ({error})") from None
    if not lines:
        raise FileError(path, f"is empty, must begin with the line '{','.join(required)}'")
    (_, header), *body = lines
    _check_header(path, header, required, optional, single, ignore_others)
    rows: list[CsvRow] = []
    first_line: dict[str, int] = {}
    for number, cells in body:
        if len(cells) != len(header):
            raise FileError(path, f"line {number}: must have {len(header)} entries", value=len(cells))
        row = CsvRow(path, number, dict(zip(header, cells, strict=True)))
        image = row.entries[required[0]]
        if image in first_line and not repeats:
            raise FileError(path, f"line {number}: image already listed in line {first_line[image]}", value=image)
        first_line[image] = number
        rows.append(row)
    return rows


def _check_header(
    path: Path,
    header: list[str],
    required: Sequence[str],
    optional: Sequence[str],
    single: Sequence[str],
    ignore_others: bool,
) -> None:
    got = ",".join(header)
    for column in required:
        if column not in header:
            raise FileError(path, f"line 1: column '{column}' is missing", value=got)
    present = [column for column in optional if column in header]
    if present and len(present) < len(optional):
        absent = next(column for column in optional if column not in header)
        raise FileError(path, f"line 1: column '{absent}' is missing beside '{present[0]}'", value=got)
    known = (*required, *optional, *single)
    for column in header:
        if column in known and header.count(column) > 1:
            raise FileError(path, f"line 1: column '{column}' is named twice", value=got)
        if column not in known and not ignore_others:
            raise FileError(path, f"line 1: column '{column}' is unknown", value=got)


def read_poses(path: str | Path, names: Sequence[str]) -> dict[str, Pose2]:
    """Read a table image,x_m,y_m,theta_rad; rows without a heading and further columns are ignored.

    Raises
    ------
    FileError
        If the table cannot be read, or has no pose of any of the images.
    """
    poses = {}
    for row in read_csv(Path(path), ("image", "x_m", "y_m", "theta_rad"), ignore_others=True):
        theta = row.number_or_none("theta_rad")
        if theta is not None:
            poses[row.entries["image"]] = Pose2(row.number("x_m"), row.number("y_m"), theta)
    if not poses.keys() & set(names):
        raise FileError(path, "names none of the images with a heading")
    return poses
