"""Crops for training the ball classifier: balls and other places, from renderings and photographs."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from field_models.catalog import load_field
from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.evaluation.dataset import Dataset
from robocup_vision.perception.balls.network import CROP_RADIUS_PX, BallNetwork, BallPlaces, BallStrips, crop_around
from robocup_vision.perception.balls.projection import ball_projection
from robocup_vision.perception.networks import Shrunk
from sim2d.rendering.backdrop import Backdrop, BackdropKind
from sim2d.rendering.goal.scenes import nao_camera
from sim2d.rendering.pinhole import render_pinhole, smear
from sim2d.rendering.random_scenes import Condition, random_scene
from sim2d.training.ball_scenes import Scene

# side of a crop: large enough for the networks' input after any shift and scaling
BANK_PX = 48
# least distance of negative examples from all balls, in radii; nearer places are not used
_APART_RADII = 1.5
# largest deviation of the size of random places, as a logarithm
_SIZE_SPREAD = 0.25
# fields of the rendered pictures
_FIELDS = ("spl_2020", "spl_2020", "msl_18x12", "ssl_2001", "four_legged_2007")
_BACKDROPS: tuple[BackdropKind, ...] = ("plain", "hall", "hall")
_VIEW_PX = (400, 300)


class Crops(NamedTuple):
    """Crops, and which of them show a ball of radius `CROP_RADIUS_PX` in their middle."""

    #: (N, 48, 48, 3) uint8: BGR.
    images: UInt8Array
    #: (N,) bool: whether there is a ball in the middle.
    is_ball: BoolArray


class Picture(NamedTuple):
    """A picture of a field, with its balls."""

    #: (H, W, 3) uint8: BGR.
    frame: UInt8Array
    #: Places on the floor, and the size of a ball there.
    strips: BallStrips
    #: (N, 3) float64: centre u, v and radius of each ball, pixels; unsure ones are cut by the picture's border.
    balls: FloatArray
    unsure: FloatArray


def joined(parts: Sequence[Crops]) -> Crops:
    """Concatenate crops."""
    return Crops(np.concatenate([one.images for one in parts]), np.concatenate([one.is_ball for one in parts]))


def pictures_of(dataset: Dataset) -> list[Picture]:
    """Read a dataset's photographs with the balls of its boxes.csv; none if a ball's size is unknown everywhere."""
    sizes = ball_projection(dataset.camera, dataset.field.ball_radius_m).sizes
    strips = BallPlaces(sizes, dataset.mask).strips
    pictures = []
    for index in range(len(dataset.image_names)):
        sure: list[tuple[float, float, float]] = []
        cut: list[tuple[float, float, float]] = []
        for box in dataset.boxes_of(index):
            if box.kind == "ball":
                width, height = box.xmax - box.xmin, box.ymax - box.ymin
                place = ((box.xmin + box.xmax) / 2, (box.ymin + box.ymax) / 2, max(width, height) / 2)
                (cut if box.is_cut(dataset.camera.size_px) else sure).append(place)
        if strips is not None:
            balls, unsure = (np.array(places).reshape(-1, 3) for places in (sure, cut))
            pictures.append(Picture(dataset.read_frame(index), strips, balls, unsure))
    return pictures


def rendered_pictures(rng: np.random.Generator, count: int) -> list[Picture]:
    """Render pictures of fields, most of them with a ball, for a forward camera."""
    pictures = []
    for index in range(count):
        field = load_field(_FIELDS[index % len(_FIELDS)])
        camera = dataclasses.replace(nao_camera(*_VIEW_PX), height_m=float(rng.uniform(0.15, 0.8)))
        camera = camera.with_orientation(0.0, float(rng.uniform(-0.5, -0.05)), float(rng.normal(0.0, 0.02)))
        condition = Condition(
            noise_sigma=float(rng.uniform(1.0, 12.0)),
            blur_px=float(rng.uniform(0.2, 0.9)),
            light_gradient=float(rng.uniform(0.0, 0.4)),
            cast_bgr=tuple(np.exp(rng.normal(0.0, 0.1, 3))),
            gain=float(rng.uniform(0.5, 1.2)),
            texture=0.1,
            shadow=bool(rng.random() < 0.3),
            highlights=int(rng.integers(0, 3)),
            ball_rate=0.85,
            robots=int(rng.integers(0, 4)),
            robot_height_m=0.5 if field.ball_patches else 0.2,
        )
        scene, pose = random_scene(field, camera, condition, rng)
        backdrop = Backdrop(_BACKDROPS[int(rng.integers(len(_BACKDROPS)))], seed=int(rng.integers(2**31)))
        light = render_pinhole(camera, scene, pose, backdrop=backdrop, supersample=2)
        frame = condition.sensor.expose(smear(light, float(rng.uniform(0.0, 2.0))), rng)
        balls = []
        if scene.ball is not None:
            place = pose.inverse().transform([scene.ball.x_m, scene.ball.y_m])
            ray = np.array([*place, scene.ball.radius_m - camera.height_m])
            away = float(np.linalg.norm(ray))
            radius = camera.focal_px[0] * scene.ball.radius_m / away
            balls.append((*camera.ray_to_pixel(ray / away).tolist(), radius))
        strips = BallPlaces(ball_projection(camera, field.ball_radius_m).sizes, None).strips
        if strips is not None:
            pictures.append(Picture(frame, strips, np.array(balls).reshape(-1, 3), np.empty((0, 3))))
    return pictures


def scene_crops(rng: np.random.Generator, scenes: Sequence[Scene], others: int) -> Crops:
    """Cut the balls out of renderings, and up to `others` random places of each that do not show one."""
    parts = []
    for scene in scenes:
        height, width = scene.image.shape[:2]
        places = rng.uniform(0, (width, height), (others, 2))
        radii = CROP_RADIUS_PX * np.exp(rng.uniform(-_SIZE_SPREAD, _SIZE_SPREAD, others))
        parts.append(cut(Shrunk(scene.image), scene.balls, scene.unsure, np.column_stack([places, radii])))
    return joined(parts)


def picture_crops(rng: np.random.Generator, pictures: Sequence[Picture], others: int) -> Crops:
    """Cut the balls out of pictures, and up to `others` places on the floor of each that do not show one."""
    parts = []
    for one in pictures:
        places = one.strips.places_px
        # there are more places for small (far) balls: their rate is reduced
        sizes = np.floor(2 * np.log2(places[:, 2])).astype(int)
        rate = 1.0 / np.bincount(sizes - sizes.min())[sizes - sizes.min()] ** 0.5
        chosen = places[rng.choice(len(places), min(others, len(places)), replace=False, p=rate / rate.sum())]
        parts.append(cut(Shrunk(one.frame), one.balls, one.unsure, chosen))
    return joined(parts)


def mistaken_crops(pictures: Sequence[Picture], network: BallNetwork, most: int) -> Crops:
    """Cut the false balls of which a network is surest out of pictures, at most `most` of each picture."""
    parts = []
    for one in pictures:
        shrunk = Shrunk(one.frame)
        found = network.places(shrunk, one.strips, -np.inf)[:most]
        places = np.array([place[:3] for place in found]).reshape(-1, 3)
        parts.append(cut(shrunk, one.balls[:0], np.concatenate([one.balls, one.unsure]), places))
    return joined(parts)


def apart(places: FloatArray, balls: FloatArray) -> BoolArray:
    """Return (N,) which places u, v, radius (pixels) are so far from all balls that they do not show one."""
    off = np.hypot(places[:, None, 0] - balls[None, :, 0], places[:, None, 1] - balls[None, :, 1])
    near: BoolArray = off < _APART_RADII * np.maximum(places[:, None, 2], balls[None, :, 2])
    is_apart: BoolArray = np.logical_not(near.any(axis=1))
    return is_apart


def cut(shrunk: Shrunk, balls: FloatArray, unsure: FloatArray, others: FloatArray) -> Crops:
    """Cut balls (u, v, radius) out of a picture, and those of the other places that are apart from all balls."""
    others = others[apart(others, np.concatenate([balls, unsure]))]
    every = np.concatenate([balls, others])
    images = np.empty((len(every), BANK_PX, BANK_PX, 3), dtype=np.uint8)
    for image, (u, v, radius) in zip(images, every, strict=True):
        image[:] = crop_around(shrunk, u, v, radius, BANK_PX)
    is_ball: npt.NDArray[np.bool_] = np.arange(len(every)) < len(balls)
    return Crops(images, is_ball)
