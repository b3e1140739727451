"""Frames from a folder of images, or from a dataset with its own field, camera, colours, times and odometry."""

from __future__ import annotations

import bisect
from pathlib import Path

from robocup_vision.evaluation.dataset import Dataset, load_dataset
from robocup_vision.files.image_folder import ImageFiles
from robocup_vision.files.images import read_image
from robocup_vision.geometry import Pose2
from robocup_vision.live.handover.moment import RobotSetup
from robocup_vision.live.sources.source import (
    Source,
    SourceFrame,
    SourceOptions,
    memory_for,
    setup_by_options,
    vision_by_options,
)
from robocup_vision.vision import Vision

# rate of images without times, slow enough to see each
_IMAGES_HZ = 2.0


class FolderSource(Source):
    """Images of a folder in the order of their names, or of a dataset by its ``dataset.toml``.

    The options take precedence over the dataset. Raises FileError or ArgumentError if its files or the field are wrong.
    """

    waits = True

    def __init__(self, path: str | Path, options: SourceOptions) -> None:
        path = Path(path)
        self.name = str(path)
        self._options = options
        self._dataset: Dataset | None = None
        if (path / "dataset.toml").is_file() or options.camera is not None:
            self._dataset = dataset = load_dataset(
                path, field=options.field, camera=options.camera, colors=options.colors
            )
            self.setups = (RobotSetup(self.name, dataset.field, dataset.camera, dataset.field.robot_radius_m),)
            self._paths = [dataset.path / name for name in dataset.image_names]
            self._size_px = dataset.camera.size_px
        else:
            self.setups = (setup_by_options(self.name, options),)
            images = ImageFiles([path])
            self._paths, self._size_px = images.paths, images.size_px
        times = None if self._dataset is None else self._dataset.times
        self._is_sequence = times is not None
        self._t_s = (
            [number / _IMAGES_HZ for number in range(len(self._paths))]
            if times is None
            else [times[path.name].t_s for path in self._paths]
        )
        first_s = self._t_s[0]
        self._t_s = [t_s - first_s for t_s in self._t_s]
        self.duration_s = self._t_s[-1]
        self._next = 0
        self._unused: Pose2 | None = Pose2(0.0, 0.0, 0.0)

    def make_vision(self, setup: RobotSetup) -> Vision | None:
        """Return the vision for the images."""
        dataset, options = self._dataset, self._options
        if dataset is None:
            return vision_by_options(setup, options, has_odometry=False)
        has_odometry = any(time.odometry is not None for time in (dataset.times or {}).values())
        memory = memory_for(setup, dataset.camera, has_odometry=has_odometry) if options.memory else None
        method = options.method or (None if dataset.method == "landmarks" else dataset.method)
        return Vision(dataset.field, dataset.camera, dataset.colors, method=method, mask=dataset.mask, memory=memory)

    def read(self, timeout_s: float) -> tuple[SourceFrame, ...] | None:
        """Return the next image; raises as `Source.read`."""
        if self._next >= len(self._paths):
            return None
        index = self._next
        self._next += 1
        odometry = self._motion(index)
        frame = read_image(self._paths[index], self._size_px)
        self._unused = Pose2(0.0, 0.0, 0.0)
        truth = None
        if self._dataset is not None and self._dataset.pose_of == "robot":
            known = self._dataset.truth.get(self._paths[index].name)
            if known is not None and known.theta_rad is not None:
                truth = Pose2(known.x_m, known.y_m, known.theta_rad)
        times = None if self._dataset is None else self._dataset.times
        mounting = None if times is None else times[self._paths[index].name].mounting
        alone = not self._is_sequence
        return (SourceFrame(self.name, frame, self._t_s[index], odometry, mounting, alone=alone, truth=truth),)

    def seek(self, t_s: float) -> None:
        """Go to the last image at or before a time."""
        self._next = max(0, bisect.bisect_right(self._t_s, t_s + 1e-6) - 1)
        self._unused = None

    def _motion(self, index: int) -> Pose2 | None:
        """Return the motion since the last image that could be read, and keep it in case this one cannot."""
        times = None if self._dataset is None else self._dataset.times
        step = None if times is None else times[self._paths[index].name].odometry
        self._unused = None if step is None or self._unused is None else self._unused.compose(step)
        return self._unused
