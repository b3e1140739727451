"""Objects on a field and their light, as plain values for a renderer.

Positions are in the field frame, metres. Colours are the BGR values that a frame has under white light of level 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from field_models import COLOR_NAMES, Field, Goal
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2

Bgr = tuple[float, float, float]

GROUND_BGR: Bgr = (95, 105, 112)  # around the carpet
LAMP_DIRECTION_RAD = 0.9  # in the field frame; upright surfaces that face this direction are brighter

# colours of obstacles: the field's own, and some everyday ones
BOX_COLORS: dict[str, Bgr] = {
    "red": (40, 40, 200),
    "orange": COLOR_NAMES["orange"],
    "blue": COLOR_NAMES["blue"],
    "yellow": COLOR_NAMES["yellow"],
    "black": COLOR_NAMES["black"],
    "white": COLOR_NAMES["white"],
    "grey": (125, 125, 125),
    "wood": (105, 155, 190),
}


def any_box_color(rng: np.random.Generator) -> Bgr:
    """Draw one of `BOX_COLORS`."""
    return list(BOX_COLORS.values())[int(rng.integers(len(BOX_COLORS)))]


@dataclass(frozen=True, slots=True)
class Box:
    """An upright box: its centre, the direction of its width, its size and colour."""

    x_m: float
    y_m: float
    yaw_rad: float = 0.0
    width_m: float = 0.13
    depth_m: float = 0.13
    height_m: float = 0.13
    color_bgr: Bgr = BOX_COLORS["grey"]

    @property
    def corners(self) -> FloatArray:
        """(4, 2) float64: corners of its footprint, counter-clockwise, field frame, metres."""
        half = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]]) * (self.width_m / 2, self.depth_m / 2)
        return Pose2(self.x_m, self.y_m, self.yaw_rad).transform(half)

    def faces(self) -> Iterator[Wall]:
        """Yield its upright faces with their light; the box is to the left of each."""
        corners = self.corners
        for (x0, y0), (x1, y1) in zip(np.roll(corners, 1, axis=0).tolist(), corners.tolist(), strict=True):
            yield Wall(x0, y0, x1, y1, self.height_m, self.color_bgr, self.color_bgr).lit

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return the distance of a point from the footprint, 0 inside it."""
        local = np.abs(Pose2(self.x_m, self.y_m, self.yaw_rad).inverse().transform([x_m, y_m]))
        return float(np.hypot(*np.maximum(local - (self.width_m / 2, self.depth_m / 2), 0.0)))


@dataclass(frozen=True, slots=True)
class Robot:
    """Another robot: a dark upright cylinder with a coloured marker on top."""

    x_m: float
    y_m: float
    radius_m: float
    height_m: float = 0.14
    color_bgr: Bgr = (45, 42, 40)
    marker_bgr: Bgr = COLOR_NAMES["yellow"]


@dataclass(frozen=True, slots=True)
class Ball:
    """A ball on the floor; `patches_bgr`: colour of its dark patches, rotated by `turn_rad` about x, y, z."""

    x_m: float
    y_m: float
    radius_m: float
    color_bgr: Bgr = COLOR_NAMES["orange"]
    patches_bgr: Bgr | None = None
    turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Shadow:
    """A hard shadow: the strip low <= x cos(direction) + y sin(direction) <= high, and the light left in it.

    `factor_bgr` scales the light. What is left is bluer than the lamp's light: it comes from the sky or from walls.
    """

    direction_rad: float
    low_m: float = 0.0
    high_m: float = math.inf
    factor_bgr: Bgr = (0.56, 0.50, 0.46)


@dataclass(frozen=True, slots=True)
class Highlight:
    """A blurred reflection of a lamp: a Gaussian of white light with `amplitude` grey levels in the middle."""

    x_m: float
    y_m: float
    sigma_m: float
    amplitude: float


@dataclass(frozen=True, slots=True)
class Light:
    """Light in the scene."""

    #: Overall brightness; at 1 colours have their own values.
    level: float = 1.0
    #: Relative change of light from the field's centre over half its length, in `gradient_direction_rad`.
    gradient: float = 0.0
    gradient_direction_rad: float = 0.0
    #: Standard deviation of the carpet's brightness, relative.
    texture: float = 0.0
    #: Seed of the texture.
    texture_seed: int = 0
    #: A hard shadow.
    shadow: Shadow | None = None
    #: Reflections of lamps.
    highlights: tuple[Highlight, ...] = ()


@dataclass(frozen=True, slots=True)
class Room:
    """The background beyond the floor: a round room full of random clutter."""

    #: Seed of the room.
    seed: int = 0
    #: Distance from the floor's farthest corner to the clutter.
    distance_m: float = 0.6
    #: Number of people and pieces of furniture between the floor's end and the room's wall.
    bystanders: int = 0


