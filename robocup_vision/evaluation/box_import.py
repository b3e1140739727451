"""Reads boxes of other programs: YOLO's text files, COCO's JSON and the format of TORSO-21.

The result is the boxes by image, named by its file name without folder. A box outside its picture is refused.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from PIL import Image, UnidentifiedImageError

from field_models.errors import FileError
from robocup_vision.evaluation.boxes import Box
from robocup_vision.files.images import IMAGE_SUFFIXES
from robocup_vision.files.text_files import read_text

_CLASSES = "classes.txt"
_TORSO_NAME = "annotations.yaml"
# lines of TORSO-21: an image's name as a key, another key with its value, and a number of a corner
_TORSO_IMAGE = re.compile(rf"^\s*(\S.*(?:{'|'.join(map(re.escape, IMAGE_SUFFIXES))}))[\"']?:\s*$", re.IGNORECASE)
_TORSO_KEY = re.compile(r"^\s*(- )?\s*(width|height|type|in_image|vector|\w[\w ]*):\s*([^#]*)")
_TORSO_NUMBER = re.compile(r"^\s*(?:- )+\s*(-?\d+(?:\.\d*)?)\s*(?:#.*)?$")


@dataclass(frozen=True, slots=True)
class ImportedBoxes:
    """The boxes in another program's labels."""

    #: boxes by the image's file name without folder; the list may be empty
    boxes: dict[str, list[Box]] = field(default_factory=dict)
    left_out: int = 0  #: number of labels that are not boxes, such as points


def read_yolo(folder: str | Path, images: str | Path, names: str | Path | None = None) -> ImportedBoxes:
    """Read YOLO's labels: one text file per image, ``class x y width height`` as fractions of the picture's size.

    Parameters
    ----------
    images : str or Path
        Folder of the images, from which the pictures' sizes are read.
    names : str or Path, optional
        File of the classes' names, one per line; by default classes.txt in `folder` or in its parent folder.

    Raises
    ------
    FileError
        If a file cannot be read or has another format, an image is missing, a class has no name, or a box is outside
        its picture.
    """
    folder, images = Path(folder), Path(images)
    if not folder.is_dir():
        raise FileError(folder, "is not a folder of text files")
    if not images.is_dir():
        raise FileError(images, "is not a folder of images")
    names_path = _class_names_path(folder, names)
    kinds = [line.strip() for line in read_text(names_path).splitlines() if line.strip()]
    files = {path.stem: path for path in sorted(images.iterdir()) if path.suffix.lower() in IMAGE_SUFFIXES}
    labels = [path for path in sorted(folder.glob("*.txt")) if path.resolve() != names_path.resolve()]
    if not labels:
        raise FileError(folder, "has no text files of labels")
    found = ImportedBoxes()
    for path in labels:
        if path.stem not in files:
            raise FileError(path, f"has no image of its name in {images}")
        image = files[path.stem]
        size = _size_px(image)
        boxes = found.boxes.setdefault(image.name, [])
        for number, line in enumerate(read_text(path).splitlines(), start=1):
            if line.strip():
                boxes.append(_yolo_box(path, number, line, kinds, size))
    return found


def _class_names_path(folder: Path, names: str | Path | None) -> Path:
    if names is not None:
        return Path(names)
    for path in (folder / _CLASSES, folder.parent / _CLASSES):
        if path.is_file():
            return path
    raise FileError(folder, f"has no {_CLASSES} in or above it: give the file of the classes' names by --names")


def _yolo_box(path: Path, number: int, line: str, kinds: list[str], size: tuple[int, int]) -> Box:
    where = f"line {number}"
    words = line.split()
    try:
        kind, *place = int(words[0]), *map(float, words[1:])
        u, v, width, height = place
    except ValueError:
        raise FileError(path, f"{where}: must be class, x, y, width, height", value=line.strip()) from None
    if not 0 <= kind < len(kinds):
        raise FileError(path, f"{where}: class has no name, there are {len(kinds)}", value=kind)
    w, h = size
    corners = ((u - width / 2) * w, (v - height / 2) * h, (u + width / 2) * w, (v + height / 2) * h)
    return _checked(path, where, Box(_kind(kinds[kind]), *corners), size)


def read_coco(path: str | Path) -> ImportedBoxes:
    """Read COCO's JSON: `images`, `categories` and `annotations` with `bbox` as x, y, width, height.

    Raises
    ------
    FileError
        If the file cannot be read or has another format, or a box is outside its picture.
    """
    path = Path(path)
    try:
        values = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise FileError(path, f"is not JSON ({error})") from None
    images = _by_id(path, values, "images", ("file_name", "width", "height"))
    kinds = _by_id(path, values, "categories", ("name",))
    found = ImportedBoxes({name: [] for name in _base_names(path, [str(one["file_name"]) for one in images.values()])})
    for number, one in enumerate(_list_of(path, values, "annotations")):
        where = f"annotation {one.get('id', number)}"
        try:
            image, kind = images[one["image_id"]], kinds[one["category_id"]]
            u, v, width, height = map(float, one["bbox"])
            size = (int(image["width"]), int(image["height"]))
        except (KeyError, TypeError, ValueError):
            raise FileError(
                path, f"{where}: must have image_id, category_id of the lists, and bbox of 4 numbers"
            ) from None
        box = Box(_kind(str(kind["name"])), u, v, u + width, v + height)
        found.boxes[Path(str(image["file_name"])).name].append(_checked(path, where, box, size))
    return found


