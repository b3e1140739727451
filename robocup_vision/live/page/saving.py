"""Writes one moment as a dataset of one image, to be evaluated again with `robocup-vision evaluate FOLDER`."""

from __future__ import annotations

import threading
from pathlib import Path

import cv2
import numpy as np

from field_models.catalog import field_names
from field_models.errors import ArgumentError, FileError, RobocupVisionError
from robocup_vision.camera import save_camera
from robocup_vision.files.images import write_png
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.files.text_files import write_lines
from robocup_vision.live.handover.moment import Moment, RobotSetup
from robocup_vision.live.page.feed import Feed
from robocup_vision.live.page.picture import split_picture
from robocup_vision.localization.methods import METHODS
from robocup_vision.perception.color_table import save_colors

# largest number of names tried for a new folder
_MAX_FOLDERS = 10_000


def save_moment(out: Path, setup: RobotSetup, moment: Moment) -> Path:
    """Write a moment's image, time, camera, colours and truth (if known) as a dataset; return its new folder.

    Raises
    ------
    ArgumentError
        If the robot has no camera file, or its field is not a built-in one.
    FileError
        If it cannot be written.
    """
    if setup.camera is None:
        raise ArgumentError("a dataset needs a camera file, which this source has not: calibrate first")
    if setup.field.name not in field_names():
        raise ArgumentError(f"a dataset names its field: '{setup.field.name}' is no built-in one")
    camera = setup.camera if moment.view is None else moment.view.camera
    lines = ["format = 1", f'field = "{setup.field.name}"', 'camera = "camera.toml"', 'images = "images"']
    method = (moment.settings or {}).get("method")
    if method in {known.name for known in METHODS if not known.needs_map}:
        lines.append(f'method = "{method}"')
    image = "000000.png"
    with telling_write_errors(out):
        folder = new_folder(out, "frame")
        (folder / "images").mkdir()
    write_png(folder / "images" / image, moment.frame)
    save_camera(camera, folder / "camera.toml")
    if moment.colors is not None:
        save_colors(moment.colors, folder / "colors.toml")
        lines.append('colors = "colors.toml"')
    write_lines(folder / "frames.csv", ("image,t_s", f"{image},{moment.t_s!r}"))
    lines.append('frames = "frames.csv"')
    if moment.truth is not None:
        x_m, y_m, theta_rad = moment.truth.array.tolist()
        truth = ("image,x_m,y_m,theta_rad", f"{image},{x_m!r},{y_m!r},{theta_rad!r}")
        write_lines(folder / "truth.csv", truth)
        lines.append('truth = "truth.csv"')
    write_lines(folder / "dataset.toml", lines)
    return folder


def save_from(feed: Feed, robot: str, number: int, out: Path) -> None:
    """Write a picture's moment as a dataset, in a thread, and report the folder or the problem in the pages.

    The original frame is written if the feed still keeps it, else the JPEG that the page shows. Raises ArgumentError if
    neither is kept any more.
    """
    setup = next((setup for setup in feed.setups if setup.name == robot), None)
    moment, note = feed.raw(robot, number), ""
    if moment is None:
        picture = next((picture for picture in feed.history(robot) if picture.number == number), None)
        if picture is None:
            raise ArgumentError("this frame is not kept any more")
        header, jpeg, _ = split_picture(picture.data)
        frame = cv2.imdecode(np.frombuffer(jpeg, dtype=np.uint8), cv2.IMREAD_COLOR)
        moment = Moment(robot, np.asarray(frame, dtype=np.uint8), picture.t_s, settings=header["settings"])
        note = " (from the JPEG that the page shows: the frame itself is not kept so long)"
    if setup is None:
        raise ArgumentError(f"there is no robot {robot!r}")
    kept = moment

    def write() -> None:
        try:
            feed.say(f"saved {save_moment(out, setup, kept)}{note}")
        except RobocupVisionError as error:
            feed.say(f"not saved: {error}")

    threading.Thread(target=write, name="live saving").start()


def new_folder(out: Path, name: str) -> Path:
    """Make the first folder of ``name_000``, ``name_001`` ... that does not exist; return it."""
    out.mkdir(parents=True, exist_ok=True)
    for number in range(_MAX_FOLDERS):
        folder = out / f"{name}_{number:03d}"
        try:
            folder.mkdir()
        except FileExistsError:
            continue
        return folder
    raise FileError(out, f"holds {_MAX_FOLDERS} folders of this kind already")
