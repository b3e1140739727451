"""Folders of images with their camera file and what is known of them, as a user has them scored and checked."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np

from robocup_vision.camera import OmniCamera, PinholeCamera, save_camera
from robocup_vision.geometry import Pose2

# the file of a mirror camera of 64 x 56 pixels
SMALL_CAMERA = (Path(__file__).parent / "fuzz" / "corpus" / "tangent_camera.toml").read_text()


def write_dataset(
    path: Path,
    frames: Iterable[np.ndarray],
    camera: OmniCamera | PinholeCamera,
    field: str,
    /,
    *,
    truth: Sequence[Sequence[float]] | None = None,
    motions: Sequence[Pose2 | None] | None = None,
    **keys: str,
) -> Path:
    """Write frames, a second apart, and what is said of them; return the folder.

    Parameters
    ----------
    truth : rows (3,) of each frame's pose
    motions : of each frame since the one before
    keys : further ones of dataset.toml
    """
    (path / "images").mkdir()
    for number, frame in enumerate(frames):
        cv2.imwrite(str(path / "images" / f"{number}.png"), np.ascontiguousarray(frame))
    save_camera(camera, path / "camera.toml")
    said = {"field": field, "camera": "camera.toml", "images": "images"} | keys
    if truth is not None:
        said["truth"] = "truth.csv"
        rows = [f"{number}.png,{x},{y},{theta}" for number, (x, y, theta) in enumerate(truth)]
        (path / "truth.csv").write_text("\n".join(["image,x_m,y_m,theta_rad", *rows]) + "\n")
    if motions is not None:
        said["frames"] = "frames.csv"
        steps = ["" if one is None else one.array.tolist() for one in motions]
        rows = [f"{number}.png,{number},{','.join(map(str, step)) or ',,'}" for number, step in enumerate(steps)]
        (path / "frames.csv").write_text("\n".join(["image,t_s,dx_m,dy_m,dtheta_rad", *rows]) + "\n")
    lines = ["format = 1", *(f'{key} = "{value}"' for key, value in said.items())]
    (path / "dataset.toml").write_text("\n".join(lines) + "\n")
    return path
