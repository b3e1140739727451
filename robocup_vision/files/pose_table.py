"""Reads known poses of some images from a file like truth.csv."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from field_models.errors import FileError
from robocup_vision.files.csv_table import read_csv
from robocup_vision.geometry import Pose2


def read_poses(path: str | Path, names: Sequence[str]) -> dict[str, Pose2]:
    """Read a table image,x_m,y_m,theta_rad; rows without a heading, and further columns, are ignored.

    Raises
    ------
    FileError
        If it cannot be read, or names none of the images.
    """
    poses = {}
    for row in read_csv(Path(path), ("image", "x_m", "y_m", "theta_rad"), ignore_others=True):
        theta = row.number_or_none("theta_rad")
        if theta is not None:
            poses[row.entries["image"]] = Pose2(row.number("x_m"), row.number("y_m"), theta)
    if not poses.keys() & set(names):
        raise FileError(path, "names none of the images with a heading")
    return poses
