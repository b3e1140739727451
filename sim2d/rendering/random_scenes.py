"""Random poses, scenes and frames under named conditions, for measuring the reported figures."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import overload

import numpy as np
import numpy.typing as npt

from field_models import COLOR_NAMES, Field
from field_models.errors import ArgumentError
from robocup_vision.camera import Camera, OmniCamera, PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.pinhole import render_pinhole, smear
from sim2d.rendering.scene import Ball, Box, Highlight, Light, Robot, Room, Scene, Shadow, any_box_color
from sim2d.rendering.sensor import Sensor

BALL_RANGE_M = 1.5  # greatest distance of a ball from the robot
CLEARANCE_M = 0.01  # between any two objects on the field
OPEN_M = 0.10  # free distance around a ball
TRIES = 2000
CIRCLE = np.stack([np.cos(np.arange(8) * math.pi / 4), np.sin(np.arange(8) * math.pi / 4)], axis=1)
RING_BOXES = (7, 8)
RING_RANGE_M = (0.17, 0.42)


@dataclass(frozen=True, slots=True)
class Condition:
    """Disturbances of pictures, and the objects on the field.

    Parameters
    ----------
    noise_sigma, blur_px, vignette, cast_bgr, gain, jpeg_quality
        Parameters of the `Sensor`.
    light_gradient : float
        Relative change of light from the field's centre over half its length, in a random direction.
    texture : float
        Relative standard deviation of the carpet's brightness.
    shadow : bool
        A hard, bluish shadow over a random part of the floor.
    highlights : int
        Number of lamp reflections.
    spin_rad : float
        Rotation during the exposure.
    obstacles : (int, int)
        Least and greatest number of boxes.
    ring : bool
        The boxes surround the robot: the nearest point of each is 0.17 to 0.42 m from the robot's centre. If too few
        fit because of walls, the rest are placed anywhere.
    ball_rate : float
        Probability of a ball in a frame.
    center_offset_px : (float, float)
        True image centre minus that of the given camera.
    tilt_rad : (float, float)
        True tilt minus that of the given camera, about the robot's x and y axes. For a pinhole camera these are its
        roll and its tilt downwards.
    robots : int
        Number of robots, and their height `robot_height_m`.
    """

    noise_sigma: float = 8.0
    blur_px: float = 0.7
    vignette: float = 0.25
    light_gradient: float = 0.2
    cast_bgr: tuple[float, float, float] = (1.0, 1.0, 1.0)
    gain: float = 1.0
    texture: float = 0.0
    shadow: bool = False
    highlights: int = 0
    spin_rad: float = 0.0
    jpeg_quality: int | None = None
    obstacles: tuple[int, int] = (0, 8)
    ring: bool = False
    ball_rate: float = 0.5
    center_offset_px: tuple[float, float] = (0.0, 0.0)
    tilt_rad: tuple[float, float] = (0.0, 0.0)
    robots: int = 0
    robot_height_m: float = 0.14

    def __post_init__(self) -> None:
        if not 0 <= self.obstacles[0] <= self.obstacles[1]:
            raise ArgumentError(f"obstacles must be 0 <= low <= high, got {list(self.obstacles)}")
        if not 0 <= self.ball_rate <= 1:
            raise ArgumentError(f"ball_rate must be within 0 to 1, got {self.ball_rate}")
        for name in ("texture", "light_gradient", "highlights", "robots"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ArgumentError(f"{name} must not be negative, got {getattr(self, name)}")
        _ = self.sensor

    @property
    def sensor(self) -> Sensor:
        """The sensor of these pictures."""
        return Sensor(self.noise_sigma, self.blur_px, self.vignette, self.cast_bgr, self.gain, self.jpeg_quality)

    @overload
    def true_camera(self, camera: OmniCamera) -> OmniCamera: ...
    @overload
    def true_camera(self, camera: Camera) -> Camera: ...
    def true_camera(self, camera: Camera) -> Camera:
        """Return the camera that takes the pictures if `camera` is given to the localiser."""
        (u, v), (du, dv) = camera.center_px, self.center_offset_px
        center_px, (dtx, dty) = (u + du, v + dv), self.tilt_rad
        if isinstance(camera, PinholeCamera):
            tilt, roll = (camera.tilt_rad or 0.0) - dty, (camera.roll_rad or 0.0) + dtx
            return dataclasses.replace(camera, center_px=center_px, tilt_rad=tilt, roll_rad=roll)
        tx, ty = camera.tilt_rad
        return dataclasses.replace(camera, center_px=center_px, tilt_rad=(tx + dtx, ty + dty))


CONDITIONS: dict[str, Condition] = {
    "nominal": Condition(),
    "noisy": Condition(noise_sigma=18.0, blur_px=0.9),
    "warm": Condition(cast_bgr=(0.80, 0.95, 1.25)),
    "cold": Condition(cast_bgr=(1.25, 0.95, 0.80)),
    "dark": Condition(gain=0.4),
    "crowd": Condition(obstacles=RING_BOXES, ring=True),
    "bad_day": Condition(
        noise_sigma=6.0, texture=0.10, shadow=True, highlights=3, spin_rad=math.radians(1.0), jpeg_quality=85
    ),
    "miscalibrated": Condition(center_offset_px=(0.6, -0.5), tilt_rad=(math.radians(0.3), math.radians(-0.2))),
}


@dataclass(frozen=True, eq=False)
class Sample:
    """One picture with its truth: frame (H, W, 3) uint8, scene, the robot's pose, and number."""

    frame: npt.NDArray[np.uint8]
    scene: Scene
    pose: Pose2
    index: int


