"""Runs of a rig of three cameras and of a single camera through a hall: frames with truth, one at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robocup_vision.arrays import Float32Array, UInt8Array
from robocup_vision.camera import PinholeCamera, save_camera
from robocup_vision.files.images import write_png
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.files.text_files import write_lines
from robocup_vision.geometry import Pose2
from robocup_vision.landmarks.mapping.run_files import CAMERAS, TrinocularRig
from sim2d.rendering.hall.bustle import Bustle
from sim2d.rendering.hall.hall import Hall, HallCamera, HallLight
from sim2d.rendering.hall.solids import Panel
from sim2d.rendering.sensor import Sensor

# as the paper's Digiclops: 320 x 240, cameras 99.6 mm apart; its field of view is not given
HALL_CAMERA = PinholeCamera((320, 240), (277.0, 277.0), (159.5, 119.5), 0.6, pan_rad=0.0, tilt_rad=0.0, roll_rad=0.0)
HALL_RIG = TrinocularRig(HALL_CAMERA, 0.0996)
HALL_SENSOR = Sensor(noise_sigma=2.0, blur_px=0.5)
SUPERSAMPLE = 2


@dataclass(frozen=True, slots=True)
class HallFrame:
    """Frames of one moment: the robot's pose, each camera's picture, (H, W, 3) uint8 BGR, and depths if wanted."""

    pose: Pose2
    images: tuple[UInt8Array, ...]
    depths_m: tuple[Float32Array, ...] = ()


def take(
    hall: Hall,
    cameras: Sequence[PinholeCamera],
    poses: Sequence[Pose2],
    seed: int,
    *,
    light: HallLight | None = None,
    bustle: Bustle | None = None,
    interval_s: float = 0.0,
    sensor: Sensor = HALL_SENSOR,
    first: int = 0,
    depths: bool = False,
) -> Iterator[HallFrame]:
    """Take pictures along a path.

    Parameters
    ----------
    cameras : sequence of PinholeCamera
        Cameras of one robot, exposed together.
    seed : int
        Seed of the sensor's noise; frame i depends on it and on `first` + i only.
    bustle : Bustle, optional
        People and light; its light replaces `light`.
    interval_s : float
        Time from frame to frame.
    first : int
        Number of the first frame.
    depths : bool
        Whether to return each pixel's depth.
    """
    renderers = [HallCamera(camera, SUPERSAMPLE) for camera in cameras]
    for index, pose in enumerate(poses, start=first):
        rng = np.random.default_rng([seed, index, 0xF0])
        passers: list[Panel] = []
        if bustle is not None:
            t_s = index * interval_s
            light, passers = bustle.light_at(t_s), bustle.panels(t_s, pose)
        images, far = [], []
        for renderer in renderers:
            images.append(sensor.expose(renderer.render(hall, pose, light, passers), rng))
            if depths:
                far.append(renderer.depths_m())
        yield HallFrame(pose, tuple(images), tuple(far))


def write_run(folder: str | Path, rig: TrinocularRig, frames: Iterable[HallFrame], command: str) -> None:
    """Write a run of three cameras to FOLDER/run: run.toml, camera.toml, truth.csv, right/, left/ and top/.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    run = Path(folder) / "run"
    poses = []
    for index, frame in enumerate(frames):
        for camera, image in zip(CAMERAS, frame.images, strict=True):
            _write_image(run / camera / f"{index:04d}.png", image)
        poses.append(frame.pose)
    save_camera(rig.right, run / "camera.toml")
    start = ", ".join(f"{v:.9f}" for v in poses[0].array)
    lines = [f"# made by: {command}", "format = 1", 'camera = "camera.toml"', f"baseline_m = {rig.baseline_m}"]
    write_lines(run / "run.toml", [*lines, f"start = [{start}]"])
    _write_truth(run / "truth.csv", poses)


def write_second_run(
    folder: str | Path, field: str, camera: PinholeCamera, frames: Iterable[HallFrame], command: str
) -> None:
    """Write a run of one camera to FOLDER/dataset, for method "landmarks" with the map FOLDER/map.npz."""
    root = Path(folder) / "dataset"
    poses = []
    for index, frame in enumerate(frames):
        _write_image(root / "images" / f"{index:04d}.png", frame.images[0])
        poses.append(frame.pose)
    save_camera(camera, root / "camera.toml")
    lines = [f"# made by: {command}", "format = 1", f'field = "{field}"', 'camera = "camera.toml"']
    lines += ['method = "landmarks"', 'map = "../map.npz"', 'images = "images"', 'truth = "truth.csv"']
    write_lines(root / "dataset.toml", lines)
    _write_truth(root / "truth.csv", poses)


def _write_image(path: Path, image: UInt8Array) -> None:
    with telling_write_errors(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_png(path, image)


def _write_truth(path: Path, poses: Sequence[Pose2]) -> None:
    rows = [f"{k:04d}.png,{p.x_m:.6f},{p.y_m:.6f},{p.theta_rad:.6f}" for k, p in enumerate(poses)]
    write_lines(path, ["image,x_m,y_m,theta_rad", *rows])
