"""Writes rendered pictures as a dataset folder with truth, in the formats that `robocup-vision evaluate` reads."""

from __future__ import annotations

import csv
import shutil
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import cv2

from robocup_vision.camera import Camera, save_camera
from robocup_vision.files.output_folder import require_empty_folder, telling_write_errors, written_at_once
from robocup_vision.files.text_files import write_lines
from sim2d.rendering.random_scenes import Sample

TRUTH_COLUMNS = ("image", "x_m", "y_m", "theta_rad", "ball_x_m", "ball_y_m")


class EncodedPicture(NamedTuple):
    """A picture of a dataset: the file's name and content, and its row of truth.csv."""

    name: str
    content: bytes
    truth: tuple[str, ...]


def encode_picture(drawn: Sample, jpeg_quality: int | None = None) -> EncodedPicture:
    """Encode a picture as a .png file, or as a smaller .jpg file with a quality of 1 to 100."""
    suffix, options = (".png", []) if jpeg_quality is None else (".jpg", [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])
    name = f"{drawn.index:04d}{suffix}"
    pose, ball = drawn.pose, drawn.scene.ball
    place = ("", "") if ball is None else (f"{ball.x_m:.6f}", f"{ball.y_m:.6f}")
    truth = (name, f"{pose.x_m:.6f}", f"{pose.y_m:.6f}", f"{pose.theta_rad:.6f}", *place)
    return EncodedPicture(name, cv2.imencode(suffix, drawn.frame, options)[1].tobytes(), truth)


@dataclass(frozen=True, slots=True)
class DrawPictures:
    """Draws and encodes pictures by their number, in any process: the `start` of `robocup_vision.workers.run_pieces`.

    Parameters
    ----------
    sample : callable
        Yields the pictures of numbers given as `indices`, such as `sample` or `sample_goal` with all other arguments
        bound; a picture must depend on its number only.
    jpeg_quality : int, optional
        See `encode_picture`.
    """

    sample: Callable[..., Iterator[Sample]]
    jpeg_quality: int | None = None

    def __call__(self) -> Callable[[int], EncodedPicture]:
        """Return a function that draws the picture with a number; all pictures share one renderer."""
        asked: deque[int] = deque()
        drawn = self.sample(indices=iter(asked.popleft, None))

        def draw(index: int) -> EncodedPicture:
            asked.append(index)
            return encode_picture(next(drawn), self.jpeg_quality)

        return draw


def write_dataset(
    folder: str | Path,
    field_name_or_path: str | Path,
    camera: Camera,
    samples: Iterable[Sample | EncodedPicture],
    *,
    symmetry: Literal["none", "point"] = "none",
    command: str | None = None,
) -> int:
    """Write dataset.toml, camera.toml, truth.csv and images/NNNN.png or .jpg; nothing is left after an error.

    Parameters
    ----------
    folder : str or Path
        Created if absent; must be empty.
    field_name_or_path : str or Path
        Built-in field; or a field file, which is copied into the folder.
    camera : OmniCamera or PinholeCamera
        The camera for the localiser.
    samples : iterable of Sample or EncodedPicture
        The pictures, drawn one at a time.
    symmetry : {"none", "point"}
        Symmetry of the field when errors are computed.
    command : str, optional
        The command that makes this dataset, written into it.

    Returns
    -------
    int
        Number of pictures.

    Raises
    ------
    ArgumentError
        If the folder is not empty or is a file.
    FileError
        If it cannot be written.
    """
    require_empty_folder(Path(folder))
    field, count = str(field_name_or_path), 0
    lines = [] if command is None else [f"# made by: {' '.join(command.split())}"]
    with written_at_once(Path(folder), ()) as root:
        (root / "images").mkdir()
        if field.endswith(".toml"):
            shutil.copyfile(field, root / "field.toml")
            field = "field.toml"
        lines += ["format = 1", f'field = "{field}"', 'camera = "camera.toml"', 'images = "images"']
        lines += ['truth = "truth.csv"', f'symmetry = "{symmetry}"']
        write_lines(root / "dataset.toml", lines)
        save_camera(camera, root / "camera.toml")
        with (root / "truth.csv").open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(TRUTH_COLUMNS)
            for drawn in samples:
                picture = drawn if isinstance(drawn, EncodedPicture) else encode_picture(drawn)
                with telling_write_errors(root / "images" / picture.name):
                    (root / "images" / picture.name).write_bytes(picture.content)
                    rows.writerow(picture.truth)
                    file.flush()
                count += 1
    return count