def sample(
    field: Field,
    camera: Camera,
    condition: Condition,
    seed: int,
    count: int,
    *,
    indices: Iterable[int] | None = None,
    supersample: int = 3,
) -> Iterator[Sample]:
    """Yield random pictures; sample i depends on `seed` and i only.

    Parameters
    ----------
    field : Field
        The pitch.
    camera : OmniCamera or PinholeCamera
        Camera for the localiser; pictures are taken with `condition.true_camera(camera)`. A pinhole camera's tilt must
        be known; the ball is then in its view.
    condition : Condition
        Disturbances and obstacles.
    seed : int
        Not negative.
    count : int
        Samples 0 to count - 1 are made.
    indices : iterable of int, optional
        Make these samples instead.
    supersample : int
        Rays for each pixel along each image axis.
    """
    true = condition.true_camera(camera)
    renderer = MirrorRenderer(true, supersample) if isinstance(true, OmniCamera) else None
    for index in range(count) if indices is None else indices:
        rng = np.random.default_rng([seed, index])
        scene, pose = random_scene(field, camera, condition, rng)
        if isinstance(true, PinholeCamera):
            light = render_pinhole(true, scene, pose, supersample=supersample)
            light = smear(light, abs(condition.spin_rad) * true.focal_px[0])
        else:
            assert renderer is not None
            light = renderer.render(scene, pose, spin_rad=condition.spin_rad)
        yield Sample(condition.sensor.expose(light, rng), scene, pose, index)


def _ball_view(camera: Camera) -> tuple[float, float, float]:
    """Return where a camera sees the floor: the middle bearing, half the width (both rad), the smallest range (m)."""
    if not isinstance(camera, PinholeCamera):
        return 0.0, math.pi, 0.0
    (width, height), (u, _) = camera.size_px, camera.center_px
    half = min(math.atan2(min(u, width - 1 - u), camera.focal_px[0]), math.pi / 3)
    foot = camera.pixel_to_floor((u, height - 1.0))
    return camera.pan_rad or 0.0, 0.9 * half, float(np.hypot(*foot)) if np.isfinite(foot).all() else 0.0


