"""The model of the pitch that all parts of the project share: lines, arcs, goals, beacons and the floor's boundary.

Field frame: origin at the centre, x towards the opponent's goal, y left, metres. Lengths are between line centres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoundaryKind = Literal["walls", "boards", "carpet"]
GoalKind = Literal["recess", "panels", "posts"]
MarkKind = Literal["cross", "dot"]

# Colour names of the rule books -> BGR of a frame under white light. Renderers and first guesses use them; classifiers
# learn the real colours.
COLOR_NAMES: dict[str, tuple[int, int, int]] = {
    "white": (230, 230, 230),
    "black": (35, 35, 35),
    "green": (50, 130, 45),
    "yellow": (35, 205, 225),
    "blue": (190, 80, 35),
    "cyan": (215, 185, 35),
    "orange": (30, 110, 235),
    "pink": (170, 90, 225),
}


def _frozen(rows: list[list[float]], columns: int) -> FloatArray:
    array = np.array(rows, dtype=np.float64).reshape(-1, columns)
    array.flags.writeable = False
    return array


@dataclass(frozen=True, slots=True)
class Net:
    """A goal's net with square meshes: upright at both sides and at the back, with a horizontal roof.

    Parameters
    ----------
    height_m : float
        Height of the roof above the floor.
    mesh_m, cord_m : float
        Distance between cords, and a cord's thickness.
    color : str
        Name of its colour.
    """

    height_m: float
    mesh_m: float
    cord_m: float
    color: str


@dataclass(frozen=True, slots=True)
class Goal:
    """One goal.

    Parameters
    ----------
    side : int
        +1 for the goal at +x, -1 for the one at -x.
    kind : {"recess", "panels", "posts"}
        A recess in the walls around the field, a box of upright panels on the carpet, or posts with a bar.
    color : str
        Name of its colour.
    line_x_m : float
        x of the goal line's centre (recess, panels: the mouth; posts: the posts' axes).
    width_m : float
        Distance between the inner walls (recess, panels) or between the posts' axes (posts).
    depth_m : float
        Distance from the mouth to the back wall.
    height_m : float
        Height of the panels, or of the bar's axis.
    post_radius_m : float
        Radius of posts and bar; 0 if there are none.
    net : Net or None
        The net from the mouth to `back_x_m`.
    """

    side: int
    kind: GoalKind
    color: str
    line_x_m: float
    width_m: float
    depth_m: float
    height_m: float
    post_radius_m: float
    net: Net | None = None

    @property
    def back_x_m(self) -> float:
        """Field x of the back wall."""
        return self.line_x_m + self.side * self.depth_m

    @property
    def panels(self) -> FloatArray:
        """(3, 4) float64: feet of side wall, back wall and other side wall as x0, y0, x1, y1, field frame, metres."""
        half = self.width_m / 2
        return _frozen(
            [
                [self.line_x_m, -half, self.back_x_m, -half],
                [self.back_x_m, -half, self.back_x_m, half],
                [self.back_x_m, half, self.line_x_m, half],
            ],
            4,
        )


@dataclass(frozen=True, slots=True)
class Mark:
    """A painted spot, such as a penalty mark: a dot, or a cross of two strokes as wide as lines, along x and y.

    Parameters
    ----------
    x_m, y_m : float
        Its middle, field frame, metres.
    kind : {"cross", "dot"}
        Its shape.
    size_m : float
        Length of the cross's strokes, or the dot's diameter.
    """

    x_m: float
    y_m: float
    kind: MarkKind
    size_m: float


@dataclass(frozen=True, slots=True)
class Beacon:
    """An upright landmark cylinder beside the field; `colors` from its foot upwards, in equal bands."""

    x_m: float
    y_m: float
    radius_m: float
    height_m: float
    colors: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Field:
    """A pitch, derived from the few numbers of its file (`field_models.load_field`).

    Parameters
    ----------
    name, source : str
        Its name, and the source of its numbers, such as a rule book.
    length_m, width_m : float
        Distance between the centres of the goal lines and of the touch lines.
    line_width_m : float
        Width of the painted lines.
    lines : (N, 4) float64
        Straight lines' centre lines as x0, y0, x1, y1, metres.
    arcs : (M, 5) float64
        Curved lines as centre x, y, radius (metres), start and signed sweep (radians).
    goals : tuple of Goal
        The goal at +x first; half a field has no other.
    beacons : tuple of Beacon
        Upright landmarks, possibly none.
    boundary : {"walls", "boards", "carpet"}
        Boundary of the floor; a "carpet" extends beyond the lines by an unknown distance.
    floor_polygon : (K, 2) float64
        Corners of the floor counter-clockwise, metres; for "carpet" the part that certainly exists.
    wall_height_m : float
        Height of walls or boards, 0 for "carpet".
    wall_color, ball_color : str
        Names of colours.
    robot_radius_m, ball_radius_m : float
        Radii of the league's robots and ball.
    line_color : str
        Name of a colour.
    ball_patches : str
        Name of the colour of the ball's dark patches; "": it has none.
    is_half : bool
        Whether only the half x >= 0 exists, as in a small laboratory, with its lines, goal and beacons. The floor ends
        as far behind the centre line as behind the other lines.
    marks : tuple of Mark
        Painted spots, that at +x first; `lines` and `arcs` do not contain them.
    """

    name: str
    source: str
    length_m: float
    width_m: float
    line_width_m: float
    lines: FloatArray
    arcs: FloatArray
    goals: tuple[Goal, ...]
    beacons: tuple[Beacon, ...]
    boundary: BoundaryKind
    floor_polygon: FloatArray
    wall_height_m: float
    wall_color: str
    ball_color: str
    robot_radius_m: float
    ball_radius_m: float
    line_color: str = field(default="white")
    ball_patches: str = ""
    is_half: bool = False
    marks: tuple[Mark, ...] = ()

    @property
    def is_bounded(self) -> bool:
        """Whether walls or boards end the floor, so that its outline determines the pose."""
        return self.boundary != "carpet"

    @property
    def has_lines(self) -> bool:
        """Whether there are lines or arcs on the floor."""
        return bool(len(self.lines) + len(self.arcs))

    @property
    def painted_lines(self) -> FloatArray:
        """(N, 4) float64: `lines`, and the centre lines of crosses' strokes, half a line width short of their ends."""
        rows = []
        for mark in self.marks:
            if mark.kind == "cross":
                half = (mark.size_m - self.line_width_m) / 2
                rows.append([mark.x_m - half, mark.y_m, mark.x_m + half, mark.y_m])
                rows.append([mark.x_m, mark.y_m - half, mark.x_m, mark.y_m + half])
        return _frozen([*self.lines.tolist(), *rows], 4)

    @property
    def painted_arcs(self) -> FloatArray:
        """(M, 5) float64: `arcs`, and each dot as concentric circles that are as wide as a line."""
        rows = []
        for mark in self.marks:
            if mark.kind != "dot":
                continue
            half = self.line_width_m / 2
            count = max(1, math.ceil((mark.size_m / 2 - half) / self.line_width_m - 1e-9) + 1)
            radii = np.linspace(mark.size_m / 2 - half, min(half, mark.size_m / 2 - half), count)
            rows += [[mark.x_m, mark.y_m, radius, 0.0, math.tau] for radius in radii.tolist()]
        return _frozen([*self.arcs.tolist(), *rows], 5)

    @property
    def halves_differ(self) -> bool:
        """Whether a pose can be distinguished from its half turn: the halves differ, or one of them is missing."""
        return self.is_half or self.shows_half

    @cached_property
    def shows_half(self) -> bool:
        """Whether both halves exist and differ.

        They differ if a half turn about the centre does not map the field onto itself: a goal or beacon changes its
        colour, or a goal, beacon, line or wall gets to a place where there was none.
        """
        return not self.is_half and self._features(1.0) != self._features(-1.0)

    def _features(self, sign: float) -> set[tuple[object, ...]]:
        """Return all visible features, as they are (`sign` 1) or after a half turn (-1), rounded to a micrometre."""

        def at(*lengths_m: float) -> tuple[float, ...]:
            # + 0.0 turns -0.0 into 0.0
            return tuple(round(sign * length, 6) + 0.0 for length in lengths_m)

        features: set[tuple[object, ...]] = set()
        for kind, lines in (("line", self.lines), ("wall", self.walls)):
            features |= {(kind, frozenset((at(x0, y0), at(x1, y1)))) for x0, y0, x1, y1 in lines.tolist()}
        for x, y, radius, start, sweep in self.arcs.tolist():
            middle = start + sweep / 2
            top = at(x + radius * math.cos(middle), y + radius * math.sin(middle))
            is_circle = abs(sweep) >= math.tau - 1e-9
            features.add(("arc", at(x, y), round(radius, 6), round(abs(sweep), 6), () if is_circle else top))
        for g in self.goals:
            sizes = (g.width_m, g.depth_m, g.height_m, g.post_radius_m)
            features.add(("goal", g.kind, at(g.line_x_m), g.color, sizes, g.net))
        for b in self.beacons:
            features.add(("beacon", at(b.x_m, b.y_m), b.radius_m, b.height_m, b.colors))
        return features

    @cached_property
    def walls(self) -> FloatArray:
        """(W, 4) float64: feet of the walls that bound the floor, x0, y0, x1, y1, metres.

        These are the floor polygon's edges, counter-clockwise, and the panels of goals that stand inside it. On a
        "carpet" the polygon's edges have no walls (see `is_bounded`).
        """
        edges = np.hstack([self.floor_polygon, np.roll(self.floor_polygon, -1, axis=0)])
        panels = [goal.panels for goal in self.goals if goal.kind == "panels"]
        return _frozen(np.vstack([edges, *panels]).tolist(), 4)

    def line_points(self, spacing_m: float) -> FloatArray:
        """Return points (N, 2) float64, metres, along the centres of all lines and arcs, about `spacing_m` apart."""
        pieces = []
        for x0, y0, x1, y1 in self.lines:
            count = max(2, math.ceil(math.hypot(x1 - x0, y1 - y0) / spacing_m) + 1)
            along = np.linspace(0.0, 1.0, count)[:, None]
            pieces.append(np.array([x0, y0]) * (1 - along) + np.array([x1, y1]) * along)
        for x, y, radius, start, sweep in self.arcs:
            angles = start + np.linspace(0.0, sweep, max(2, math.ceil(abs(sweep) * radius / spacing_m) + 1))
            pieces.append(np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1))
        return np.vstack(pieces) if pieces else np.empty((0, 2))

    def contains(self, points_m: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return which points (..., 2), metres, lie on the floor (inside `floor_polygon`), by the even-odd rule."""
        points = np.asarray(points_m, dtype=np.float64)
        x, y = points[..., 0], points[..., 1]
        inside = np.zeros(x.shape, dtype=bool)
        for (x0, y0), (x1, y1) in zip(self.floor_polygon, np.roll(self.floor_polygon, -1, axis=0), strict=True):
            if y0 != y1:
                inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
        return inside

    def is_on_floor(self, x_m: float, y_m: float) -> bool:
        """Return whether one point lies on the floor: a faster `contains` for single points."""
        inside = False
        for low, high, x0, y0, x1, y1 in self._sides:
            if low <= y_m < high and x_m < x0 + (y_m - y0) / (y1 - y0) * (x1 - x0):
                inside = not inside
        return inside

    @cached_property
    def _sides(self) -> list[tuple[float, float, float, float, float, float]]:
        """Smallest and greatest y, and both ends, of the floor's sides, without those that are parallel to x."""
        ends = np.hstack([self.floor_polygon, np.roll(self.floor_polygon, -1, axis=0)]).tolist()
        return [(min(y0, y1), max(y0, y1), x0, y0, x1, y1) for x0, y0, x1, y1 in ends if y0 != y1]
