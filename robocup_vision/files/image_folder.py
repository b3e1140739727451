"""Images named on a command line, read one at a time when they are asked for: a thousand of them need no memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import overload

import cv2

from field_models.errors import FileError, FrameError
from robocup_vision.arrays import UInt8Array
from robocup_vision.files.images import IMAGE_SUFFIXES, read_image


class ImageFiles(Sequence[UInt8Array]):
    """Image files as a sequence of frames.

    Parameters
    ----------
    paths : sequence of str or Path
        Files, and folders whose images are taken in the order of their names; of a dataset's folder, those of its
        ``images``.
    size_px : (int, int), optional
        Width and height that all must have; those of the first that can be read unless given.

    Raises
    ------
    FileError
        If a path does not exist, is no image, or a folder has none.
    FrameError
        If no size is given and none of the files can be read.
    """

    def __init__(self, paths: Sequence[str | Path], size_px: tuple[int, int] | None = None) -> None:
        self.paths = [file for path in paths for file in _image_files(Path(path))]
        self.size_px = size_px or self._first_size_px()

    @property
    def names(self) -> list[str]:
        """What the files are called."""
        return [path.name for path in self.paths]

    def __len__(self) -> int:
        return len(self.paths)

    @overload
    def __getitem__(self, index: int) -> UInt8Array: ...

    @overload
    def __getitem__(self, index: slice) -> list[UInt8Array]: ...

    def __getitem__(self, index: int | slice) -> UInt8Array | list[UInt8Array]:
        if isinstance(index, slice):
            return [read_image(path, self.size_px) for path in self.paths[index]]
        return read_image(self.paths[index], self.size_px)

    def _first_size_px(self) -> tuple[int, int]:
        for path in self.paths:
            image = cv2.imread(str(path), cv2.IMREAD_COLOR)
            if image is not None:
                height, width = image.shape[:2]
                return width, height
        raise FrameError(f"{self.paths[0].name}: is not an image that can be decoded")


def _image_files(path: Path) -> list[Path]:
    if not path.exists():
        raise FileError(path, "does not exist")
    if not path.is_dir():
        if path.suffix.lower() not in IMAGE_SUFFIXES:
            kinds = ", ".join(suffix[1:] for suffix in IMAGE_SUFFIXES)
            raise FileError(path, f"is no image file ({kinds})")
        return [path]
    folder = path / "images" if (path / "dataset.toml").is_file() and (path / "images").is_dir() else path
    files = sorted(
        entry
        for entry in folder.iterdir()
        if entry.suffix.lower() in IMAGE_SUFFIXES and not entry.name.startswith(".") and entry.stem != "mask"
    )
    if not files:
        raise FileError(path, "no images found in this folder")
    return files