def random_scene(field: Field, camera: Camera, condition: Condition, rng: np.random.Generator) -> tuple[Scene, Pose2]:
    """Draw a random pose of the robot on the floor, and its surroundings; a ball is in the camera's view."""
    bare = Scene(field)
    x, y = _place(bare, field.robot_radius_m, rng)
    pose = Pose2(x, y, rng.uniform(-math.pi, math.pi))
    count = int(rng.integers(condition.obstacles[0], condition.obstacles[1] + 1))
    boxes: list[Box] = []
    if condition.ring:
        _add_ring(bare, pose, count, boxes, rng)
    _add_anywhere(bare, pose, count, boxes, rng)
    ball = _ball(bare, pose, boxes, rng, camera) if rng.random() < condition.ball_rate else None
    margin = float(rng.uniform(0.0, 1.0))
    scene = Scene(
        field=field,
        boxes=tuple(boxes),
        robots=_robots(bare, pose, boxes, ball, condition, rng),
        ball=ball,
        light=_light(field, condition, rng),
        room=Room(int(rng.integers(2**31)), float(rng.uniform(0.8, 2.0)), bystanders=int(rng.integers(4, 17))),
        carpet_margin_m=0.0 if field.is_bounded else margin,
    )
    return scene, pose


def _light(field: Field, condition: Condition, rng: np.random.Generator) -> Light:
    low, high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
    shadow, highlights = None, []
    direction, offset = rng.uniform(-math.pi, math.pi), rng.uniform(-0.25, 0.25) * float(np.min(high - low))
    if condition.shadow:
        shadow = Shadow(float(direction), float(offset), float(offset + rng.uniform(0.3, 1.0) * (high - low).max()))
    for _ in range(condition.highlights):
        x, y = rng.uniform(low, high)
        sigma_m = rng.uniform(0.04, 0.10) * float(np.min(high - low))
        highlights.append(Highlight(float(x), float(y), float(sigma_m), float(rng.uniform(40, 110))))
    return Light(
        gradient=condition.light_gradient,
        gradient_direction_rad=float(rng.uniform(-math.pi, math.pi)),
        texture=condition.texture,
        texture_seed=int(rng.integers(2**31)),
        shadow=shadow,
        highlights=tuple(highlights),
    )


def _place(scene: Scene, radius_m: float, rng: np.random.Generator) -> tuple[float, float]:
    """Draw the centre of a disc on the floor that is free of upright objects."""
    low, high = scene.field.floor_polygon.min(axis=0), scene.field.floor_polygon.max(axis=0)
    for _ in range(TRIES):
        x, y = rng.uniform(low, high)
        outline = np.array([x, y]) + radius_m * CIRCLE
        if scene.field.contains(outline).all() and scene.clearance_m(x, y) >= radius_m + CLEARANCE_M:
            return float(x), float(y)
    raise ArgumentError(f"field '{scene.field.name}' has no room for a robot of radius {radius_m} m")


def _fits(scene: Scene, pose: Pose2, box: Box, boxes: list[Box]) -> bool:
    reach = math.hypot(box.width_m, box.depth_m) / 2 + CLEARANCE_M
    return (
        bool(scene.field.contains(box.corners).all())
        and scene.clearance_m(box.x_m, box.y_m) >= reach
        and box.distance_m(pose.x_m, pose.y_m) >= scene.field.robot_radius_m + CLEARANCE_M
        and all(other.distance_m(box.x_m, box.y_m) >= reach for other in boxes)
    )


def _add_anywhere(scene: Scene, pose: Pose2, count: int, boxes: list[Box], rng: np.random.Generator) -> None:
    low, high = scene.field.floor_polygon.min(axis=0), scene.field.floor_polygon.max(axis=0)
    for _ in range(TRIES):
        if len(boxes) >= count:
            return
        x, y = rng.uniform(low, high)
        box = Box(float(x), float(y), float(rng.uniform(0, math.pi / 2)), color_bgr=any_box_color(rng))
        if _fits(scene, pose, box, boxes):
            boxes.append(box)