@dataclass(frozen=True, slots=True)
class Wall:
    """An upright sheet over a segment: height, and the colours of its left and right side."""

    x0_m: float
    y0_m: float
    x1_m: float
    y1_m: float
    height_m: float
    left_bgr: Bgr
    right_bgr: Bgr

    @property
    def lit(self) -> Wall:
        """The same sheet with each side's colour in its light."""
        normal_rad = math.atan2(self.y1_m - self.y0_m, self.x1_m - self.x0_m) + math.pi / 2
        left_bgr, right_bgr = _lit(self.left_bgr, normal_rad), _lit(self.right_bgr, normal_rad + math.pi)
        return replace(self, left_bgr=left_bgr, right_bgr=right_bgr)


@dataclass(frozen=True, slots=True)
class Post:
    """An upright cylinder of the field, a goal post or a beacon; `bands_bgr` are of equal height, from the foot up."""

    x_m: float
    y_m: float
    radius_m: float
    height_m: float
    bands_bgr: tuple[Bgr, ...]


@dataclass(frozen=True, slots=True)
class Bar:
    """A goal's bar: a horizontal cylinder along y at `x_m`; `height_m` is that of its axis."""

    x_m: float
    half_length_m: float
    radius_m: float
    height_m: float
    color_bgr: Bgr


