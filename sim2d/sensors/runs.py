"""Simulated drives among objects of all heights, under glare and shadows, seen by camera and range sensor, with truth.

Maps of the free floor are learnt from them and evaluated on them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from field_models import COLOR_NAMES, Field
from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.range_profile import RangeProfile, floor_profile
from robocup_vision.memory import Memory
from robocup_vision.vision import Vision
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.scene import Ball, Box, Highlight, Light, Robot, Room, Scene, Shadow, any_box_color
from sim2d.robot_link import Command, Point, RobotLimits
from sim2d.sensors.match_camera import MATCH_SENSOR
from sim2d.sensors.range_sensor import RangeSensor
from sim2d.world.world import World

# the camera and the range sensor deliver every third control period
PERIODS_A_FRAME = 3
# bearings and rings of the floor's profile
DIRECTIONS, RINGS = 120, 40
FALLEN_HEIGHT_M = 0.06

_SPEED_MPS, _ARRIVED_M = 0.4, 0.04
_MOVER_SPEED_MPS = (0.3, 0.6)
_ROOM_M = 0.04
_MIN_LEG_M = 0.3
_TRIES = 400
# height of lamps, range of their distances, and size and strength of their reflections, which the carpet blurs
_LAMP_HEIGHT_M, _LAMP_AWAY_M = 2.5, (3.0, 12.0)
_LAMP_SIGMA_M, _LAMP_AMPLITUDE = (0.04, 0.10), (50.0, 110.0)


@dataclass(frozen=True, slots=True)
class RunKind:
    """The disturbances and objects of a run."""

    #: Number of ceiling lamps, whose reflections on the floor move with the viewpoint.
    lamps: int = 0
    #: Number of bright patches that do not move.
    sun_patches: int = 0
    #: A hard shadow over part of the floor.
    shadow: bool = False
    #: Number of robots that drive to and fro.
    movers: int = 0
    #: Numbers of standing objects: boxes, low boxes (fallen robots), upright robots.
    boxes: int = 2
    fallen: int = 2
    robots: int = 1


KINDS: dict[str, RunKind] = {
    "plain": RunKind(),
    "glare": RunKind(lamps=3, sun_patches=1),
    "shadow": RunKind(shadow=True),
    "glare_shadow": RunKind(lamps=2, sun_patches=1, shadow=True),
    "movers": RunKind(movers=2, boxes=1, fallen=1, robots=0),
}


@dataclass(frozen=True, eq=False)
class SensorFrame:
    """What both sensors measure at one moment, and the truth."""

    #: Time of the frame.
    t_s: float
    #: The robot's pose estimated from camera and odometry, field frame; None while it is lost.
    estimated: Pose2 | None
    #: Range profiles of the camera and of the range sensor.
    floor: RangeProfile
    scan: RangeProfile
    #: Truth: the robot's pose.
    pose: Pose2
    #: Truth: the standing objects, without movers, and the light as seen from this pose.
    scene: Scene
    #: (M, 3) float64: truth: x, y and radius of the movers, field frame, metres.
    movers_m: FloatArray


def map_vision(field: Field, camera: OmniCamera) -> Vision:
    """Make a `Vision` with a memory, whose free space has a resolution that suits a map."""
    return Vision(field, camera, directions=DIRECTIONS, rings=RINGS, memory=Memory(field))


def sensor_run(
    field: Field,
    camera: OmniCamera,
    kind: RunKind,
    rng: np.random.Generator,
    *,
    frames: int,
    scanner: RangeSensor | None = None,
    vision: Vision | None = None,
) -> Iterator[SensorFrame]:
    """Drive through a random scene, and yield the sensors' measurements ten times per second.

    Parameters
    ----------
    camera : OmniCamera
        With a known viewpoint height.
    vision : Vision, optional
        One made by `map_vision`, to be reused; its memory is cleared first.

    Raises
    ------
    ArgumentError
        If there is no room on the field for the objects or the drive.
    """
    scanner = scanner or RangeSensor()
    vision = vision or map_vision(field, camera)
    vision.forget()
    limits = RobotLimits(radius_m=field.robot_radius_m)
    layout = _Layout(field, limits.radius_m, rng)
    scene = layout.scene(kind)
    lanes = [layout.lane() for _ in range(kind.movers)]
    start = layout.place()
    lamps = [_lamp(rng) for _ in range(kind.lamps)]
    renderer = MirrorRenderer(camera, 1)
    starts = [Pose2(*start, rng.uniform(-math.pi, math.pi)), *(Pose2(*lane[0], 0.0) for lane in lanes)]
    obstacles = (*scene.boxes, *(Box(r.x_m, r.y_m, 0.0, 2 * r.radius_m, 2 * r.radius_m) for r in scene.robots))
    world = World.course(field, obstacles, starts, limits, rng)
    speeds = rng.uniform(*_MOVER_SPEED_MPS, len(lanes)).tolist()
    target, turn_rps, ahead = layout.leg(start), 0.0, [1] * len(lanes)
    for period in range(frames * PERIODS_A_FRAME):
        state = world.state
        if period:
            vision.predict(world.odometry(0), state.t_s)
        pose = state.robots[0].pose
        if period % PERIODS_A_FRAME == 0:
            movers = state.robots[1:]
            lit = _with_reflections(scene, lamps, camera, pose)
            others = tuple(Robot(m.pose.x_m, m.pose.y_m, limits.radius_m, limits.height_m) for m in movers)
            seen = dataclasses.replace(lit, robots=(*lit.robots, *others))
            frame = MATCH_SENSOR.expose(renderer.render(seen, pose), rng)
            # at the start the pose is known
            view = vision.look(frame, state.t_s, prior=None if period else pose)
            assert view.belief is not None
            known = view.belief.pose
            yield SensorFrame(
                state.t_s,
                known.pose if known else None,
                floor_profile(view),
                scanner.scan(seen, pose, rng),
                pose,
                lit,
                np.array([[r.x_m, r.y_m, r.radius_m] for r in others]).reshape(-1, 3),
            )
        if math.dist((pose.x_m, pose.y_m), target) < _ARRIVED_M:
            target, turn_rps = layout.leg((pose.x_m, pose.y_m)), float(rng.uniform(-0.8, 0.8))
        commands = {0: _towards(pose, target, _SPEED_MPS, turn_rps)}
        for k, lane in enumerate(lanes):
            mover = state.robots[k + 1].pose
            if math.dist((mover.x_m, mover.y_m), lane[ahead[k]]) < _ARRIVED_M:
                ahead[k] = 1 - ahead[k]
            commands[k + 1] = _towards(mover, lane[ahead[k]], speeds[k], 0.0)
        world.step(commands)


class _Layout:
    """Draws places of objects, and free ways between them."""

    def __init__(self, field: Field, radius_m: float, rng: np.random.Generator) -> None:
        self.field, self.radius_m, self._rng = field, radius_m, rng
        self._scene = Scene(field)
        self._lanes: list[tuple[Point, Point]] = []
        self._low, self._high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)

    def scene(self, kind: RunKind) -> Scene:
        rng, field = self._rng, self.field
        for k in range(kind.boxes + kind.fallen + kind.robots):
            if k < kind.boxes + kind.fallen:
                size = rng.uniform(0.10, 0.18, 2) if k < kind.boxes else np.array([0.18, 0.12])
                x, y = self._spot(float(np.hypot(*size)) / 2)
                color = any_box_color(rng) if k < kind.boxes else (45, 42, 40)
                height_m = 0.13 if k < kind.boxes else FALLEN_HEIGHT_M
                yaw, width_m, depth_m = float(rng.uniform(0, math.pi)), float(size[0]), float(size[1])
                box = Box(x, y, yaw, width_m, depth_m, height_m, color)
                self._scene = dataclasses.replace(self._scene, boxes=(*self._scene.boxes, box))
            else:
                robot = Robot(*self._spot(self.radius_m), self.radius_m)
                self._scene = dataclasses.replace(self._scene, robots=(*self._scene.robots, robot))
        ball = Ball(*self._spot(field.ball_radius_m), field.ball_radius_m, COLOR_NAMES[field.ball_color])
        size_m = float((self._high - self._low).min())
        shadow = None
        if kind.shadow:
            low = float(rng.uniform(-0.25, 0.1)) * size_m
            shadow = Shadow(float(rng.uniform(-math.pi, math.pi)), low, low + float(rng.uniform(0.2, 0.5)) * size_m)
        patches = []
        for _ in range(kind.sun_patches):
            x, y = rng.uniform(0.8 * self._low, 0.8 * self._high).tolist()
            patches.append(Highlight(x, y, float(rng.uniform(0.04, 0.10)), float(rng.uniform(*_LAMP_AMPLITUDE))))
        light = Light(0.95, 0.2, float(rng.uniform(-math.pi, math.pi)), 0.03, int(rng.integers(2**31)), shadow)
        light = dataclasses.replace(light, highlights=tuple(patches))
        room = Room(int(rng.integers(2**31)), float(rng.uniform(0.8, 2.0)))
        self._scene = dataclasses.replace(self._scene, ball=ball, light=light, room=room)
        return self._scene

    def place(self) -> Point:
        """Draw a place for a robot from which it can drive straight to another one."""
        for _ in range(_TRIES):
            spot = self._spot(self.radius_m)
            if self.leg(spot) != spot:
                return spot
        raise ArgumentError(f"field '{self.field.name}' has no room to drive")

    def lane(self) -> tuple[Point, Point]:
        """Draw both ends of a straight way on which a robot can drive to and fro."""
        for _ in range(_TRIES):
            start = self._spot(self.radius_m)
            end = self.leg(start)
            if end != start:
                self._lanes.append((start, end))
                return start, end
        raise ArgumentError(f"field '{self.field.name}' has no room for a robot that drives to and fro")

    def leg(self, start: Point) -> Point:
        """Draw a place to which the straight way is free; `start` itself if there is none."""
        for _ in range(_TRIES // 4):
            x, y = self._rng.uniform(self._low, self._high).tolist()
            length = math.dist(start, (x, y))
            if length < _MIN_LEG_M:
                continue
            fractions = np.linspace(0.0, 1.0, 2 + int(length / 0.06))[1:]
            way = [(start[0] + s * (x - start[0]), start[1] + s * (y - start[1])) for s in fractions.tolist()]
            if all(self._clearance_m(point) > self.radius_m + _ROOM_M for point in reversed(way)):
                return x, y
        return start

    def _spot(self, reach_m: float) -> Point:
        for _ in range(_TRIES):
            x, y = self._rng.uniform(self._low + reach_m, self._high - reach_m).tolist()
            if self._clearance_m((x, y)) > reach_m + _ROOM_M:
                return x, y
        raise ArgumentError(f"field '{self.field.name}' has no room for all that shall stand on it")

    def _clearance_m(self, point: Point) -> float:
        if not self.field.contains(np.array([point])).all():
            return 0.0
        clearance = self._scene.clearance_m(*point)
        ball = self._scene.ball
        if ball is not None:
            clearance = min(clearance, math.dist(point, (ball.x_m, ball.y_m)) - ball.radius_m)
        for (ax, ay), (bx, by) in self._lanes:
            dx, dy = bx - ax, by - ay
            fraction = ((point[0] - ax) * dx + (point[1] - ay) * dy) / (dx * dx + dy * dy)
            fraction = min(max(fraction, 0.0), 1.0)
            clearance = min(clearance, math.dist(point, (ax + fraction * dx, ay + fraction * dy)) - self.radius_m)
        return clearance


def _towards(pose: Pose2, target: Point, speed_mps: float, turn_rps: float) -> Command:
    x, y = pose.inverse().transform(target).tolist()
    away = math.hypot(x, y)
    speed = min(speed_mps, 2.0 * away) / max(away, 1e-9)
    return Command(speed * x, speed * y, turn_rps)


def _lamp(rng: np.random.Generator) -> tuple[float, float, float, float]:
    """Draw a lamp: its x and y, field frame, and standard deviation and amplitude of its reflection."""
    away, direction = rng.uniform(*_LAMP_AWAY_M), rng.uniform(-math.pi, math.pi)
    return (
        away * math.cos(direction),
        away * math.sin(direction),
        float(rng.uniform(*_LAMP_SIGMA_M)),
        float(rng.uniform(*_LAMP_AMPLITUDE)),
    )


def _with_reflections(
    scene: Scene, lamps: list[tuple[float, float, float, float]], camera: OmniCamera, pose: Pose2
) -> Scene:
    """Return the scene with each lamp's reflection where the floor would mirror a ray from the viewpoint to it."""
    if not lamps or camera.height_m is None:
        return scene
    fraction = camera.height_m / (camera.height_m + _LAMP_HEIGHT_M)
    mirrored = tuple(
        Highlight(pose.x_m + fraction * (x - pose.x_m), pose.y_m + fraction * (y - pose.y_m), sigma, amplitude)
        for x, y, sigma, amplitude in lamps
    )
    return dataclasses.replace(
        scene, light=dataclasses.replace(scene.light, highlights=(*scene.light.highlights, *mirrored))
    )