def _list_of(path: Path, values: Any, key: str) -> list[dict[str, Any]]:
    entries = values.get(key) if isinstance(values, dict) else None
    if not isinstance(entries, list) or not all(isinstance(one, dict) for one in entries):
        raise FileError(path, "must be a list, as COCO has it", key=key)
    return entries


def _by_id(path: Path, values: Any, key: str, needed: tuple[str, ...]) -> dict[Any, dict[str, Any]]:
    entries = _list_of(path, values, key)
    for one in entries:
        if missing := [name for name in ("id", *needed) if name not in one]:
            raise FileError(path, f"an entry has no {missing[0]}", key=key, value=one)
    return {one["id"]: one for one in entries}


def _base_names(path: Path, names: list[str]) -> list[str]:
    short = [Path(name).name for name in names]
    if twice := sorted({name for name in short if short.count(name) > 1}):
        raise FileError(path, "holds images of the same file name in several folders", value=twice[0])
    return short


def read_torso_21(path: str | Path) -> ImportedBoxes:
    """Read the annotations.yaml of a part of TORSO-21; labels of one point or of an outline are skipped.

    Parameters
    ----------
    path : str or Path
        The file, or its folder.

    Raises
    ------
    FileError
        If the file cannot be read or has another format, or a box is outside its picture.
    """
    path = Path(path)
    path = path / _TORSO_NAME if path.is_dir() else path
    found, left_out = ImportedBoxes(), 0
    for image in _torso_images(read_text(path).splitlines()):
        boxes = found.boxes.setdefault(image.name, [])
        size = (image.size.get("width", 0), image.size.get("height", 0))
        for label in image.labels:
            us, vs = label.vector[::2], label.vector[1::2]
            if len(us) not in (2, 4) or len(us) != len(vs) or not label.kind:
                left_out += label.in_image
                continue
            box = Box(_kind(label.kind), min(us), min(vs), max(us), max(vs))
            boxes.append(_checked(path, f"line {label.line}", box, size))
    if not found.boxes:
        raise FileError(path, "names no images, as TORSO-21's annotations do")
    return ImportedBoxes(found.boxes, left_out)


@dataclass(slots=True)
class _TorsoLabel:
    line: int
    kind: str = ""
    in_image: bool = True
    vector: list[float] = field(default_factory=list)


@dataclass(slots=True)
class _TorsoImage:
    name: str
    size: dict[str, int] = field(default_factory=dict)
    labels: list[_TorsoLabel] = field(default_factory=list)


def _torso_images(lines: Iterable[str]) -> Iterable[_TorsoImage]:
    """Yield the images while reading lines; the file is too large for a general YAML parser."""
    image: _TorsoImage | None = None
    in_vector = False
    for number, text in enumerate(lines, start=1):
        if named := _TORSO_IMAGE.match(text):
            if image is not None:
                yield image
            image, in_vector = _TorsoImage(named[1].strip("\"'")), False
        elif image is None:
            continue
        elif in_vector and (point := _TORSO_NUMBER.match(text)):
            image.labels[-1].vector.append(float(point[1]))
        elif key := _TORSO_KEY.match(text):
            name, value = key[2], key[3].strip()
            if key[1] is not None:
                image.labels.append(_TorsoLabel(number))
            in_vector = name == "vector" and bool(image.labels)
            if name in ("width", "height") and value.isdecimal():
                image.size[name] = int(value)
            elif in_vector:
                image.labels[-1].vector += map(float, re.findall(r"-?\d+(?:\.\d*)?", value))
            elif name == "type" and image.labels:
                image.labels[-1].kind = value.strip("\"'")
            elif name == "in_image" and image.labels:
                image.labels[-1].in_image = value.lower() != "false"
    if image is not None:
        yield image


def _kind(name: str) -> str:
    return name.strip().lower()


def _checked(path: Path, where: str, box: Box, size_px: tuple[int, int]) -> Box:
    if min(size_px) < 1:
        raise FileError(path, f"{where}: its image has no width and height")
    problem = box.problem(size_px)
    if problem is not None:
        raise FileError(path, f"{where}: {problem}", value=[round(value, 2) for value in box[1:]])
    return box


def _size_px(image: Path) -> tuple[int, int]:
    try:
        with Image.open(image) as opened:
            return opened.size
    except (OSError, UnidentifiedImageError):
        raise FileError(image, "is no image that can be read") from None


READERS: Mapping[str, Callable[..., ImportedBoxes]] = {"yolo": read_yolo, "coco": read_coco, "torso-21": read_torso_21}
