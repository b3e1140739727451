"""Import of calibrations from other programs: ROS' camera_info, OpenCV's FileStorage and Kalibr's camchain, as YAML.

They contain the lens but not the mounting. OpenCV's YAML parser is sufficient for all three.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2

from field_models.errors import FileError
from field_models.near_names import did_you_mean
from robocup_vision.camera.pinhole import DISTORTION_LENGTHS
from robocup_vision.files.text_files import read_text

# names in ROS and Kalibr, and in OpenCV, of the projection of Kannala and Brandt
_FISHEYE = ("equidistant", "fisheye")
_BROWN_CONRADY = ("plumb_bob", "rational_polynomial", "radtan", "none")
_HEADER = "%YAML:1.0\n---\n"
# alternative names, in the order of the search
_OPENCV_MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M1")
_OPENCV_LENS = (
    "distortion_coefficients",
    "distCoeffs",
    "dist_coeffs",
    "Distortion_Coefficients",
    "D",
    "D1",
)
_OPENCV_SIZE = ("image_size", "imageSize", "size", "resolution")


@dataclass(frozen=True, slots=True)
class Calibration:
    """A lens, with the keys of a camera file."""

    size_px: tuple[int, int]
    focal_px: tuple[float, float]
    center_px: tuple[float, float]
    distortion: tuple[float, ...]
    is_fisheye: bool = False


def read_ros(path: str | Path, size_px: tuple[int, int] | None = None) -> Calibration:
    """Read a camera_info file as written by camera_calibration, or a message as printed by `ros2 topic echo`.

    A size is given where the file does not hold it.

    Raises
    ------
    FileError
        If it cannot be read, is from another program, or has a lens model that camera files do not support.
    """
    raw = _Yaml.read(path)
    matrix = raw.numbers(("camera_matrix", "k", "K"), "is no ROS camera_info", count=9)
    lens = raw.numbers(("distortion_coefficients", "d", "D"), "is missing")
    for key in ("binning_x", "binning_y"):
        if raw.number(key, 1.0) > 1.0:
            raise FileError(path, "images that are binned need a calibration of their own", key=key)
    model = str(raw.values.get("distortion_model", "plumb_bob"))
    size = raw.size((("image_width", "image_height"), ("width", "height")), (), size_px)
    return raw.calibration(size, matrix, lens, model)


def read_opencv(path: str | Path, size_px: tuple[int, int] | None = None) -> Calibration:
    """Read a calibration written by OpenCV's FileStorage; see `read_ros`."""
    raw = _Yaml.read(path)
    matrix = raw.numbers(_OPENCV_MATRIX, "is no calibration of OpenCV", count=9)
    lens = raw.numbers(_OPENCV_LENS, "is missing")
    model = "fisheye" if raw.number("fisheye_model", 0.0) else "plumb_bob"
    size = raw.size((("image_width", "image_height"), ("width", "height")), _OPENCV_SIZE, size_px)
    return raw.calibration(size, matrix, lens, model)


def read_kalibr(path: str | Path, size_px: tuple[int, int] | None = None, name: str | None = None) -> Calibration:
    """Read one camera of Kalibr's camchain, such as "cam1", by default the only one; see `read_ros`."""
    chain = _Yaml.read(path)
    names = [key for key, value in chain.values.items() if isinstance(value, dict) and "intrinsics" in value]
    if not names:
        raise FileError(path, f"is no camchain of Kalibr: no camera in it has intrinsics{chain.hint()}")
    if name is None and len(names) > 1:
        raise FileError(path, f"holds several cameras, choose one by --name: {', '.join(names)}")
    chosen = names[0] if name is None else name
    if chosen not in names:
        raise FileError(path, f"has no such camera, only {', '.join(names)}{did_you_mean(chosen, names)}", value=chosen)
    raw = _Yaml(Path(path), chain.values[chosen], f"{chosen}.")
    kind = str(raw.values.get("camera_model", "pinhole"))
    if kind != "pinhole":
        raw.refuse_model(kind, "camera_model")
    fu, fv, u, v = raw.numbers(("intrinsics",), "is missing", count=4)
    lens = raw.numbers(("distortion_coeffs",), "is missing")
    model = str(raw.values.get("distortion_model", "radtan"))
    return raw.calibration(raw.size((), ("resolution",), size_px), [fu, 0, u, 0, fv, v, 0, 0, 1], lens, model)


READERS: Mapping[str, Callable[..., Calibration]] = {"ros": read_ros, "opencv": read_opencv, "kalibr": read_kalibr}


