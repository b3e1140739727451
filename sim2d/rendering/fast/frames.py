"""Frames of a plain match, fast: one ray a pixel from precomputed tables, edges averaged along each bearing.

It draws walls, goals with their nets, boxes, robots, ball and lines under evenly changing light, as `MirrorRenderer`
does. Only `MirrorRenderer` draws texture, shadows, highlights and bystanders.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np

from field_models import COLOR_NAMES
from field_models.errors import ArgumentError
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from sim2d.kernels.frame_values import (
    BallSphere,
    Crossings,
    Lighting,
    PaintMarks,
    RoomWall,
    Spans,
    Things,
    Viewpoint,
)
from sim2d.kernels.match_frame import FloorPaint, FrameRoom, Standing, draw_over_carpet
from sim2d.kernels.match_pixels import fill_carpet
from sim2d.kernels.nets import lay_nets
from sim2d.rendering.fast.tables import arc_rows, line_rows, mirror_pixels
from sim2d.rendering.nets import nets_of
from sim2d.rendering.room import ROWS_PER_M, room_panorama
from sim2d.rendering.scene import LAMP_DIRECTION_RAD, Ball, Bgr, Light, Robot, Scene, Wall
from sim2d.rendering.sensor import Sensor, vignette_gain

ENTRIES, SPANS = 12, 32  # most things along a bearing, and most spans they make
MARKER_RATIO = 0.3  # of a robot's radius
SHADE_REACH = 3.0  # of a ball, in its radii


def refuse_uneven(lamp: Light, sensor: Sensor = Sensor()) -> None:
    """Refuse what no match is drawn with.

    Raises
    ------
    ArgumentError
        If the light has texture, shadow or highlights, or the sensor compresses.
    """
    if lamp.texture or lamp.shadow is not None or lamp.highlights or sensor.jpeg_quality:
        raise ArgumentError("a match is drawn without texture, shadow, highlights and compression")


def even_light(scene: Scene, lamp: Light) -> Lighting:
    """Return the light on a scene's floor as the compiled loops take it."""
    per_m = lamp.level * lamp.gradient / (scene.field.length_m / 2)
    direction = lamp.gradient_direction_rad
    along = per_m * math.cos(direction), per_m * math.sin(direction)
    return Lighting(float(lamp.level), *along, 0.05 * lamp.level, LAMP_DIRECTION_RAD)


class EvenlyLit:
    """Draws frames in light that may change from one to the next."""

    scene: Scene
    _light: Lighting

    def set_light(self, light: Light) -> None:
        """Light the field so from now on; the room behind it keeps its light.

        Raises
        ------
        ArgumentError
            If it has texture, shadow or highlights.
        """
        refuse_uneven(light)
        self._light = even_light(self.scene, light)