@dataclass(frozen=True, eq=False)
class Scene:
    """A field, the objects on it, its light and its surroundings."""

    field: Field
    #: Objects on the field.
    boxes: tuple[Box, ...] = ()
    robots: tuple[Robot, ...] = ()
    ball: Ball | None = None
    light: Light = Light()
    #: The background.
    room: Room = Room()
    #: Width of the carpet beyond the floor polygon, of a field without walls.
    carpet_margin_m: float = 0.0

    @property
    def carpet_polygon(self) -> FloatArray:
        """(K, 2) float64: corners of the carpet, counter-clockwise, metres."""
        polygon = self.field.floor_polygon
        if self.field.is_bounded or not self.carpet_margin_m:
            return polygon
        return np.asarray(polygon + np.sign(polygon) * self.carpet_margin_m)

    @property
    def room_radius_m(self) -> float:
        """Radius of the round wall behind everything, about the field's centre."""
        return float(np.hypot(*self.carpet_polygon.T).max()) + self.room.distance_m

    def fixed(self) -> Iterator[Wall | Post | Bar | Box]:
        """Yield all objects that do not move, walls with their light."""
        yield from (wall.lit for wall in self.walls())
        yield from self.posts()
        yield from self.bars()
        yield from self.boxes
        yield from self.bystanders()

    def walls(self) -> Iterator[Wall]:
        """Yield every wall, board and goal panel."""
        field = self.field
        wall_color = COLOR_NAMES[field.wall_color]
        if field.is_bounded:
            corners = field.floor_polygon
            for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
                goal = next((g for g in field.goals if _is_recess_wall(g, x0, y0, x1, y1)), None)
                inside = wall_color if goal is None else COLOR_NAMES[goal.color]
                height_m = field.wall_height_m if goal is None else goal.height_m
                yield Wall(float(x0), float(y0), float(x1), float(y1), height_m, inside, wall_color)
        for goal in field.goals:
            if goal.kind == "panels":
                color = COLOR_NAMES[goal.color]
                for x0, y0, x1, y1 in goal.panels:
                    yield Wall(float(x0), float(y0), float(x1), float(y1), goal.height_m, color, color)

    def posts(self) -> Iterator[Post]:
        """Yield every goal post and beacon."""
        for goal in self.field.goals:
            if goal.kind == "posts":
                for side in (-1, 1):
                    yield Post(
                        goal.line_x_m,
                        side * goal.width_m / 2,
                        goal.post_radius_m,
                        goal.height_m + goal.post_radius_m,
                        (COLOR_NAMES[goal.color],),
                    )
        for beacon in self.field.beacons:
            bands = tuple(COLOR_NAMES[color] for color in beacon.colors)
            yield Post(beacon.x_m, beacon.y_m, beacon.radius_m, beacon.height_m, bands)

    def bars(self) -> Iterator[Bar]:
        """Yield the bar of every goal of posts."""
        for goal in self.field.goals:
            if goal.kind == "posts":
                color = COLOR_NAMES[goal.color]
                yield Bar(goal.line_x_m, goal.width_m / 2, goal.post_radius_m, goal.height_m, color)

    def bystanders(self) -> Iterator[Box | Post]:
        """Yield the people (as posts) and furniture around the floor; `free_range_m` does not include them."""
        rng = np.random.default_rng([self.room.seed, 0xB0D1])
        half = np.abs(self.carpet_polygon).max(axis=0)
        for _ in range(self.room.bystanders):
            width_m = float(rng.uniform(0.15, 0.6))
            away = half + width_m * 0.75 + rng.uniform(0.03, 0.6)
            part, side = rng.uniform(-1, 1), rng.choice([-1, 1])
            x, y = away * ((part, side) if rng.random() < half[0] / half.sum() else (side, part))
            if rng.random() < 0.5:
                trousers, shirt, skin = rng.uniform(20, 90, 3), rng.uniform(20, 220, 3), (120.0, 150.0, 200.0)
                bands = (*(_bgr(trousers),) * 3, *(_bgr(shirt),) * 2, skin)
                yield Post(float(x), float(y), float(rng.uniform(0.08, 0.2)), float(rng.uniform(1.4, 1.9)), bands)
            else:
                height_m, color = float(rng.uniform(0.2, 1.5)), rng.uniform(30, 200) * rng.uniform(0.7, 1.3, 3)
                yield Box(float(x), float(y), float(rng.uniform(0, 0.3)), width_m, width_m, height_m, _bgr(color))

    def footprint_segments(self, above_m: float = 0.0) -> FloatArray:
        """Return (S, 4) float64: x0, y0, x1, y1 of the feet of walls, panels and box faces higher than `above_m`."""
        rows = [[w.x0_m, w.y0_m, w.x1_m, w.y1_m] for w in self.walls() if w.height_m > above_m]
        for box in self.boxes:
            if box.height_m <= above_m:
                continue
            corners = box.corners
            rows += np.hstack([corners, np.roll(corners, -1, axis=0)]).tolist()
        return np.array(rows, dtype=np.float64).reshape(-1, 4)

    def footprint_circles(self, above_m: float = 0.0) -> FloatArray:
        """Return (C, 3) float64: x, y, radius, metres, of the posts, beacons and robots higher than `above_m`."""
        round_things: list[Post | Robot] = [*self.posts(), *self.robots]
        rows = [[r.x_m, r.y_m, r.radius_m] for r in round_things if r.height_m > above_m]
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    def free_range_m(self, pose: Pose2, bearing_rad: npt.ArrayLike, above_m: float = 0.0) -> FloatArray:
        """Return the exact free ranges from a robot's centre, the truth for benchmarks.

        Parameters
        ----------
        bearing_rad : (N,) array_like
            Bearings in the robot frame.
        above_m : float
            Only objects higher than this are included.

        Returns
        -------
        (N,) float64
            Distance to the first wall, goal, beacon, box or robot, metres; inf if there is none. A ball and the end of
            a carpet are not included.
        """
        direction = pose.theta_rad + np.asarray(bearing_rad, dtype=np.float64)
        dx, dy = np.cos(direction)[:, None], np.sin(direction)[:, None]
        nearest = np.full(len(dx), np.inf)
        segments = self.footprint_segments(above_m) - (pose.x_m, pose.y_m) * 2
        if len(segments):
            ax, ay, bx, by = segments.T
            cross_a, cross_b = ax * dy - ay * dx, bx * dy - by * dx
            with np.errstate(divide="ignore", invalid="ignore"):
                range_m = (ax * by - ay * bx) / (cross_a - cross_b)
                hit = (cross_a * cross_b <= 0) & (range_m > 0)
            nearest = np.minimum(nearest, np.where(hit, range_m, np.inf).min(axis=1))
        circles = self.footprint_circles(above_m)
        if len(circles):
            cx, cy, radius = (circles - (pose.x_m, pose.y_m, 0.0)).T
            along, aside = cx * dx + cy * dy, cx * dy - cy * dx
            half_chord = np.sqrt(np.maximum(radius**2 - aside**2, 0.0))
            hit = (np.abs(aside) <= radius) & (along > half_chord)
            nearest = np.minimum(nearest, np.where(hit, along - half_chord, np.inf).min(axis=1))
        return nearest

    def clearance_m(self, x_m: float, y_m: float) -> float:
        """Return the distance, metres, of a floor point from the nearest foot of an object; inf if there is none."""
        nearest = math.inf
        segments = self.footprint_segments()
        if len(segments):
            start, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
            offset = np.array([x_m, y_m]) - start
            part = np.clip((offset * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
            nearest = float(np.linalg.norm(offset - part[:, None] * along, axis=1).min())
        for x, y, radius in self.footprint_circles():
            nearest = min(nearest, math.hypot(x_m - x, y_m - y) - radius)
        return nearest


def _lit(color: Bgr, normal_rad: float) -> Bgr:
    """Return a colour on an upright face, brighter the more the face is turned to the lamp."""
    factor = 0.78 + 0.14 * math.cos(normal_rad - LAMP_DIRECTION_RAD)
    return (color[0] * factor, color[1] * factor, color[2] * factor)


def _bgr(color: npt.NDArray[np.float64]) -> Bgr:
    blue, green, red = color.tolist()
    return (blue, green, red)


def _is_recess_wall(goal: Goal, x0: float, y0: float, x1: float, y1: float) -> bool:
    line, nearer, farther = abs(goal.line_x_m), *sorted((goal.side * x0, goal.side * x1))
    in_mouth = max(abs(y0), abs(y1)) <= goal.width_m / 2 + 1e-9
    return goal.kind == "recess" and in_mouth and nearer >= line - 1e-9 and farther > line + 1e-9
