"""No pose from pictures that show no field: painted ones and, where they are, photographs of other things."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from field_models import load_field
from robocup_vision import Pose2, Vision, load_camera
from robocup_vision.camera import PinholeCamera
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.no_field import PAINTERS, no_field_picture

IMAGES = Path(__file__).resolve().parents[2] / "images"
NEGATIVES = Path(__file__).resolve().parents[3] / "shared" / "real" / "negatives" / "images"
SEED = 20010305


def head_camera():
    return PinholeCamera(
        size_px=(208, 160), focal_px=(192.0, 192.0), center_px=(103.5, 79.5), height_m=0.185, height_std_m=0.006,
        pan_rad=0.0, tilt_rad=-0.17, roll_rad=0.0, roll_std_rad=0.024,
    )  # fmt: skip


CAMERAS = {
    # field, camera, pictures, and every how many a random prior is handed over, too
    "mirror, walls": ("ssl_2001", sekimori_camera, 400, 5),
    "mirror, carpet": ("msl_6x4", sekimori_camera, 300, 5),
    "goal": ("four_legged_2007", lambda: load_camera(IMAGES / "goal_four_legged" / "camera.toml"), 150, 10),
    "edges": ("four_legged_2007", head_camera, 150, 5),
}


def random_pose(field, rng):
    half = np.array([field.length_m / 2, field.width_m / 2, np.pi])
    return Pose2(*rng.uniform(-half, half).tolist())


def crop_to(picture, size_px, rng):
    """Return a random part of a photograph, at least half as wide, turned over or not, in another size."""
    height, width = picture.shape[:2]
    part = rng.uniform(0.5, 1.0)
    tall, wide = max(1, int(part * height)), max(1, int(part * width))
    top, left = int(rng.integers(0, height - tall + 1)), int(rng.integers(0, width - wide + 1))
    cut = picture[top : top + tall, left : left + wide]
    if rng.random() < 0.5:
        cut = cut[:, ::-1]
    return cv2.resize(np.ascontiguousarray(cut), size_px, interpolation=cv2.INTER_AREA)


@pytest.mark.slow
@pytest.mark.parametrize("name", CAMERAS)
def test_pictures_without_a_field_give_no_pose(name):
    """Only this finds a localiser that takes other pictures, painted ones or photographs, for its field."""
    field_name, make_camera, count, every = CAMERAS[name]
    field, camera = load_field(field_name), make_camera()
    vision = Vision(field, camera)
    photographs = [cv2.imread(str(path)) for path in sorted(NEGATIVES.glob("*"))] if NEGATIVES.is_dir() else []
    located = []
    for index in range(count):
        rng = np.random.default_rng([SEED, index, 1])
        if photographs and index % 4 == 3:
            kind, picture = "photograph", crop_to(photographs[index // 4 % len(photographs)], camera.size_px, rng)
        else:
            kind, picture = no_field_picture(camera.size_px, index, SEED)
        for prior in (None, random_pose(field, rng))[: 2 if index % every == 0 else 1]:
            vision.forget()
            view = vision.look(picture, prior=prior)
            if view.pose:
                located.append((kind, index, prior, view.pose.pose))
    assert located == []


def test_pictures_are_of_all_kinds_and_repeat():
    kinds = [no_field_picture((64, 48), index, 1) for index in range(2 * len(PAINTERS))]
    assert {kind for kind, _ in kinds} == set(PAINTERS)
    for index, (_, picture) in enumerate(kinds):
        assert picture.shape == (48, 64, 3)
        assert picture.dtype == np.uint8
        np.testing.assert_array_equal(picture, no_field_picture((64, 48), index, 1)[1])
