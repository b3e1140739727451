"""Images named on a command line, each read only when it is used, so that even a thousand need no memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import overload

from field_models.errors import FileError, FrameError
from robocup_vision.arrays import UInt8Array
from robocup_vision.files.images import IMAGE_SUFFIXES, orientation_note, other_pictures, read_image

_KINDS = ", ".join(suffix[1:] for suffix in IMAGE_SUFFIXES)


class ImageFiles(Sequence[UInt8Array]):
    """Image files as a sequence of frames, all of one size: by default that of the first that can be read.

    A folder stands for its images in order of their names; a dataset, or a folder without images, for those of its
    folder ``images``.

    Raises
    ------
    FileError
        If a path does not exist or is not an image, or a folder has no images.
    FrameError
        If no size is given and none of the files can be read.
    """

    def __init__(self, paths: Sequence[str | Path], size_px: tuple[int, int] | None = None) -> None:
        self.paths = [file for path in paths for file in _image_files(Path(path))]
        self.size_px = size_px or self._first_size_px()

    @property
    def names(self) -> list[str]:
        """Names of the files."""
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

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user about the files: an EXIF orientation."""
        found = (orientation_note(path.parent, [path.name]) for path in self.paths)
        return next((notes for notes in found if notes), ())

    def _first_size_px(self) -> tuple[int, int]:
        problem = ""
        for path in self.paths:
            try:
                height, width = read_image(path).shape[:2]
            except FrameError as error:
                problem = problem or str(error)
                continue
            return width, height
        raise FrameError(problem)


def _image_files(path: Path) -> list[Path]:
    if not path.exists():
        raise FileError(path, "does not exist")
    if not path.is_dir():
        if path.suffix.lower() not in IMAGE_SUFFIXES:
            raise FileError(path, f"is no image file ({_KINDS})")
        return [path]
    folder = picture_folder(path)
    files = [file for file in pictures_in(folder) if file.stem != "mask"]
    if not files:
        raise FileError(path, no_pictures(folder))
    return files


def picture_folder(path: Path) -> Path:
    """Return the folder that holds the images: its ``images`` if it is a dataset or has none itself, else itself."""
    inner = path / "images"
    if path.is_dir() and inner.is_dir() and ((path / "dataset.toml").is_file() or not pictures_in(path)):
        return inner
    return path


def no_pictures(folder: Path) -> str:
    """Return the error text for a folder without images; it names subfolders that have some."""
    inner = [entry.name for entry in sorted(folder.iterdir()) if entry.is_dir() and pictures_in(entry)]
    there = f"; there are some in {', '.join(inner[:3])}" if inner else ""
    others = other_pictures(folder)
    left = f"; {len(others)} pictures of other kinds, the first: {others[0]}" if others else ""
    return f"no images found in this folder ({_KINDS}){there}{left}"


def pictures_in(folder: Path) -> list[Path]:
    """Return the images of a folder in the order of their names, without hidden files."""
    return sorted(
        entry for entry in folder.iterdir() if entry.suffix.lower() in IMAGE_SUFFIXES and not entry.name.startswith(".")
    )
