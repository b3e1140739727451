"""Saves what each overhead camera saw: pictures, and a table that says which detection frame each belongs to."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np

from field_models.errors import ArgumentError, FileError
from robocup_vision.closing import Closing
from robocup_vision.evaluation.result_files import prepare_folder
from robocup_vision.files.output_folder import telling_write_errors
from sim2d.network.vision import OverheadVision
from sim2d.network.world import LeagueState

TABLE = "images.csv"
COLUMNS = ("image", "camera_id", "frame_number", "t_capture_s")


class CameraImages(Closing):
    """Writes ``camera0_000060.png`` and so on, and ``images.csv``. Close it, or use it in a ``with``.

    Parameters
    ----------
    every : int
        Of each camera every so many frames, 60 a second.

    Raises
    ------
    ArgumentError
        If `every` is not positive.
    FileError
        If the folder cannot be written to.
    """

    def __init__(self, folder: str | Path, every: int, seed: int = 0) -> None:
        if every < 1:
            raise ArgumentError(f"images are saved every so many frames, at least 1, got {every}")
        self.folder, self._every = Path(folder), every
        self._rng = np.random.default_rng([seed, 7])
        self.saved = 0
        prepare_folder(self.folder, (TABLE,))
        with telling_write_errors(self.folder / TABLE):
            self._file = (self.folder / TABLE).open("w", newline="", encoding="utf-8")
        self._rows = csv.writer(self._file, lineterminator="\n")
        self._rows.writerow(COLUMNS)

    def close(self) -> None:
        """Close the table."""
        self._file.close()

    def add(self, vision: OverheadVision, state: LeagueState, epoch_s: float) -> None:
        """Save what the cameras saw in the frames that they have just taken, if it is their turn.

        Raises
        ------
        FileError
            If a picture cannot be written.
        """
        for view, number in zip(vision.views, vision.frame_numbers, strict=True):
            if number % self._every:
                continue
            camera = view.camera.camera_id
            name = f"camera{camera}_{number:06d}.png"
            path = self.folder / name
            if not cv2.imwrite(str(path), view.render(state, self._rng)):
                raise FileError(path, "cannot be written")
            self._rows.writerow([name, camera, number, repr(epoch_s + state.t_s)])
            self._file.flush()
            self.saved += 1
