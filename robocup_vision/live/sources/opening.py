"""Opens the source that a text on the command line names."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path

from field_models.errors import ArgumentError, FileError
from robocup_vision.files.images import IMAGE_SUFFIXES
from robocup_vision.live.sources.source import Source, SourceOptions

# packages register functions of the text after "NAME:" and the options, which return a source
GROUP = "robocup_vision.live_sources"
RECORDING_SUFFIX = ".mcap"

_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]*://")
_KIND = re.compile(r"([a-z][a-z0-9_]*):(?!//)(.*)", re.DOTALL)


def open_source(text: str, options: SourceOptions) -> Source:
    """Open a source; raises RobocupVisionError if there is no such source, or it cannot be opened.

    The text is a camera's index or device, a stream's address, a video, a folder of images, a dataset, a recording, or
    ``KIND:...`` of a kind that a package has registered, such as ``sim:ssl_2001`` or ``ros:/camera/image_raw``.
    """
    kind = _KIND.fullmatch(text)
    if kind is not None and not Path(text).exists():
        return _opener(kind[1])(kind[2], options)
    if text.isdigit() or _ADDRESS.match(text) or text.startswith("/dev/"):
        from robocup_vision.live.sources.capture import CameraSource

        if text.startswith("/dev/") and not Path(text).exists():
            raise FileError(text, "does not exist")
        return CameraSource(
            f"camera {text}" if text.isdigit() else text, int(text) if text.isdigit() else text, options
        )
    return _open_path(Path(text), options)


def _open_path(path: Path, options: SourceOptions) -> Source:
    if not path.exists():
        raise FileError(path, "does not exist (a camera is named by its index, a match by sim:FIELD)")
    if path.is_dir():
        from robocup_vision.live.sources.folder import FolderSource

        return FolderSource(path, options)
    if path.suffix.lower() == RECORDING_SUFFIX:
        from robocup_vision.live.sources.recording import RecordingSource

        return RecordingSource(path, options)
    if path.suffix.lower() in IMAGE_SUFFIXES:
        raise FileError(path, "is a single image, must be a folder of images or a video")
    from robocup_vision.live.sources.capture import VideoSource

    return VideoSource(path, options)


def _opener(kind: str) -> Callable[[str, SourceOptions], Source]:
    known = {point.name: point for point in entry_points(group=GROUP)}
    if kind not in known:
        raise ArgumentError(f"there is no source of kind '{kind}:', only {', '.join(sorted(known)) or 'none'}")
    opener: Callable[[str, SourceOptions], Source] = known[kind].load()
    return opener


def recordings_in(folder: Path) -> tuple[str, ...]:
    """Return the names of the recordings directly in a folder; links that lead out of it are ignored."""
    inside = folder.resolve()
    return tuple(
        sorted(
            entry.name
            for entry in folder.iterdir()
            if entry.suffix.lower() == RECORDING_SUFFIX
            and entry.is_file()
            and entry.resolve().parent == inside
            and not entry.name.startswith(".")
        )
    )
