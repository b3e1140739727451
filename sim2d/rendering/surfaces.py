"""Which surface each ray meets first: horizontal distances of walls, boxes, cylinders, bars and balls, nearest kept."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.geometry import Pose2
from sim2d.rendering.ball_patches import is_patch
from sim2d.rendering.rays import RaySet
from sim2d.rendering.scene import LAMP_DIRECTION_RAD, MARKER_RATIO, Ball, Bar, Bgr, Box, Post, Robot, Scene, Wall

FLOOR = 0  # number of the floor among the surfaces


class FirstHits:
    """For each ray of a `RaySet` the horizontal distance to the first surface, its number and its shade.

    Parameters
    ----------
    eye : Pose2
        Viewpoint's place and robot's heading, in the field frame.

    Attributes
    ----------
    distance_m : (N,) float32
        Horizontal distance, metres; inf for rays that meet nothing.
    surface : (N,) uint16
        Index into `colors`.
    shade : (N,) float32
        Lambert's factor on round things, 1 elsewhere.
    colors : list of (float, float, float)
        BGR of each surface.
    """

    def __init__(self, rays: RaySet, eye: Pose2, floor_bgr: Bgr) -> None:
        self.rays = rays
        self.eye = eye
        self._to_eye = eye.inverse()
        self.distance_m = rays.floor_m.copy()
        self.surface = np.zeros(len(rays.cos), dtype=np.uint16)
        self.shade = np.ones(len(rays.cos), dtype=np.float32)
        self.colors: list[Bgr] = [floor_bgr]

    def add_surface(self, color: Bgr) -> int:
        """Add a colour to `colors` and return its number."""
        self.colors.append(color)
        return len(self.colors) - 1

    def add_scene(self, scene: Scene) -> None:
        """Meet everything that stands or lies on the field."""
        for thing in (*scene.fixed(), *scene.robots):
            if isinstance(thing, Wall):
                self._add_wall(thing)
            elif isinstance(thing, Post):
                self._add_post(thing)
            elif isinstance(thing, Bar):
                self._add_bar(thing)
            elif isinstance(thing, Box):
                self._add_box(thing)
            else:
                self._add_robot(thing)
        if scene.ball is not None:
            self._add_ball(scene.ball)

    def crosses(self, corners: FloatArray) -> npt.NDArray[np.bool_]:
        """(N,) bool: whether the floor point of a ray lies outside a polygon (field frame) that holds the viewpoint."""
        outside = np.zeros(len(self.surface), dtype=bool)
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            for part, distance, _ in self._meet_segment(start, end):
                outside[part] ^= distance < self.rays.floor_m[part]
        return outside

    def _add_wall(self, wall: Wall) -> None:
        """Meet an upright sheet from either side."""
        sides = self.add_surface(wall.left_bgr), self.add_surface(wall.right_bgr)
        for part, distance, from_left in self._meet_segment((wall.x0_m, wall.y0_m), (wall.x1_m, wall.y1_m)):
            self._keep(part, distance, wall.height_m, sides[0] if from_left else sides[1])

    def _add_box(self, box: Box) -> None:
        """Meet the faces of a box that look here, and its top."""
        for face in box.faces():
            for part, distance, from_left in self._meet_segment((face.x0_m, face.y0_m), (face.x1_m, face.y1_m)):
                if not from_left:
                    self._keep(part, distance, box.height_m, self.add_surface(face.right_bgr))
        if box.height_m < self.rays.height_m:
            top = self.add_surface(box.color_bgr)
            local = self.eye.inverse().compose(Pose2(box.x_m, box.y_m, box.yaw_rad))
            c, s = np.float32(math.cos(local.theta_rad)), np.float32(math.sin(local.theta_rad))
            for part in self._window(self._to_eye.transform(box.corners)):
                cos, sin = self.rays.cos[part], self.rays.sin[part]
                distance = self._at_height(part, box.height_m)
                dx = distance * cos - np.float32(local.x_m)
                dy = distance * sin - np.float32(local.y_m)
                inside = np.abs(dx * c + dy * s) <= np.float32(box.width_m / 2)
                inside &= np.abs(dy * c - dx * s) <= np.float32(box.depth_m / 2)
                inside &= distance < self.distance_m[part]
                self._set(part, inside, distance, top)

    def _add_post(self, post: Post) -> None:
        """Meet an upright cylinder of one or more bands of colour."""
        bands = [self.add_surface(color) for color in post.bands_bgr]
        self._add_cylinder(post.x_m, post.y_m, post.radius_m, post.height_m, bands)

    def _add_robot(self, robot: Robot) -> None:
        """Meet a robot: its side, its top and the marker on it."""
        side = self.add_surface(robot.color_bgr)
        marker = self.add_surface(robot.marker_bgr)
        self._add_cylinder(robot.x_m, robot.y_m, robot.radius_m, robot.height_m, [side])
        self._add_disc(robot.x_m, robot.y_m, MARKER_RATIO * robot.radius_m, robot.height_m + 1e-4, marker)

    def _add_bar(self, bar: Bar) -> None:
        """Meet a level cylinder."""
        height_m, radius_m = bar.height_m, bar.radius_m
        a, b = self._to_eye.transform([(bar.x_m, -bar.half_length_m), (bar.x_m, bar.half_length_m)])
        number = self.add_surface(bar.color_bgr)
        length = math.hypot(*(b - a))
        ax, ay = (b - a) / length
        span = np.array([a, b])
        for part in self._window(np.vstack([span - radius_m, span + radius_m])):
            cos, sin, slope = self.rays.cos[part], self.rays.sin[part], self.rays.slope[part]
            # in the plane across the axis: ray (across, slope) from (0, viewpoint), circle at (offset, height)
            across = cos * np.float32(-ay) + sin * np.float32(ax)
            offset = np.float32(-a[0] * ay + a[1] * ax)
            rise = np.float32(height_m - self.rays.height_m)
            norm2 = across**2 + slope**2
            toward = across * offset + slope * rise
            root2 = toward**2 - norm2 * np.float32(offset**2 + rise**2 - radius_m**2)
            root = np.sqrt(np.maximum(root2, 0))
            distance = (toward - root) / np.maximum(norm2, np.float32(1e-12))
            along = distance * (cos * np.float32(ax) + sin * np.float32(ay)) - np.float32(a[0] * ax + a[1] * ay)
            hit = (root2 >= 0) & (distance > 0) & (distance < self.distance_m[part])
            hit &= (along >= 0) & (along <= np.float32(length))
            self._set(part, hit, distance, number)
            up = (self.rays.height_m + distance * slope - np.float32(height_m)) / np.float32(radius_m)
            np.copyto(self.shade[part], np.float32(0.80) + np.float32(0.20) * up, where=hit)

    def _add_ball(self, ball: Ball) -> None:
        """Meet a ball on the floor, lit from above and a little from the side."""
        number = self.add_surface(ball.color_bgr)
        patches = None if ball.patches_bgr is None else self.add_surface(ball.patches_bgr)
        x, y = self._to_eye.transform([ball.x_m, ball.y_m])
        z = ball.radius_m - self.rays.height_m
        lamp = LAMP_DIRECTION_RAD - self.eye.theta_rad
        lx, ly, lz = 0.5 * math.cos(lamp), 0.5 * math.sin(lamp), math.sqrt(0.75)
        for part in self._window_of_circle(x, y, ball.radius_m):
            cos, sin, slope = self.rays.cos[part], self.rays.sin[part], self.rays.slope[part]
            toward = cos * np.float32(x) + sin * np.float32(y) + slope * np.float32(z)
            norm2 = 1 + slope**2
            root2 = toward**2 - norm2 * np.float32(x * x + y * y + z * z - ball.radius_m**2)
            distance = (toward - np.sqrt(np.maximum(root2, 0))) / norm2
            hit = (root2 >= 0) & (distance > 0) & (distance < self.distance_m[part])
            self._set(part, hit, distance, number)
            if patches is not None:
                reach = (
                    distance * cos - np.float32(x),
                    distance * sin - np.float32(y),
                    distance * slope - np.float32(z),
                )
                radius = np.float32(ball.radius_m)
                normals = (reach[0] / radius, reach[1] / radius, reach[2] / radius)
                self._set(part, hit & is_patch(normals, ball.turn_rad), distance, patches)
            lit = (distance * cos - np.float32(x)) * np.float32(lx) + (distance * sin - np.float32(y)) * np.float32(ly)
            lit = (lit + (distance * slope - np.float32(z)) * np.float32(lz)) / np.float32(ball.radius_m)
            np.copyto(self.shade[part], np.float32(0.62) + np.float32(0.42) * lit, where=hit)

    def _add_cylinder(self, x_m: float, y_m: float, radius_m: float, height_m: float, bands: list[int]) -> None:
        x, y = self._to_eye.transform([x_m, y_m])
        lamp = LAMP_DIRECTION_RAD - self.eye.theta_rad
        lx, ly = np.float32(math.cos(lamp) / radius_m), np.float32(math.sin(lamp) / radius_m)
        for part in self._window_of_circle(x, y, radius_m):
            cos, sin = self.rays.cos[part], self.rays.sin[part]
            toward = cos * np.float32(x) + sin * np.float32(y)
            root2 = toward**2 - np.float32(x * x + y * y - radius_m**2)
            distance = toward - np.sqrt(np.maximum(root2, 0))
            up = self.rays.height_m + distance * self.rays.slope[part]
            hit = (root2 >= 0) & (distance > 0) & (distance < self.distance_m[part]) & (up <= np.float32(height_m))
            for k, number in enumerate(bands):
                self._set(part, hit & (up >= np.float32(k * height_m / len(bands))), distance, number)
            facing = (distance * cos - np.float32(x)) * lx + (distance * sin - np.float32(y)) * ly
            np.copyto(self.shade[part], np.float32(0.75) + np.float32(0.20) * facing, where=hit)
        self._add_disc(x_m, y_m, radius_m, height_m, bands[-1])

    def _add_disc(self, x_m: float, y_m: float, radius_m: float, height_m: float, number: int) -> None:
        if height_m >= self.rays.height_m:
            return
        x, y = self._to_eye.transform([x_m, y_m])
        for part in self._window_of_circle(x, y, radius_m):
            distance = self._at_height(part, height_m)
            dx = distance * self.rays.cos[part] - np.float32(x)
            dy = distance * self.rays.sin[part] - np.float32(y)
            hit = (dx * dx + dy * dy <= np.float32(radius_m**2)) & (distance < self.distance_m[part])
            self._set(part, hit, distance, number)
            np.copyto(self.shade[part], np.float32(1), where=hit)

    def _at_height(self, part: slice, height_m: float) -> Float32Array:
        """Distances at which rays come down to a height; far away for those that never do."""
        slope = np.minimum(self.rays.slope[part], np.float32(-1e-6))
        return np.asarray(np.float32(height_m - self.rays.height_m) / slope)

    def _meet_segment(self, start: npt.ArrayLike, end: npt.ArrayLike) -> list[tuple[slice, Float32Array, bool]]:
        """Distances (inf: missed) at which rays cross a segment in plan, and whether they come from its left."""
        a, b = self._to_eye.transform(np.array([start, end], dtype=np.float64))
        turn = float(a[0] * b[1] - a[1] * b[0])  # > 0: a, b counter-clockwise as seen from here
        from_left = turn > 0
        if not from_left:
            a, b, turn = b, a, -turn
        if turn < 1e-9:
            return []
        low = math.atan2(a[1], a[0])
        high = low + math.remainder(math.atan2(b[1], b[0]) - low, math.tau)
        ax, ay, bx, by = (np.float32(v) for v in (*a, *b))
        met = []
        for part in self.rays.window(low, high):
            cos, sin = self.rays.cos[part], self.rays.sin[part]
            past_a = ax * sin - ay * cos
            past_b = bx * sin - by * cos
            with np.errstate(divide="ignore"):
                distance = np.float32(turn) / (past_a - past_b)
            distance[(past_a < 0) | (past_b >= 0)] = np.inf
            met.append((part, np.asarray(distance, dtype=np.float32), from_left))
        return met

    def window_of(self, points: FloatArray) -> list[slice]:
        """Rays that can meet the convex hull of points (K, 2), field frame."""
        return self._window(self._to_eye.transform(points))

    def _window(self, points: FloatArray) -> list[slice]:
        """Rays that can meet the convex hull of points (K, 2) in the eye's frame."""
        middle = points.mean(axis=0)
        bearing = math.atan2(middle[1], middle[0])
        delta = np.remainder(np.arctan2(points[:, 1], points[:, 0]) - bearing + math.pi, math.tau) - math.pi
        low, high = float(delta.min()), float(delta.max())
        if high - low > 0.9 * math.pi or np.hypot(*points.T).min() < 1e-6:  # from nearby: all around
            return self.rays.window(-math.pi, math.pi)
        return self.rays.window(bearing + low, bearing + high)

    def _window_of_circle(self, x: float, y: float, radius_m: float) -> list[slice]:
        away = math.hypot(x, y)
        half = math.asin(radius_m / away) if away > radius_m else math.pi
        bearing = math.atan2(y, x)
        return self.rays.window(bearing - half, bearing + half)

    def _keep(self, part: slice, distance: Float32Array, height_m: float, number: int) -> None:
        with np.errstate(invalid="ignore"):
            up = self.rays.height_m + distance * self.rays.slope[part]
        hit = (distance < self.distance_m[part]) & (up <= np.float32(height_m))
        self._set(part, hit, distance, number)
        np.copyto(self.shade[part], np.float32(1), where=hit)

    def _set(self, part: slice, hit: npt.NDArray[np.bool_], distance: Float32Array, number: int) -> None:
        np.copyto(self.distance_m[part], distance, where=hit)
        np.copyto(self.surface[part], np.uint16(number), where=hit)