@dataclass(frozen=True, slots=True)
class _Yaml:
    path: Path
    values: Mapping[str, Any]
    prefix: str = ""

    @classmethod
    def read(cls, path: str | Path) -> _Yaml:
        path = Path(path)
        text = read_text(path)
        own = text.lstrip().startswith("%YAML")
        if not own:
            # OpenCV needs lists that are indented more than their key, and a single document
            text = _HEADER + re.split(r"^---\s*$", text.lstrip().removeprefix("---"), flags=re.MULTILINE)[0]
            text = re.sub(r"^(\s*)- ", r"\1  - ", text, flags=re.MULTILINE)
        try:
            storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
            root = storage.root()
            values = _plain(root) if root.isMap() else {}
        except (cv2.error, SystemError) as error:
            # the cause is OpenCV's error, with the line in brackets
            found = re.search(r"\((\d+)\): ([^\n]+)", str(error.__cause__ or error))
            line = int(found[1]) - (0 if own else _HEADER.count("\n")) if found else 0
            where = f" (line {line}: {found[2]})" if found else ""
            raise FileError(path, f"is not YAML{where}") from None
        if not values:
            raise FileError(path, "is not YAML with keys and values")
        return cls(path, values)

    def hint(self) -> str:
        """Return a hint on the file's actual kind, by its keys."""
        names = self.values.keys()
        if any(isinstance(value, dict) and "intrinsics" in value for value in self.values.values()):
            kind = "kalibr"
        elif names & {"distortion_model", "projection_matrix"}:
            kind = "ros"
        elif names & set(_OPENCV_MATRIX):
            kind = "opencv"
        else:
            return ""
        return f" (read it by from-{kind})"

    def number(self, key: str, default: float) -> float:
        value = self.values.get(key, default)
        return float(value) if isinstance(value, int | float) else default

    def numbers(self, names: tuple[str, ...], missing: str, count: int | None = None) -> list[float]:
        """Return the numbers of the first key that exists: a list, or a matrix with its data."""
        key = next((name for name in names if name in self.values), None)
        if key is None:
            raise FileError(self.path, f"{missing}{self.hint()}", key=self.prefix + names[0])
        value = self.values[key]
        value = value.get("data") if isinstance(value, dict) else value
        rows = [value] if not isinstance(value, list) else value
        flat = [entry for row in rows for entry in (row if isinstance(row, list) else [row])]
        found = [entry for entry in flat if isinstance(entry, float)]
        if len(found) < len(flat) or (count is not None and len(found) != count):
            wanted = "numbers" if count is None else f"{count} numbers"
            raise FileError(self.path, f"must be {wanted}", key=self.prefix + key, value=value)
        return found

    def size(
        self, pairs: tuple[tuple[str, str], ...], names: tuple[str, ...], given: tuple[int, int] | None
    ) -> tuple[int, int]:
        found = next(([self.number(x, 0.0), self.number(y, 0.0)] for x, y in pairs if x in self.values), None)
        name = next((name for name in names if name in self.values), None)
        if found is None and name is not None:
            found = self.numbers((name,), "", count=2)
        if found is None or min(found) < 1:
            if given is None:
                raise FileError(self.path, "does not say how large the images are: give --size, such as 640x480")
            return given
        size = (round(found[0]), round(found[1]))
        if given is not None and given != size:
            raise FileError(self.path, f"is of images of {size[0]}x{size[1]}, not {given[0]}x{given[1]}")
        return size

    def refuse_model(self, model: str, key: str) -> None:
        raise FileError(
            self.path,
            "is a lens model that a camera file cannot hold: calibrate with plumb_bob, rational_polynomial (radtan)"
            " or equidistant",
            key=self.prefix + key,
            value=model,
        )

    def calibration(self, size: tuple[int, int], matrix: list[float], lens: list[float], model: str) -> Calibration:
        if model not in (*_BROWN_CONRADY, *_FISHEYE):
            self.refuse_model(model, "distortion_model")
        fu, skew, u, _, fv, v, *_ = matrix
        if fu <= 0.0 or fv <= 0.0:
            raise FileError(self.path, "has no focal length: the camera is not calibrated", value=[fu, fv])
        if abs(skew) > 1e-6 * fu:
            raise FileError(self.path, "has a skew, which a camera file cannot hold", value=skew)
        if model in _FISHEYE:
            if len(lens) != 4:
                raise FileError(self.path, "a fisheye model has 4 coefficients", value=lens)
            return Calibration(size, (fu, fv), (u, v), tuple(lens), is_fisheye=True)
        most = DISTORTION_LENGTHS[-1]
        if any(lens[most:]):
            raise FileError(self.path, f"has coefficients beyond the first {most} of OpenCV's model", value=lens)
        lens = lens[:most]
        while lens and lens[-1] == 0.0:
            lens = lens[:-1]
        length = next(length for length in DISTORTION_LENGTHS if length >= len(lens))
        return Calibration(size, (fu, fv), (u, v), (*lens, *(0.0,) * (length - len(lens))))


def _plain(node: Any) -> Any:
    if node.isMap():
        return {key: _plain(node.getNode(key)) for key in node.keys()}  # noqa: SIM118  (no mapping)
    if node.isSeq():
        return [_plain(node.at(index)) for index in range(node.size())]
    if node.isInt() or node.isReal():
        return float(node.real())
    return node.string() if node.isString() else None
