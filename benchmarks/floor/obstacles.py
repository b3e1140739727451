"""Obstacles among robots: one for each robot in view, none for walls, goals, lines, the carpet's end or the ball.

On every built-in field none to all of the robots of a match stand anywhere, and a ball lies in half of the pictures; a
forward, a fisheye and a mirror camera of the robots' size look at them before a hall, or a room with bystanders.
"alone": each picture by itself, whether it shows a pose or not; "near a pose": with a prior 5 cm and 3 degrees off. A
robot must be listed if the foot of at least half of it is in view, and a pixel to either side of its foot leaves it
within its own size; others may be. "count right": as many listed as must be, those left out that may be. "error":
distance of what is listed from the middle of the robot's near side, median. "width": of what is whole in view, less the
robot's, without sign, median. "floor's end at feet": robots within 6 m in whose direction the free floor ends between
0.8 and 1.1 of their range. False ones are named by what is there: a robot listed "again", the ball, a goal, a beacon,
the end of the floor, or nothing but floor and lines.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Pool, Table, percent, program, verdict
from field_models import Field, field_names, load_field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera import FisheyeCamera, OmniCamera, PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.perception.obstacles import Obstacle
from robocup_vision.view import View
from robocup_vision.vision import Vision
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


# an obstacle this near the ball, or a goal or beacon, is by it
_NEAR_M = 0.10
# a disc's near side, averaged over the bearings that meet it, lies this fraction of its radius before its centre
_NEAR_SIDE = math.pi / 4
_NEARER_M = 6.0

CAUSES = ("again", "ball", "goal", "beacon", "floor's end", "floor")


@dataclass(frozen=True, slots=True)
class Listed:
    """How many robots are certain to be in view, and how many obstacles are those, others, or nothing."""

    #: robots that must be listed, those of them that are, and listed ones that need not be
    certain: int
    found: int
    doubtful: int
    false: tuple[str, ...]  #: what each further obstacle is
    errors_m: tuple[float, ...]  #: distance of each found robot's obstacle from the middle of its near side
    #: width of each found robot's obstacle less the robot's, of those that are whole in view
    widths_m: tuple[float, ...]
    #: where the free floor ends in the direction of each robot that is certain and nearer than 6 m, of its range
    floor_ends: tuple[float, ...]

    @property
    def count_error(self) -> int:
        """Number listed less number certain, without the doubtful ones."""
        return self.found + len(self.false) - self.certain


def judge(view: View, frame: StandingFrame, camera: Camera) -> Listed:
    """Match obstacles to robots, the nearest pairs first."""
    obstacles = view.obstacles
    pairs = []
    for i, one in enumerate(obstacles):
        for j, robot in enumerate(frame.robots):
            along, across = _off(one, robot, camera)
            if across < 1.2 * robot.radius_m and along < 1.5 * robot.radius_m + 2 * robot.error_m:
                pairs.append((math.hypot(along, across), i, j))
    of_robot: dict[int, int] = {}
    errors, widths = [], []
    for error, i, j in sorted(pairs):
        if i not in of_robot and j not in of_robot.values():
            of_robot[i] = j
            if frame.robots[j].is_certain:
                errors.append(error)
                if frame.robots[j].in_view == 1.0:
                    widths.append(obstacles[i].width_m - 2 * frame.robots[j].radius_m)
    near = {i for _, i, _ in pairs}
    false = tuple(
        "again" if i in near else _cause(one, frame, camera) for i, one in enumerate(obstacles) if i not in of_robot
    )
    return Listed(
        sum(robot.is_certain for robot in frame.robots),
        len(errors),
        len(of_robot) - len(errors),
        false,
        tuple(errors),
        tuple(widths),
        tuple(_floor_end(view.free_space, robot) for robot in frame.robots if _is_near(robot)),
    )


def _is_near(robot: SeenRobot) -> bool:
    return robot.is_certain and math.hypot(robot.x_m, robot.y_m) - robot.radius_m <= _NEARER_M


def _floor_end(free_space: FreeSpace, robot: SeenRobot) -> float:
    away_m, bearing = math.hypot(robot.x_m, robot.y_m), math.atan2(robot.y_m, robot.x_m)
    off = np.abs(np.remainder(free_space.bearing_rad - bearing + math.pi, math.tau) - math.pi)
    # directions before the middle half of it: the nearest of them, at least
    before = off <= max(math.asin(min(0.5 * robot.radius_m / away_m, 1.0)), float(off.min()))
    return float(np.nanmin(free_space.range_m[before])) / (away_m - robot.radius_m)


def _off(one: Obstacle, robot: SeenRobot, camera: Camera) -> tuple[float, float]:
    """Distance of an obstacle from the middle of a robot's near side, along and across the camera's line of sight."""
    center = np.array([robot.x_m, robot.y_m]) - camera.offset_m
    ahead = center / np.hypot(*center)
    off = np.array([one.x_m, one.y_m]) - camera.offset_m - (center - _NEAR_SIDE * robot.radius_m * ahead)
    return abs(float(off @ ahead)), abs(float(off[0] * ahead[1] - off[1] * ahead[0]))


def _cause(one: Obstacle, frame: StandingFrame, camera: Camera) -> str:
    """Return what stands where an obstacle is listed that is no robot."""
    field, ball = frame.scene.field, frame.scene.ball
    from_camera = np.array([one.x_m, one.y_m]) - camera.offset_m
    range_m = max(float(np.hypot(*from_camera)), 1e-3)
    error_m = pixel_on_floor_m(camera, math.atan2(from_camera[1], from_camera[0]), range_m)
    near_m = _NEAR_M + min(2 * error_m, range_m)
    place = frame.pose.transform((one.x_m, one.y_m))
    if ball is not None and math.dist(place, (ball.x_m, ball.y_m)) < ball.radius_m + near_m:
        return "ball"
    for goal in field.goals:
        deep = goal.side * place[0] > abs(goal.line_x_m) - near_m
        if deep and abs(place[1]) < goal.width_m / 2 + near_m:
            return "goal"
    if any(math.dist(place, (b.x_m, b.y_m)) < b.radius_m + near_m for b in field.beacons):
        return "beacon"
    behind = frame.pose.transform(np.array([one.x_m, one.y_m]) + from_camera / range_m * near_m)
    return "floor" if field.contains(behind) else "floor's end"


START_STD = np.array([0.05, 0.05, math.radians(3.0)])
MIN_WITHIN_ONE = 0.90
FLOOR_ENDS = 0.8, 1.1
CAMERA_KINDS: dict[str, Callable[[Field], Camera]] = {
    "forward": forward_camera,
    "mirror": mirror_camera,
    "fisheye": fisheye_camera,
}
LOOKS = ("alone", "near a pose")


@dataclass(frozen=True, slots=True)
class Piece:
    """Pictures of one field by one kind of camera."""

    camera: str
    field: str
    seed: int
    count: int


def look_at(piece: Piece) -> dict[str, list[Listed]]:
    """Return what is listed in each picture, for each way to look."""
    field = load_field(piece.field)
    camera = CAMERA_KINDS[piece.camera](field)
    vision = Vision(field, camera)
    rng = np.random.default_rng([piece.seed, 0x5EE])
    listed: dict[str, list[Listed]] = {look: [] for look in LOOKS}
    for one in standing_frames(field, camera, piece.seed, piece.count):
        off = START_STD * rng.standard_normal(3)
        prior = PoseEstimate(Pose2(*(one.pose.array + off).tolist()), np.diag(START_STD**2), 1.0, 0.0)
        for look in LOOKS:
            vision.forget()
            view = vision.look(one.frame, prior=prior if look == LOOKS[1] else None)
            listed[look].append(judge(view, one, camera))
    return listed


def report(pieces: list[Piece], pool: Pool) -> None:
    """Print a table for each way to look."""
    results = list(pool.map(look_at, pieces))
    for look in LOOKS:
        table = Table(
            "camera and field          | count right: rate | within one: rate | found: rate | false: count | "
            f"error m: error 0.01 | width m: error 0.01 | floor's end at feet: rate | {' | '.join(CAUSES)} | "
            "target | verdict",
            f"Obstacles, {look}",
            name=look,
        )
        for camera in CAMERA_KINDS:
            parts = [
                (piece.field, result[look])
                for piece, result in zip(pieces, results, strict=True)
                if piece.camera == camera
            ]
            for name, listed in parts:
                _row(table, f"{camera}, {name}", listed, None)
            together = [one for _, listed in parts for one in listed]
            _row(table, f"{camera}, all", together, MIN_WITHIN_ONE)


def _row(table: Table, name: str, listed: Sequence[Listed], least: float | None) -> None:
    off = np.array([one.count_error for one in listed])
    within_one = float(np.mean(np.abs(off) <= 1))
    causes = Counter(cause for one in listed for cause in one.false)
    errors = [error for one in listed for error in one.errors_m]
    widths = [abs(off_m) for one in listed for off_m in one.widths_m]
    ends = np.array([end for one in listed for end in one.floor_ends])
    at_feet = (ends >= FLOOR_ENDS[0]) & (ends <= FLOOR_ENDS[1])
    is_met = least is None or within_one >= least
    table.row(
        name,
        percent(float(np.mean(off == 0))),
        percent(within_one),
        f"{sum(one.found for one in listed)}/{sum(one.certain for one in listed)}",
        sum(causes.values()),
        f"{np.median(errors):.3f}" if errors else None,
        f"{np.median(widths):.3f}" if widths else None,
        percent(float(at_feet.mean())) if len(ends) else None,
        *(causes[cause] for cause in CAUSES),
        None if least is None else percent(least),
        None if least is None else verdict(is_met),
        samples=len(listed),
    )


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    count = 1 if arguments.quick else 100 if arguments.full else 20
    kinds = [(camera, name) for camera in CAMERA_KINDS for name in field_names()]
    # the same seed draws as many robots on every field
    pieces = [Piece(*kind, arguments.seed + n, count) for n, kind in enumerate(kinds)]
    report(pieces, pool)
