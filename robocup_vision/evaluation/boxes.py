"""Reads and writes boxes.csv: things in a dataset's images, marked by boxes in pixels."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from field_models.errors import FileError
from robocup_vision.files.csv_table import read_csv
from robocup_vision.files.output_folder import telling_write_errors

NAME = "boxes.csv"
COLUMNS = ("image", "kind", "xmin", "ymin", "xmax", "ymax")
# tolerance at a picture's border: programs measure from the first pixel's middle or from its outer edge
_RIM_PX = 1.0


class Box(NamedTuple):
    """The place of a thing in an image."""

    kind: str  #: kind of the thing, such as "ball" or "robot"
    #: sides of the box, pixels
    xmin: float
    ymin: float
    xmax: float
    ymax: float

    def holds(self, u_px: float, v_px: float, margin_px: float = 0.0) -> bool:
        """Whether a pixel lies in the box, enlarged by a margin."""
        return (
            self.xmin - margin_px <= u_px <= self.xmax + margin_px
            and self.ymin - margin_px <= v_px <= self.ymax + margin_px
        )

    def is_cut(self, size_px: tuple[int, int]) -> bool:
        """Whether the box touches the border of a picture of this width and height."""
        width, height = size_px
        return (
            min(self.xmin, self.ymin) <= _RIM_PX
            or self.xmax >= width - 1 - _RIM_PX
            or self.ymax >= height - 1 - _RIM_PX
        )

    def problem(self, size_px: tuple[int, int]) -> str | None:
        """Return what is wrong with the box in a picture of this width and height; None: nothing."""
        width, height = size_px
        if not (self.xmin < self.xmax and self.ymin < self.ymax):
            return "a box must have xmin below xmax and ymin below ymax"
        if min(self.xmin, self.ymin) < -_RIM_PX or self.xmax > width + _RIM_PX or self.ymax > height + _RIM_PX:
            return f"a box must lie in the picture of {width}x{height}"
        return None


def load_boxes(path: Path, image_names: Collection[str], size_px: tuple[int, int]) -> dict[str, tuple[Box, ...]]:
    """Read the boxes of a dataset's images, by image.

    Parameters
    ----------
    path : Path
        The file; further columns are ignored.

    Raises
    ------
    FileError
        If the file cannot be read, names an image that is not there, or a box is empty or outside the picture.
    """
    known = frozenset(image_names)
    boxes: dict[str, tuple[Box, ...]] = {}
    for row in read_csv(path, COLUMNS, ignore_others=True, repeats=True):
        image, kind = row.entries["image"], row.entries["kind"]
        if image not in known:
            raise FileError(path, f"line {row.line}: names an image that is not there", value=image)
        if not kind:
            raise FileError(path, f"line {row.line}: kind must not be empty")
        box = Box(kind, *(row.number(column) for column in COLUMNS[2:]))
        problem = box.problem(size_px)
        if problem is not None:
            raise FileError(path, f"line {row.line}: {problem}", value=list(box[1:]))
        boxes[image] = (*boxes.get(image, ()), box)
    return boxes


def save_boxes(path: Path, boxes: Mapping[str, Iterable[Box]]) -> None:
    """Write boxes.csv, in the order of the images' names.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    import csv

    with telling_write_errors(path), path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for image in sorted(boxes):
            writer.writerows((image, box.kind, *(f"{value:.7g}" for value in box[1:])) for box in boxes[image])
