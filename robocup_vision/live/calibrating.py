"""Calibrates a camera from the page: collects frames, writes camera.toml, and shows what `check` finds.

Frames are written to a folder that becomes a dataset, so that everything can be repeated with the commands.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from field_models.catalog import field_names
from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import OmniCamera, PinholeCamera, save_camera
from robocup_vision.files.images import write_png
from robocup_vision.files.text_files import write_lines
from robocup_vision.live.handover.moment import Display, RobotSetup
from robocup_vision.live.page.saving import new_folder

# a calibration uses two dozen of the collected frames; the robot should move from each to the next
MAX_FRAMES, _EVERY_S = 60, 0.5
# frames whose thumbnails differ by less than this mean of grey levels show the same place; noise is smaller
_THUMBNAIL_PX, _SAME_PLACE = (32, 24), 2.0
_KINDS = {"omni": "mirror camera", "pinhole": "forward camera"}


class Calibrator:
    """Collects frames of one source and calibrates its camera, in a thread."""

    def __init__(
        self,
        display: Display,
        setup: RobotSetup,
        out: Path,
        say: Callable[[str], None],
        use: Callable[[RobotSetup], None],
    ) -> None:
        self._display, self._setup, self._out = display, setup, out
        self._say, self._use = say, use
        self._folder: Path | None = None
        self._collecting = False
        self._frames = 0
        self._last: tuple[float, UInt8Array, tuple[int, ...]] | None = None
        self._findings: list[list[str]] = []
        self._text = "no camera file: collect some ten frames from different places on the field, then calibrate"
        self._jobs: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._busy = False
        self._thread = threading.Thread(target=self._work, name="live calibration", daemon=True)
        self._thread.start()

    @property
    def status(self) -> dict[str, Any]:
        """State of the calibration, as the page shows it."""
        return {
            "text": self._text,
            "collecting": self._collecting,
            "frames": self._frames,
            "busy": self._busy,
            "findings": list(self._findings),
        }

    def collect(self, on: bool) -> None:
        """Start or stop collecting."""
        self._collecting = on
        self._tell(self._collected())

    def add(self, frame: UInt8Array) -> None:
        """Keep a frame if frames are collected and it shows another place than the last one; called in the loop."""
        if not self._collecting or self._busy:
            return
        now_s = time.monotonic()
        small = np.asarray(cv2.resize(frame, _THUMBNAIL_PX, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        if self._last is not None:
            last_s, last, shape = self._last
            if frame.shape != shape:
                self._collecting = False
                self._tell(f"the frames' size has changed to {frame.shape[1]}x{frame.shape[0]}: collecting has ended")
                return
            moved = float(np.abs(small.astype(np.int16) - last).mean())
            if now_s - last_s < _EVERY_S or moved < _SAME_PLACE:
                return
        self._last = (now_s, small, frame.shape)
        self._jobs.put(lambda: self._keep(frame))

    def calibrate(self, kind: str) -> None:
        """Calibrate a camera of a kind from the collected frames.

        Raises ArgumentError if there are none, or a calibration is running.
        """
        if self._busy:
            raise ArgumentError("a calibration is under way")
        if not self._frames:
            raise ArgumentError("collect frames first")
        self._busy, self._collecting = True, False
        self._findings = []
        self._tell(f"calibrating a {_KINDS[kind]} by {self._frames} frames: this takes up to a minute")
        self._jobs.put(lambda: self._calibrate(kind))

    def close(self) -> None:
        """End the thread after the jobs it has."""
        self._jobs.put(None)

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            try:
                job()
            except RobocupVisionError as error:
                self._fail(str(error))
            except OSError as error:
                self._fail(f"{error.filename or self._out}: cannot be written ({error.strerror or error})")

    def _fail(self, reason: str) -> None:
        self._busy = self._collecting = False
        self._tell(f"not calibrated: {reason}")
        self._say(f"calibration: {reason}")

    def _keep(self, frame: UInt8Array) -> None:
        if self._folder is None:
            self._folder = new_folder(self._out, "calibration")
            (self._folder / "images").mkdir()
        write_png(self._folder / "images" / f"{self._frames:06d}.png", frame)
        self._frames += 1
        if self._frames >= MAX_FRAMES:
            self._collecting = False
        self._tell(self._collected())

    def _collected(self) -> str:
        where = "" if self._folder is None else f" in {self._folder}"
        hint = "; move the robot about" if self._collecting else ""
        return f"{self._frames} of at most {MAX_FRAMES} frames{where}{hint}"

    def _calibrate(self, kind: str) -> None:
        from robocup_vision.calibration.check import check_dataset
        from robocup_vision.evaluation.dataset import load_dataset

        assert self._folder is not None
        camera = self._fit(kind, self._folder / "images")
        if camera is None:
            return
        path = self._folder / "camera.toml"
        save_camera(camera, path)
        findings = [["camera", "ok", f"{path} is written"]]
        if self._setup.field.name in field_names():
            lines = ["format = 1", f'field = "{self._setup.field.name}"', 'camera = "camera.toml"', 'images = "images"']
            write_lines(self._folder / "dataset.toml", lines)
            dataset = load_dataset(self._folder)
            findings += [[found.subject, found.state, found.evidence] for found in check_dataset(dataset)]
        self._findings = findings
        self._busy = False
        self._setup = replace(self._setup, camera=camera)
        self._use(self._setup)
        self._say(f"calibrated: {path}")
        self._tell(f"calibrated by the frames in {self._folder}: start live with --camera {path} from now on")

    def _fit(self, kind: str, images: Path) -> OmniCamera | PinholeCamera | None:
        from robocup_vision.calibration.forward.calibrate import calibrate_forward
        from robocup_vision.calibration.not_calibrated import NotCalibrated
        from robocup_vision.calibration.omni.calibrate import calibrate_omni
        from robocup_vision.files.image_folder import ImageFiles

        files = ImageFiles([images])
        calibrate = calibrate_omni if kind == "omni" else calibrate_forward
        found = calibrate(self._setup.field, files, names=files.names)
        if isinstance(found, NotCalibrated):
            self._fail(found.reason)
            return None
        return found.camera

    def _tell(self, text: str) -> None:
        self._text = text
        self._display.set_status(calibration=self.status)
