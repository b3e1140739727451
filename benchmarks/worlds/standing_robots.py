"""Robots and a ball that stand anywhere on a field, as one robot's camera sees them, with what of them is in view."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from field_models import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera import FisheyeCamera, OmniCamera, PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.match.setups import CAMERAS, RobotKind, setup_for
from sim2d.rendering.backdrop import Backdrop
from sim2d.rendering.scene import Light, Room, Scene
from sim2d.sensors.match_camera import MatchCamera
from sim2d.world.state import BallState, RobotState, WorldState

Camera = OmniCamera | PinholeCamera

# cameras of the kind that a league's matches are not played with
_FORWARD = {"ssl_2001": "ssl_forward", "msl_6x4": "wide", "msl_18x12": "wide"}
_MIRROR = {
    "four_legged_2005": "sekimori",
    "four_legged_2007": "sekimori",
    "ssl_2001": "sekimori",
    "ssl_division_a": "ssl_mirror",
    "ssl_division_b": "ssl_mirror",
}
_GAP_M = 0.03
_TRIES = 2000
# so many of the robots are put before the camera, within so many radii, the others anywhere
_AHEAD, _REACH = 0.4, 20
# across a robot, to see how much of it is in view
_RAYS = 64


@dataclass(frozen=True, slots=True, eq=False)
class SeenRobot:
    """A robot in view, robot frame of the one that looks."""

    #: its middle, and its radius
    x_m: float
    y_m: float
    radius_m: float
    in_view: float  #: fraction of its width whose foot is in the picture, before whatever else stands there
    error_m: float  #: what one pixel is on the floor along the bearing, at its foot

    @property
    def is_certain(self) -> bool:
        """Whether at least half of it is in view, and a pixel to either side of its foot leaves it within its size."""
        return self.in_view >= 0.5 and self.error_m <= self.radius_m


@dataclass(frozen=True, slots=True, eq=False)
class StandingFrame:
    """A picture with its truth: where the camera's robot is, and all other robots of which anything is in view."""

    frame: UInt8Array
    pose: Pose2
    scene: Scene
    robots: tuple[SeenRobot, ...]


def forward_camera(field: Field) -> PinholeCamera:
    """Return a camera that looks ahead from robots of a field's size: that of its matches, where it is one."""
    name = _FORWARD.get(field.name)
    camera = setup_for(field).camera if name is None else wide_camera() if name == "wide" else CAMERAS[name]()
    assert isinstance(camera, PinholeCamera)
    return camera


def wide_camera() -> PinholeCamera:
    """Return a camera of 640 x 480 pixels and 70 degrees, 0.45 m high, 15 degrees down."""
    return PinholeCamera((640, 480), (457.0, 457.0), (319.5, 239.5), 0.45, pan_rad=0.0, tilt_rad=-0.26, roll_rad=0.0)


def fisheye_camera(field: Field) -> FisheyeCamera:
    """Return a fisheye of 640 x 480 pixels, 158 degrees from corner to corner, as high as the forward camera."""
    return FisheyeCamera(
        (640, 480),
        (290.0, 290.0),
        (319.5, 239.5),
        forward_camera(field).height_m,
        pan_rad=0.0,
        tilt_rad=-0.17,
        roll_rad=0.0,
        projection="equidistant",
    )


def mirror_camera(field: Field) -> OmniCamera:
    """Return a mirror camera for robots of a field's size: that of its matches, where it is one."""
    camera = CAMERAS[_MIRROR.get(field.name, "msl_mirror")]()
    assert isinstance(camera, OmniCamera)
    return camera


