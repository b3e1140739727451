"""Pictures of every kind of field and camera for the markings in them, with what is really in view."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from benchmarks.worlds.walks import camera_ahead
from field_models import Field, load_field
from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.camera import FisheyeCamera, OmniCamera, PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.perception.markings.field_features import FieldFeatures
from sim2d.match.setups import CAMERAS
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Light, Robot, Room, Scene
from sim2d.rendering.sensor import Sensor

Camera = OmniCamera | PinholeCamera
# farther beyond a robot's rim than this nothing is hidden by it
_HIDING_M = 0.1


@dataclass(frozen=True)
class MarkingWorld:
    """A field, a camera as its file says, and what robots stand about."""

    field_name: str  #: the pitch
    camera: Camera  #: as its file says; a forward one is held off by what the file states
    robot_size_m: tuple[float, float]  #: radius and height of others

    @cached_property
    def field(self) -> Field:
        """The pitch."""
        return load_field(self.field_name)


_ahead = partial(camera_ahead, height_std_m=0.005, roll_std_deg=0.6)


def _mirror(name: str) -> OmniCamera:
    camera = CAMERAS[name]()
    assert isinstance(camera, OmniCamera)
    return camera


_FISHEYE = FisheyeCamera(
    (480, 360),
    (190.0, 190.0),
    (239.5, 179.5),
    0.75,
    pan_rad=0.0,
    tilt_rad=math.radians(-35.0),
    roll_rad=0.0,
    height_std_m=0.005,
    roll_std_rad=math.radians(0.6),
    projection="equidistant",
)
WORLDS: dict[str, MarkingWorld] = {
    "four-legged, 208 px": MarkingWorld("four_legged_2007", _ahead((208, 160), 192.0, 0.185, -10.0), (0.12, 0.25)),
    "standard platform, 640 px": MarkingWorld("spl_2020", _ahead((640, 480), 616.0, 0.46, -14.0), (0.15, 0.55)),
    "humanoid, 640 px": MarkingWorld("humanoid_kid_2025", _ahead((640, 480), 460.0, 0.6, -25.0), (0.15, 0.8)),
    "small size, 320 px": MarkingWorld("ssl_division_b", _ahead((320, 240), 160.0, 0.12, -10.0), (0.09, 0.15)),
    "middle size, fisheye": MarkingWorld("msl_18x12", _FISHEYE, (0.25, 0.75)),
    "small size, mirror": MarkingWorld("ssl_2001", _mirror("ssl_mirror"), (0.09, 0.14)),
    "middle size, mirror": MarkingWorld("msl_18x12", _mirror("msl_mirror"), (0.25, 0.75)),
}


@dataclass(frozen=True, eq=False)
class MarkedFrame:
    """One picture, and what is true of it."""

    frame: UInt8Array  #: (H, W, 3) uint8: the picture
    camera: Camera  #: as it truly was held
    robot: Pose2  #: where it truly was
    others: tuple[Robot, ...]  #: who stood about

    def pixels_of(self, places_m: FloatArray) -> FloatArray:
        """Pixels (N, 2) of places (N, 2) of the field; NaN where they are out of view, or somebody may hide them."""
        pixels = self.camera.floor_to_pixel(self.robot.inverse().transform(places_m))
        width, height = self.camera.size_px
        seen = (
            np.isfinite(pixels).all(axis=1) & (pixels >= 4).all(axis=1) & (pixels < (width - 4, height - 4)).all(axis=1)
        )
        if isinstance(self.camera, OmniCamera):
            radius = np.hypot(*(pixels - self.camera.center_px).T)
            inner, outer = self.camera.usable_radius_px
            seen &= (radius > inner + 3) & (radius < outer - 3)
        eye = np.array(self.robot.transform(self.camera.offset_m))
        for other in self.others:
            seen &= ~_is_behind(places_m, eye, np.array([other.x_m, other.y_m]), other.radius_m + _HIDING_M)
        return np.asarray(np.where(np.asarray(seen)[:, None], pixels, np.nan))


def _is_behind(places_m: FloatArray, eye_m: FloatArray, robot_m: FloatArray, radius_m: float) -> BoolArray:
    """Whether the way from the eye to places (N, 2) passes a robot."""
    way = places_m - eye_m
    length2 = np.maximum((way**2).sum(axis=1), 1e-12)
    part = np.clip(((robot_m - eye_m) * way).sum(axis=1) / length2, 0.0, 1.0)
    return np.asarray(np.hypot(*(eye_m + part[:, None] * way - robot_m).T) < radius_m)


def marked_frames(world: MarkingWorld, seed: int, count: int) -> Iterator[MarkedFrame]:
    """Yield pictures from places all over a field, the camera held as well as its file says."""
    field, features = world.field, FieldFeatures(world.field, 3.0)
    mirror = MirrorRenderer(world.camera) if isinstance(world.camera, OmniCamera) else None
    half = np.array([field.length_m, field.width_m]) / 2
    for index in range(count):
        rng = np.random.default_rng([seed, index, 0x3A])
        x, y = (rng.uniform(-0.9, 0.9, 2) * half).tolist()
        heading = float(rng.uniform(-math.pi, math.pi))
        # most look at a crossing or the middle: carpet alone tells nothing
        if rng.random() < 0.8:
            to_x, to_y = ([[0.0, 0.0], *features.crossings_m.tolist()])[
                int(rng.integers(len(features.crossings_m) + 1))
            ]
            heading = math.atan2(to_y - y, to_x - x) + float(rng.normal(0.0, 0.2))
        pose = Pose2(x, y, heading)
        others = []
        for _ in range(int(rng.integers(0, 4))):
            away, bearing = float(rng.uniform(0.25, 1.0)) * field.width_m / 2, float(rng.uniform(-math.pi, math.pi))
            there = pose.transform((away * math.cos(bearing), away * math.sin(bearing)))
            if away > 3 * world.robot_size_m[0]:
                others.append(Robot(float(there[0]), float(there[1]), *world.robot_size_m))
        scene = Scene(
            field,
            robots=tuple(others),
            light=Light(
                level=float(rng.uniform(0.8, 1.05)),
                gradient=float(rng.uniform(0.0, 0.2)),
                texture=0.06,
                texture_seed=int(rng.integers(2**31)),
            ),
            room=Room(seed=int(rng.integers(2**31)), distance_m=float(rng.uniform(0.3, 1.5))),
            carpet_margin_m=0.3,
        )
        camera, sensor = world.camera, Sensor(noise_sigma=3.0, blur_px=0.6, vignette=0.1)
        if isinstance(camera, OmniCamera):
            assert mirror is not None
            light = mirror.render(scene, pose)
        else:
            tilt_std, roll_std = camera.sway_std_rad
            tilt, roll, height = rng.standard_normal(3).tolist()
            camera = replace(camera, height_m=camera.height_m + camera.height_std_m * height)
            camera = camera.with_orientation(0.0, (camera.tilt_rad or 0.0) + tilt_std * tilt, roll_std * roll)
            light = render_pinhole(camera, scene, pose, supersample=2)
        yield MarkedFrame(sensor.expose(light, rng), camera, pose, tuple(others))
