"""Several cameras on one body, and their file rig.toml."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from field_models.errors import ArgumentError, FileError
from field_models.toml_file import StrictStruct, convert, read_toml
from robocup_vision.camera.files import Camera, load_camera, save_camera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.files.text_files import toml_lines, write_lines

# the memory of the pose filter for motion; greater values are probably in milliseconds
_MAX_LATENCY_S = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """Forward cameras, pinhole or fisheye, fixed to one body.

    Raises
    ------
    ArgumentError
        If there is no camera, one of several is a mirror camera or has no pan, two have the same place and
        orientation, or the number of latencies or names differs from that of the cameras.
    """

    cameras: tuple[PinholeCamera, ...]  #: each with its own `offset_m` and `pan_rad`
    #: time from each camera's exposure to the time stamp of its frame; empty for all 0
    latency_s: tuple[float, ...] = ()
    names: tuple[str, ...] = ()  #: names of the cameras in messages; empty for "camera 0", "camera 1" and so on

    def __post_init__(self) -> None:
        cameras = tuple(self.cameras)
        count = len(cameras)
        if not count:
            raise ArgumentError("a rig needs at least one camera, got none")
        names = tuple(self.names) or tuple(f"camera {number}" for number in range(count))
        latency_s = tuple(self.latency_s) or (0.0,) * count
        for key, values in (("latency_s", latency_s), ("names", names)):
            if len(values) != count:
                raise ArgumentError(f"{key} of a rig must be one for each of its {count} cameras, got {len(values)}")
        for name, latency in zip(names, latency_s, strict=True):
            if not 0.0 <= latency <= _MAX_LATENCY_S:
                raise ArgumentError(f"latency_s of {name} must be from 0 to {_MAX_LATENCY_S:g} s, got {latency!r}")
        for name, camera in zip(names, cameras, strict=True):
            if not isinstance(camera, PinholeCamera):
                raise ArgumentError(f"{name} of a rig must be a pinhole or fisheye camera, got {type(camera).__name__}")
            if count > 1 and camera.pan_rad is None:
                raise ArgumentError(f"{name} of a rig needs a pan_rad: where on the body it looks")
        for number, camera in enumerate(cameras):
            for other in range(number):
                if _mounting(camera) == _mounting(cameras[other]):
                    raise ArgumentError(
                        f"{names[other]} and {names[number]} of a rig have the same offset_m {list(camera.offset_m)},"
                        f" pan_rad {camera.pan_rad} and tilt_rad {camera.tilt_rad}: is one file named twice?"
                    )
        object.__setattr__(self, "cameras", cameras)
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "latency_s", latency_s)

    def __len__(self) -> int:
        return len(self.cameras)


def _mounting(camera: PinholeCamera) -> tuple[object, ...]:
    return (*camera.offset_m, camera.pan_rad, camera.tilt_rad, camera.height_m)


class _RigFile(StrictStruct):
    format: Literal[1]
    cameras: tuple[str, ...]
    latency_s: tuple[Annotated[float, msgspec.Meta(ge=0)], ...] = ()


def load_rig(path: str | Path) -> Rig:
    """Load and check a rig file, ``rig.toml``, and its camera files, whose paths are relative to its directory.

    Raises
    ------
    FileError
        If a file is missing or wrong, there is no camera, or the cameras are not a valid `Rig`.
    """
    described = convert(path, read_toml(path), _RigFile)
    if not described.cameras:
        raise FileError(path, "names no camera", key="cameras", value=[])
    if len(set(described.cameras)) < len(described.cameras):
        raise FileError(path, "names a camera file twice", key="cameras", value=list(described.cameras))
    names = tuple(Path(name).stem for name in described.cameras)
    if len(set(names)) < len(names):
        raise FileError(path, "has camera files of one name", key="cameras", value=list(described.cameras))
    if described.latency_s and len(described.latency_s) != len(names):
        problem = f"must have one entry for each of the {len(names)} cameras"
        raise FileError(path, problem, key="latency_s", value=list(described.latency_s))
    cameras = tuple(load_camera(Path(path).parent / name) for name in described.cameras)
    try:
        return Rig(cameras, described.latency_s, names)  # type: ignore[arg-type]
    except ArgumentError as error:
        raise FileError(path, str(error)) from None


def save_rig(rig: Rig, path: str | Path) -> None:
    """Write a rig file for `load_rig`, with a file for each camera, named after it, in the same directory.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    names = [f"{name}.toml" for name in rig.names]
    for name, camera in zip(names, rig.cameras, strict=True):
        save_camera(camera, Path(path).parent / name)
    write_lines(path, toml_lines({"format": 1, "cameras": names, "latency_s": rig.latency_s}))


def load_camera_or_rig(path: str | Path) -> Camera | Rig:
    """Load a rig file if it has the key `cameras`, else a camera file; raises as `load_rig` and `load_camera` do."""
    return load_rig(path) if "cameras" in read_toml(path) else load_camera(path)


def as_rig(cameras: Sequence[object] | Rig) -> Rig:
    """Return cameras as a rig; raises as `Rig` does."""
    return cameras if isinstance(cameras, Rig) else Rig(tuple(cameras))  # type: ignore[arg-type]
