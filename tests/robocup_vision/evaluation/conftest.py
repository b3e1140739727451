"""A small dataset on disk, and a localiser that knows the answers, importable by worker processes too."""

import csv
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest
from dataset_folders import SMALL_CAMERA

from robocup_vision.evaluation.run import evaluate

SIZE = (64, 56)
DATASET = """
format = 1
field = "ssl_2001"
camera = "camera.toml"
images = "images"
truth = "truth.csv"
symmetry = "point"
"""
# The pose stands in the image's first pixels; the kinds of failure in the fourth.
FAKE = """
import os

import numpy as np
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2


class View:
    def __init__(self, pose):
        self.pose = pose


class MountedView(View):
    @property
    def camera_pose(self):
        return self.pose.seen_from(Pose2(0.3, 0.0, 0.5)) if self.pose else self.pose


class MountedVision:
    def __init__(self, dataset):
        self.vision = FakeVision(dataset)

    def look(self, frame, t_s=None, odometry=None):
        return MountedView(self.vision.look(frame, t_s, odometry).pose)

    def forget(self):
        self.vision.forget()


class FakeVision:
    def __init__(self, dataset):
        self.calls = []

    def look(self, frame, t_s=None, odometry=None):
        self.calls.append(("look", t_s, odometry))
        x, y, theta, kind = (float(v) for v in frame[0, :4, 0])
        if kind == 1:
            return View(NotLocated("too dark\\nto see"))
        if kind == 2:
            raise RuntimeError("a bug,\\n in two lines")
        pose = Pose2((x - 128) / 100, (y - 128) / 100, (theta - 128) / 40)
        if kind == 9:
            os._exit(3)
        if kind == 3:
            pose = Pose2(float("nan"), 0.0, 0.0)
        return View(PoseEstimate(pose, np.diag([1e-4, 1e-4, 1e-4]), 0.9, 0.5, (pose, pose.half_turn())))

    def forget(self):
        self.calls.append(("forget",))


def draw(view, frame, vision):
    picture = frame.copy()
    picture[:, :, 2] = 255
    return picture


def draw_badly(view, frame, vision):
    raise RuntimeError("no paint")
"""


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the module with `FakeVision`; worker processes find it by the same path."""
    folder = tmp_path / "plug_in"
    folder.mkdir()
    (folder / "fake_localiser.py").write_text(FAKE)
    monkeypatch.syspath_prepend(folder)
    sys.modules.pop("fake_localiser", None)
    return importlib.import_module("fake_localiser")


@pytest.fixture
def scored(fake: ModuleType, tmp_path: Path) -> Callable[..., Any]:
    """Return a function that evaluates a dataset with that localiser."""

    def run(dataset: Any, out: str = "out", jobs: int = 1, **options: Any) -> Any:
        given = {"make_vision": fake.FakeVision, "draw_overlay": fake.draw, **options}
        return evaluate(dataset, tmp_path / out, jobs, **given)

    return run


def write_image(path: Path, pose_codes: tuple[int, int, int], kind: int = 0) -> None:
    image = np.full((SIZE[1], SIZE[0], 3), 90, dtype=np.uint8)
    image[0, :4] = np.array([*pose_codes, kind])[:, None]
    assert cv2.imwrite(str(path), image)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a dataset folder of five images that are seen 1 cm too far in x, the last with truth but no heading."""
    root = tmp_path / "set"
    (root / "images").mkdir(parents=True)
    (root / "camera.toml").write_text(SMALL_CAMERA)
    (root / "dataset.toml").write_text(DATASET)
    rows = []
    for index in range(5):
        codes = (128 + 10 * index, 120, 128 + 8 * index)
        write_image(root / "images" / f"{index}.png", codes)
        theta = (codes[2] - 128) / 40 if index < 4 else ""
        rows.append([f"{index}.png", (codes[0] - 1 - 128) / 100, (codes[1] - 128) / 100, theta, "further"])
    with (root / "truth.csv").open("w", newline="") as stream:
        csv.writer(stream).writerows([["image", "x_m", "y_m", "theta_rad", "remark"], *rows])
    return root