def standing_frames(field: Field, camera: Camera, seed: int, count: int) -> Iterator[StandingFrame]:
    """Yield pictures of robots of the field's league, none to all of a match's, and of a ball in half of them."""
    setup = setup_for(field)
    limits = setup.robot.limits
    places = _Places(field, setup.robot, camera)
    rooms = (Room(seed=seed % 1000, distance_m=1.2), Room(seed=seed % 1000 + 1, distance_m=1.5))
    if isinstance(camera, PinholeCamera):
        rooms = (rooms[0], replace(rooms[1], bystanders=8))
    backdrops = (Backdrop("hall", seed=seed % 1000) if isinstance(camera, PinholeCamera) else None, None)
    takers = [
        MatchCamera(field, camera, limits, np.random.default_rng([seed, k]), room=room, backdrop=backdrop)
        for k, (room, backdrop) in enumerate(zip(rooms, backdrops, strict=True))
    ]
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        taker = takers[index % 2]
        state = places.draw(int(rng.integers(0, 2 * setup.players)), rng)
        taker.set_light(Light(gradient=float(rng.uniform(0, 0.3)), gradient_direction_rad=float(rng.uniform(-3, 3))))
        frame, scene, pose = taker.render(state, 0), taker.scene(state, 0), state.robots[0].pose
        yield StandingFrame(frame, pose, scene, seen_robots(scene, camera, pose))


class _Places:
    """Draws where everything stands."""

    def __init__(self, field: Field, robot: RobotKind, camera: Camera) -> None:
        self._field, self._radius_m, self._camera = field, robot.limits.radius_m, camera

    def draw(self, others: int, rng: np.random.Generator) -> WorldState:
        field, bare = self._field, Scene(self._field)
        low, high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
        half_rad, reach_m = math.pi, _REACH * self._radius_m
        if isinstance(self._camera, PinholeCamera):
            half_rad = math.atan(self._camera.size_px[0] / 2 / self._camera.focal_px[0])
        taken: list[tuple[float, float]] = []
        own = Pose2(0.0, 0.0, 0.0)
        for number in range(others + 1):
            is_ahead = number > 0 and rng.random() < _AHEAD
            for _ in range(_TRIES):
                x, y = rng.uniform(low, high).tolist()
                if is_ahead:
                    bearing, range_m = rng.uniform(-half_rad, half_rad), rng.uniform(3 * self._radius_m, reach_m)
                    x, y = own.transform((range_m * math.cos(bearing), range_m * math.sin(bearing))).tolist()
                if self._is_free((x, y), taken, bare):
                    taken.append((x, y))
                    break
            if number == 0:
                own = Pose2(*taken[0], rng.uniform(-math.pi, math.pi))
        robots = [
            RobotState(n, 1 if n % 2 else -1, n, own if n == 0 else Pose2(x, y, 0.0), (0.0, 0.0), 0.0)
            for n, (x, y) in enumerate(taken)
        ]
        ball = self._ball(own, half_rad, reach_m, taken, bare, rng) if rng.random() < 0.5 else None
        return WorldState(0.0, tuple(robots), ball, (0, 0), "play", 1, ())

    def _is_free(self, place: tuple[float, float], taken: list[tuple[float, float]], bare: Scene) -> bool:
        radius = self._radius_m
        rim = np.array(place) + radius * np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
        apart = all(math.dist(place, other) > 2 * radius + _GAP_M for other in taken)
        return apart and bool(self._field.contains(rim).all()) and bare.clearance_m(*place) > radius + _GAP_M

    def _ball(
        self,
        own: Pose2,
        half_rad: float,
        reach_m: float,
        taken: list[tuple[float, float]],
        bare: Scene,
        rng: np.random.Generator,
    ) -> BallState | None:
        radius, apart_m = self._field.ball_radius_m, self._radius_m + 2 * self._field.ball_radius_m
        for _ in range(_TRIES):
            bearing, range_m = rng.uniform(-half_rad, half_rad), rng.uniform(3 * self._radius_m, reach_m)
            x, y = own.transform((range_m * math.cos(bearing), range_m * math.sin(bearing))).tolist()
            is_free = all(math.dist((x, y), other) > apart_m for other in taken)
            if is_free and self._field.contains((x, y)) and bare.clearance_m(x, y) > 2 * radius:
                return BallState(x, y)
        return None