class FastFrames(EvenlyLit):
    """Draws one field and all fixed objects on it for one type of camera.

    Parameters
    ----------
    scene : Scene
        Field, boxes, light and room; its robots and ball do not matter.
    camera : OmniCamera
        With a known viewpoint height.
    sensor : Sensor
        Whose vignette, gain and white balance are applied; blur and noise are not.

    Raises
    ------
    ArgumentError
        If the light has texture, shadow or highlights, the room has bystanders, or the sensor compresses.
    """

    def __init__(self, scene: Scene, camera: OmniCamera, sensor: Sensor) -> None:
        refuse_uneven(scene.light, sensor)
        if scene.room.bystanders:
            raise ArgumentError("a mirror camera's match is drawn without bystanders")
        self.scene, self.camera = scene, camera
        self._cast = np.array(sensor.cast_bgr)
        width, height = camera.size_px
        gain = vignette_gain(height, width, sensor.vignette) * np.float32(sensor.gain)
        room_radius_m = float(np.hypot(*scene.carpet_polygon.T).max()) + scene.room.distance_m
        self._table = mirror_pixels(camera, gain, 2 * room_radius_m)
        half_line_m = scene.field.line_width_m / 2
        self._paint = FloorPaint(line_rows(scene.field), arc_rows(scene.field), half_line_m, 2 * room_radius_m)
        picture = np.ascontiguousarray(
            room_panorama(scene.room.seed) * scene.light.level * self._cast, dtype=np.float32
        )
        ground = np.array(scene.room.floor_bgr) * self._cast
        self._walls_behind = RoomWall(picture, float(ROWS_PER_M), room_radius_m, ground)
        self._light = even_light(scene, scene.light)
        self._build_fixed(scene)
        self._nets = nets_of(scene.field, self._cast)
        count, rays = len(self._table.bearings.directions), len(self._table.rays.pixels)
        crossings = Crossings(np.zeros(count, dtype=np.int32), np.zeros((count, ENTRIES, 4), dtype=np.float32))
        spans = Spans(
            np.zeros((count, SPANS), dtype=np.float32),
            np.zeros((count, SPANS), dtype=np.int32),
            np.zeros((count, SPANS, 3), dtype=np.float32),
            np.zeros(count, dtype=np.int32),
        )
        marks = PaintMarks(np.zeros(rays, dtype=np.float32), np.zeros(rays, dtype=np.int32))
        self._room = FrameRoom(crossings, spans, marks, np.zeros(count))
        self._planes = np.zeros((3, width * height), dtype=np.uint8)
        self._image_planes = [plane.reshape(height, width) for plane in self._planes]
        paints = (COLOR_NAMES["green"], COLOR_NAMES[scene.field.line_color], (0, 0, 0))
        self._plain = (np.array(paints) * self._cast).astype(np.float32)

    def _build_fixed(self, scene: Scene) -> None:
        """Rows of all things that do not move: walls from either side, faces of boxes, posts."""
        corners = scene.carpet_polygon
        edges = np.hstack([corners, np.roll(corners, -1, axis=0)]).tolist()
        walls = list(scene.walls())
        if not scene.field.is_bounded:
            # the carpet's end: an edge of the floor without height
            walls = [Wall(x0, y0, x1, y1, 0.0, (0, 0, 0), (0, 0, 0)) for x0, y0, x1, y1 in edges] + walls
        colors: list[Bgr] = []
        rows: list[list[float]] = []

        def add(height_m: float, bands: Sequence[Bgr], top: Bgr | None = None, is_edge: bool = False) -> None:
            rows.append([height_m, len(bands), len(colors), -1, -1, 0.0, float(is_edge)])
            colors.extend(bands)
            if top is not None:
                rows[-1][3] = len(colors)
                colors.append(top)

        for number, wall in enumerate(walls):
            for side in (wall.lit.left_bgr, wall.lit.right_bgr):
                add(wall.height_m, (side,), is_edge=number < len(edges))
        self._first_face = len(rows)
        for box in scene.boxes:
            for face in box.faces():
                add(box.height_m, (face.right_bgr,), box.color_bgr)
        self._first_cylinder = len(rows)
        posts = list(scene.posts())
        for post in posts:
            add(post.height_m, post.bands_bgr, post.bands_bgr[-1])
        self._walls = np.array([[w.x0_m, w.y0_m, w.x1_m, w.y1_m] for w in walls], dtype=np.float64).reshape(-1, 4)
        self._boxes = np.array([box.corners for box in scene.boxes], dtype=np.float64).reshape(-1, 4, 2)
        self._posts = [(post.x_m, post.y_m, post.radius_m) for post in posts]
        self._rows, self._colors = rows, colors

    @lru_cache(maxsize=8)  # noqa: B019  (one object a match; the few teams' paint)
    def _things(self, robots: tuple[tuple[float, float, Bgr, Bgr], ...]) -> Things:
        """Return all rows and colours, with robots of given radius, height, colour and marker."""
        rows, colors = [list(row) for row in self._rows], list(self._colors)
        for radius, height, color, marker in robots:
            gap = radius**2 * (1 - MARKER_RATIO**2)
            rows.append([height, 1, len(colors), len(colors), len(colors) + 1, gap, 0.0])
            colors += [color, marker]
        return Things(np.array(rows, dtype=np.float64).reshape(-1, 7), np.array(colors, dtype=np.float64) * self._cast)

    def draw(self, robots: tuple[Robot, ...], ball: Ball | None, pose: Pose2) -> UInt8Array:
        """Draw a frame (H, W, 3) uint8 of other robots and the ball: light through the lens, without blur and noise.

        `pose` is that of the robot that carries the camera, field frame.
        """
        table, plain = self._table, self._plain
        eye = self._viewpoint(pose)
        things = self._things(tuple((r.radius_m, r.height_m, r.color_bgr, r.marker_bgr) for r in robots))
        round_things = self._posts + [(r.x_m, r.y_m, r.radius_m) for r in robots]
        cylinders = np.array(round_things, dtype=np.float64).reshape(-1, 3)
        sphere = BallSphere(0.0, 0.0, 0.0, 0.0)
        if ball is not None:
            sphere = BallSphere(float(ball.x_m), float(ball.y_m), ball.radius_m, SHADE_REACH * ball.radius_m)
            plain[2] = ball.color_bgr
            plain[2] *= self._cast
        fill_carpet(table.floor, self._light, eye, plain[0], table.body, self._planes)
        frame = np.asarray(cv2.merge(self._image_planes), dtype=np.uint8)
        flat = frame.reshape(-1, 3)
        standing = Standing(self._walls, self._boxes, self._first_face, cylinders, self._first_cylinder)
        draw_over_carpet(
            standing,
            things,
            self._paint,
            sphere,
            self._walls_behind,
            self._light,
            eye,
            table.bearings,
            table.rays,
            plain,
            self._room,
            flat,
        )
        if len(self._nets.rows):
            lay_nets(self._nets, table.rays, self._room.crossings, things, eye, sphere, self._light, flat)
        return frame

    def _viewpoint(self, pose: Pose2) -> Viewpoint:
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        forward, left = self.camera.offset_m
        x_m, y_m = pose.x_m + c * forward - s * left, pose.y_m + s * forward + c * left
        return Viewpoint(float(x_m), float(y_m), float(pose.theta_rad), self._table.height_m)
