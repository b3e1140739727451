"""Writes pictures as VP8 in a webm file of a limited size.

OpenCV takes neither a bit rate nor a quality for VP8: it asks the encoder for 4 bits a pixel, some 20 MB a minute, but
for no more than half of 2^31 bits a second. Pictures are therefore written first as a film of very many pictures a
second, which leaves few bits for each, and then taken over, as they are encoded, into a film at their real rate.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from field_models.errors import FileError, FrameError
from robocup_vision.arrays import UInt8Array

# leaves 18 kB for a picture: small text stays readable, and 5 pictures a second of a match make 1.5 MB a minute
_CLAIMED_PER_S = 7_000.0
_VP8 = cv2.VideoWriter.fourcc(*"VP80")


class FilmFile:
    """A film that is written picture by picture; `problem` is the reason why it cannot: then nothing is written.

    Parameters
    ----------
    path : Path
        The file, which is there once the film is closed. Until then there is one beside it that ends in ``.ivf``.
    """

    def __init__(self, path: Path, pictures_per_s: float, size_px: tuple[int, int]) -> None:
        self._path, self._encoded = path, path.with_suffix(".ivf")
        self._pictures_per_s, self._size_px = pictures_per_s, size_px
        self._writer = _open_writer(self._encoded, _CLAIMED_PER_S, size_px)
        self.problem = "" if self._writer.isOpened() else f"no {path.name}: this OpenCV cannot write VP8 video"

    def write(self, picture: UInt8Array) -> None:
        """Write a picture (H, W, 3) uint8, BGR.

        Raises
        ------
        FrameError
            If it has another size.
        """
        if (picture.shape[1], picture.shape[0]) != self._size_px:
            # OpenCV would drop it without an error
            raise FrameError(f"a video picture must be {self._size_px}, got {picture.shape[1::-1]}")
        self._writer.write(picture)

    def close(self) -> None:
        """Finish the file.

        Raises
        ------
        FileError
            If it cannot be written.
        """
        self._writer.release()
        if self.problem:
            return
        try:
            self._take_over()
        finally:
            self._encoded.unlink(missing_ok=True)

    def _take_over(self) -> None:
        """Write the encoded pictures at their real rate."""
        source = cv2.VideoCapture(str(self._encoded), cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1])
        with _silence():
            options = [cv2.VIDEOWRITER_PROP_RAW_VIDEO, 1]
            film = cv2.VideoWriter(str(self._path), cv2.CAP_FFMPEG, _VP8, self._pictures_per_s, self._size_px, options)
        try:
            if not (source.isOpened() and film.isOpened()):
                raise FileError(self._path, "cannot be written as a webm film")
            while True:
                is_read, packet = source.read()
                if not is_read:
                    return
                # the lowest bit of a VP8 picture is 0 where it needs no other
                film.set(cv2.VIDEOWRITER_PROP_KEY_FLAG, float(not np.ravel(packet)[0] & 1))
                film.write(packet)
        finally:
            source.release()
            film.release()


def _open_writer(path: Path, frames_per_s: float, size_px: tuple[int, int]) -> cv2.VideoWriter:
    with _silence():
        return cv2.VideoWriter(str(path), _VP8, frames_per_s, size_px)


@contextmanager
def _silence() -> Iterator[None]:
    """Suppress the line that OpenCV writes to standard error, whatever its log level, when it opens a webm file."""
    kept = os.dup(2)
    with tempfile.TemporaryFile() as nowhere:
        os.dup2(nowhere.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