def seen_robots(scene: Scene, camera: Camera, pose: Pose2) -> tuple[SeenRobot, ...]:
    """Return what of each robot is in view: the foot of its near side, in the picture and not behind anything."""
    foot, height_m = pose.compose(Pose2(*camera.offset_m, 0.0)), float(camera.viewpoint_m[2])
    found = []
    for n, robot in enumerate(scene.robots):
        others = replace(scene, robots=(*scene.robots[:n], *scene.robots[n + 1 :]))
        x, y = foot.inverse().transform((robot.x_m, robot.y_m)).tolist()
        away_m, radius_m = math.hypot(x, y), robot.radius_m
        if away_m <= radius_m:
            continue
        bearing = math.atan2(y, x)
        aside = (np.arange(_RAYS) + 0.5) / _RAYS * 2 - 1
        turn = np.arcsin(aside * radius_m / away_m)
        near_m = away_m * np.cos(turn) - np.sqrt(np.maximum(radius_m**2 - (away_m * np.sin(turn)) ** 2, 0.0))
        in_view = _is_in_picture(camera, _polar(bearing + turn, near_m) + np.array(camera.offset_m))
        # what stands before it hides its foot, unless one sees over it
        in_view &= ~_hidden(others, foot, bearing + turn, near_m, height_m)
        if not in_view.any():
            continue
        ahead_m, left_m = pose.inverse().transform((robot.x_m, robot.y_m)).tolist()
        error_m = pixel_on_floor_m(camera, bearing, max(away_m - radius_m, 1e-3))
        found.append(SeenRobot(ahead_m, left_m, radius_m, float(in_view.mean()), error_m))
    return tuple(found)


def _polar(bearing_rad: npt.ArrayLike, range_m: npt.ArrayLike) -> FloatArray:
    bearing, away = np.broadcast_arrays(np.asarray(bearing_rad, dtype=np.float64), range_m)
    return np.stack([away * np.cos(bearing), away * np.sin(bearing)], axis=-1)


def _hidden(
    scene: Scene, foot: Pose2, bearing_rad: FloatArray, range_m: FloatArray, height_m: float
) -> npt.NDArray[np.bool_]:
    """Return which places on the floor are hidden: before where the line of sight over a thing meets the floor."""
    hidden = np.zeros(len(bearing_rad), dtype=bool)
    bare = replace(scene, robots=())
    heights_m = {wall.height_m for wall in scene.walls()} | {post.height_m for post in scene.posts()}
    for top_m in sorted(heights_m):
        near_m = bare.free_range_m(foot, bearing_rad, above_m=top_m - 1e-6)
        hidden |= (near_m < range_m) & (near_m * _reach(top_m, height_m) > range_m)
    for robot in scene.robots:
        x, y = foot.inverse().transform((robot.x_m, robot.y_m)).tolist()
        along, aside = (
            x * np.cos(bearing_rad) + y * np.sin(bearing_rad),
            x * np.sin(bearing_rad) - y * np.cos(bearing_rad),
        )
        half = np.sqrt(np.maximum(robot.radius_m**2 - aside**2, 0.0))
        met = (np.abs(aside) < robot.radius_m) & (along > 0)
        hidden |= met & (along - half < range_m) & ((along + half) * _reach(robot.height_m, height_m) > range_m)
    return hidden


def _reach(top_m: float, eye_m: float) -> float:
    return math.inf if top_m >= eye_m else eye_m / (eye_m - top_m)


def _is_in_picture(camera: Camera, floor_m: FloatArray) -> npt.NDArray[np.bool_]:
    pixels = camera.floor_to_pixel(floor_m)
    width, height = camera.size_px
    with np.errstate(invalid="ignore"):
        shown = ((pixels >= 0) & (pixels <= (width - 1, height - 1))).all(axis=-1)
        if isinstance(camera, OmniCamera):
            radius = np.hypot(*(pixels - camera.center_px).T)
            shown &= (radius >= camera.usable_radius_px[0]) & (radius <= camera.usable_radius_px[1])
    return np.asarray(shown)


def pixel_on_floor_m(camera: Camera, bearing_rad: float, range_m: float) -> float:
    """Return how far apart two places on the floor are that a pixel's step along the bearing separates."""
    step = 1e-3 * range_m
    near, far = camera.floor_to_pixel(
        _polar(bearing_rad, np.array([range_m, range_m + step])) + np.array(camera.offset_m)
    )
    moved = float(np.hypot(*(far - near)))
    return step / moved if moved > 0 else math.inf
