"""A mapping run on the disk: run.toml with the trinocular rig and the start, and a folder of images for each camera.

    format = 1
    camera = "camera.toml"        # the right camera, with its mounting
    baseline_m = 0.0996           # to the left camera and to the one above
    start = [0.0, 0.0, 0.0]       # x, y (m) and theta (rad) of the robot at the first moment
    frames = "frames.csv"         # optional: image,t_s[,dx_m,dy_m,dtheta_rad] odometry since the moment before

Images of one moment have the same name in right/, left/ and top/; the moments are in the order of the names.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from field_models.errors import ArgumentError, FileError
from field_models.toml_file import StrictStruct, load_toml
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.files import load_camera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.files.csv_table import read_csv
from robocup_vision.files.images import IMAGE_SUFFIXES, read_image
from robocup_vision.geometry import Pose2

CAMERAS = ("right", "left", "top")
_BASELINE_M = 0.0996


@dataclass(frozen=True, eq=False)
class TrinocularRig:
    """Three equal cameras in an L: the right one is the reference, one is to its left and one above it."""

    right: PinholeCamera  #: the reference, as mounted on the robot; its tilt must be known
    baseline_m: float = _BASELINE_M  #: distance of the left and the top camera from it, along its own image axes

    def __post_init__(self) -> None:
        if not self.baseline_m > 0:
            raise ArgumentError(f"baseline_m must be positive, got {self.baseline_m}")
        if not self.right.known_orientation:
            raise ArgumentError("the rig's camera needs a known tilt_rad")

    @property
    def left(self) -> PinholeCamera:
        """The left camera."""
        return self._moved(np.array([0.0, self.baseline_m, 0.0]))

    @property
    def top(self) -> PinholeCamera:
        """The upper camera."""
        return self._moved(np.array([0.0, 0.0, self.baseline_m]))

    def _moved(self, by_m: FloatArray) -> PinholeCamera:
        x, y, z = self.right.viewpoint_m + self.right.camera_to_robot @ by_m
        return replace(self.right, offset_m=(float(x), float(y)), height_m=float(z))


class _RunFile(StrictStruct):
    format: Literal[1]
    camera: str
    start: tuple[float, float, float]
    baseline_m: Annotated[float, msgspec.Meta(gt=0)] = _BASELINE_M
    frames: str | None = None


@dataclass(frozen=True, eq=False)
class MappingRun:
    """A run, whose images are read from the disk when needed."""

    folder: Path  #: contains right/, left/ and top/
    names: tuple[str, ...]  #: names of the images, one for each moment, in order
    rig: TrinocularRig  #: the cameras
    start: Pose2  #: pose of the robot at the first moment, field frame
    odometry: dict[str, Pose2]  #: motion since the moment before, by image, if known

    def read(self) -> Iterator[tuple[str, list[UInt8Array]]]:
        """Yield each moment's name and images, right, left and top.

        Raises
        ------
        FrameError
            If an image is missing, damaged or not as large as the camera's.
        """
        for name in self.names:
            yield name, [read_image(self.folder / camera / name, self.rig.right.size_px) for camera in CAMERAS]


def load_run(path: str | Path) -> MappingRun:
    """Read a run's description.

    Parameters
    ----------
    path : str or Path
        Its folder, or the run.toml in it.

    Raises
    ------
    FileError
        If a file or folder is missing or wrong.
    """
    path = Path(path)
    file = path / "run.toml" if path.is_dir() else path
    if not file.exists():
        raise FileError(file, "does not exist")
    description = load_toml(file, _RunFile)
    folder = file.parent
    camera = load_camera(folder / description.camera)
    if not isinstance(camera, PinholeCamera) or not camera.known_orientation:
        raise FileError(file, "must be a pinhole camera of known tilt_rad", key="camera", value=description.camera)
    names = [_images(folder / part) for part in CAMERAS]
    for part, found in zip(CAMERAS[1:], names[1:], strict=True):
        other = sorted(set(names[0]) ^ set(found))
        if other:
            raise FileError(folder / part, "must hold the same images as right/, differs in", value=other[0])
    odometry = {}
    if description.frames is not None:
        motion = ("dx_m", "dy_m", "dtheta_rad")
        for row in read_csv(folder / description.frames, ("image", "t_s"), motion):
            if any(row.entries.get(column) for column in motion):
                odometry[row.entries["image"]] = Pose2(*(row.number(column) for column in motion))
    rig = TrinocularRig(camera, description.baseline_m)
    return MappingRun(folder, tuple(names[0]), rig, Pose2(*description.start), odometry)


def _images(folder: Path) -> list[str]:
    if not folder.is_dir():
        raise FileError(folder, "is not a folder of images")
    names = sorted(e.name for e in folder.iterdir() if e.suffix.lower() in IMAGE_SUFFIXES and e.name[0] != ".")
    if not names:
        raise FileError(folder, "holds no images")
    return names
