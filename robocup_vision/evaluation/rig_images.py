"""Images of a dataset with a rig: a folder for each camera; the images of the same name belong to one look."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TypeAlias

from field_models.errors import FileError, FrameError
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.rig import Rig
from robocup_vision.files.csv_table import CsvRow, read_csv
from robocup_vision.files.image_folder import pictures_in
from robocup_vision.files.images import decode_image, file_bytes
from robocup_vision.geometry import Pose2

RigImages: TypeAlias = tuple[UInt8Array | None, ...]
# content of the file of each camera's image; None: the camera has none
RigContents: TypeAlias = tuple[bytes | None, ...]
MOTION = ("dx_m", "dy_m", "dtheta_rad")


def find_rig_images(path: Path, source: Path, rig: Rig) -> tuple[str, ...]:
    """Return the names of the looks, sorted: the names of all images of any camera.

    Raises
    ------
    FileError
        If the folder of a camera is missing, or there are no images.
    """
    names: set[str] = set()
    for camera in rig.names:
        folder = source / camera
        if not folder.is_dir():
            raise FileError(path, f"has no folder {camera} of that camera's images", key="images", value=source.name)
        names |= {picture.name for picture in pictures_in(folder)}
    if not names:
        raise FileError(path, "has no image in the folders of its cameras", key="images", value=source.name)
    return tuple(sorted(names))


def rig_contents(source: Path, rig: Rig, name: str) -> RigContents:
    """Return the contents of the files of a look; None for a camera without one.

    Raises
    ------
    FrameError
        If a file cannot be read; it names the camera.
    """
    found = []
    for camera in rig.names:
        path = source / camera / name
        try:
            found.append(file_bytes(path) if path.exists() else None)
        except FrameError as error:
            raise FrameError(f"{camera}/{error}") from None
    return tuple(found)


def decode_rig(contents: RigContents, rig: Rig, name: str) -> RigImages:
    """Return the frames of a look.

    Raises
    ------
    FrameError
        If an image is damaged, not 8-bit colour or of another size than its camera's; it names the camera.
    """
    return tuple(
        None if content is None else decode_image(content, f"{camera}/{name}", lens.size_px)
        for camera, lens, content in zip(rig.names, rig.cameras, contents, strict=True)
    )


def read_rig_times(
    path: Path, source: Path, rig: Rig, names: tuple[str, ...]
) -> dict[str, tuple[tuple[float | None, ...], Pose2 | None]]:
    """Return the times of each look's images, and the motion since the previous look, from frames.csv.

    Raises
    ------
    FileError
        If the table is not valid, names an absent image or camera, does not name all images, times do not ascend, or
        the images of one look have different motions.
    """
    times: dict[str, list[float | None]] = {name: [None] * len(rig) for name in names}
    motions: dict[str, Pose2] = {}
    for row in read_csv(path, ("image", "camera", "t_s"), MOTION, repeats=True):
        image, camera = row.entries["image"], row.entries["camera"]
        if camera not in rig.names:
            raise FileError(path, f"line {row.line}: camera must be one of {', '.join(rig.names)}", value=camera)
        if not (source / camera / image).is_file():
            raise FileError(path, f"line {row.line}: names an image that is not there", value=f"{camera}/{image}")
        number = rig.names.index(camera)
        if times[image][number] is not None:
            raise FileError(path, f"line {row.line}: names an image again", value=f"{camera}/{image}")
        times[image][number] = row.number("t_s")
        motion = motion_of(row)
        if motion is not None and motions.setdefault(image, motion) != motion:
            raise FileError(path, f"line {row.line}: another motion than of an image of the same look", value=image)
    before_s = -math.inf
    for name in names:
        for camera, time in zip(rig.names, times[name], strict=True):
            if time is None and (source / camera / name).is_file():
                raise FileError(path, "must name every image, does not name", value=f"{camera}/{name}")
        now_s = max(time for time in times[name] if time is not None)
        if now_s <= before_s:
            raise FileError(path, f"t_s must be later than in the look before ({before_s})", value=f"{name}: {now_s}")
        before_s = now_s
    return {name: (tuple(times[name]), motions.get(name)) for name in names}


def motion_of(row: CsvRow) -> Pose2 | None:
    """Return the motion in a row of frames.csv; None if all three numbers are empty, as before the first frame."""
    return Pose2(*map(row.number, MOTION)) if any(map(row.entries.get, MOTION)) else None


def rig_mask_paths(path: Path, folder: Path | None, rig: Rig) -> tuple[Path | None, ...]:
    """Return the file of each camera's mask in a folder; None for a camera without one.

    Raises
    ------
    FileError
        If it is not a folder, or has no mask of any camera.
    """
    if folder is None:
        return (None,) * len(rig)
    if not folder.is_dir():
        raise FileError(
            path, "of a rig must be a folder of masks named as the camera files", key="mask", value=folder.name
        )
    found = tuple(one if (one := folder / f"{camera}.png").is_file() else None for camera in rig.names)
    if not any(found):
        problem = f"holds no mask of a camera ({', '.join(f'{camera}.png' for camera in rig.names)})"
        raise FileError(path, problem, key="mask", value=folder.name)
    return found