def _add_ring(scene: Scene, pose: Pose2, count: int, boxes: list[Box], rng: np.random.Generator) -> None:
    for _ in range(TRIES):
        if len(boxes) >= count:
            return
        wanted_m, bearing = rng.uniform(*RING_RANGE_M), rng.uniform(-math.pi, math.pi)
        box = Box(0.0, 0.0, float(rng.uniform(0, math.pi / 2)), color_bgr=any_box_color(rng))
        # bisection along the bearing for the wanted distance of its nearest point
        near, far = wanted_m, wanted_m + box.width_m
        for _ in range(20):
            middle = (near + far) / 2
            x, y = pose.x_m + middle * math.cos(bearing), pose.y_m + middle * math.sin(bearing)
            box = dataclasses.replace(box, x_m=x, y_m=y)
            near, far = (middle, far) if box.distance_m(pose.x_m, pose.y_m) < wanted_m else (near, middle)
        if _fits(scene, pose, box, boxes):
            boxes.append(box)


def _robots(
    scene: Scene, pose: Pose2, boxes: list[Box], ball: Ball | None, condition: Condition, rng: np.random.Generator
) -> tuple[Robot, ...]:
    """Draw robots that touch no other object."""
    radius, robots = scene.field.robot_radius_m, list[Robot]()
    for _ in range(TRIES):
        if len(robots) == condition.robots:
            break
        x, y = _place(scene, radius, rng)
        apart = [math.hypot(x - pose.x_m, y - pose.y_m) - radius]
        apart += [math.hypot(x - other.x_m, y - other.y_m) - radius for other in robots]
        apart += [box.distance_m(x, y) for box in boxes]
        apart += [] if ball is None else [math.hypot(x - ball.x_m, y - ball.y_m) - ball.radius_m]
        if min(apart) > radius + CLEARANCE_M:
            marker = COLOR_NAMES["yellow" if len(robots) % 2 else "blue"]
            robots.append(Robot(x, y, radius, condition.robot_height_m, marker_bgr=marker))
    if len(robots) < condition.robots:
        raise ArgumentError(f"field '{scene.field.name}' has no room for {condition.robots} robots")
    return tuple(robots)


def _ball(scene: Scene, pose: Pose2, boxes: list[Box], rng: np.random.Generator, camera: Camera) -> Ball | None:
    """Place a ball with free floor around it, in the camera's view; None if no place was found."""
    field = scene.field
    radius = field.ball_radius_m
    middle_rad, half_rad, nearest_seen_m = _ball_view(camera)
    with_boxes = Scene(field, boxes=tuple(boxes))
    for _ in range(TRIES):
        bearing = middle_rad + rng.uniform(-half_rad, half_rad)
        nearest_m = max(field.robot_radius_m + 2 * radius + 0.05, nearest_seen_m)
        range_m = rng.uniform(nearest_m, max(BALL_RANGE_M, 4 * field.robot_radius_m, 2 * nearest_seen_m))
        x, y = pose.compose(Pose2(range_m * math.cos(bearing), range_m * math.sin(bearing), 0.0)).array[:2]
        if not field.contains([x, y]) or with_boxes.clearance_m(x, y) < radius + OPEN_M:
            continue
        spread = math.atan2(1.5 * radius, range_m)
        ahead = with_boxes.free_range_m(pose, bearing + np.linspace(-spread, spread, 5))
        if ahead.min() > range_m + radius:
            ball = Ball(float(x), float(y), radius, COLOR_NAMES[field.ball_color])
            # in a mirror's picture a ball is too small to show its patches
            if not field.ball_patches or isinstance(camera, OmniCamera):
                return ball
            turn = tuple(rng.uniform(-math.pi, math.pi, 3).tolist())
            return dataclasses.replace(ball, patches_bgr=COLOR_NAMES[field.ball_patches], turn_rad=turn)
    return None
