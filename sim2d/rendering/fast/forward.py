"""Frames of a forward camera in match time: one ray a pixel, four where an edge crosses it, nothing worked out twice.

It draws walls, goals with their nets, beacons, boxes, bystanders, robots, ball and lines under evenly changing light
before the room's wall or a hall's backdrop, as `render_pinhole` does. Only `render_pinhole` draws texture, shadows,
highlights, glare and patches of sun.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from field_models import COLOR_NAMES
from robocup_vision.arrays import Float32Array, UInt8Array
from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.pinhole import camera_rotation
from sim2d.kernels.forward.outlines import ARC_PIECES
from sim2d.kernels.forward.room import pack_cells
from sim2d.kernels.forward.things import BALL, BAR, BOX_TOP, COLUMNS, CYLINDER, SHEET
from sim2d.kernels.forward.tiles import draw_forward
from sim2d.kernels.forward.values import FloorPaint, ForwardEye, Outlines, UprightThings, WallPicture
from sim2d.rendering.backdrop import Backdrop
from sim2d.rendering.fast.frames import SHADE_REACH, EvenlyLit, even_light, refuse_uneven
from sim2d.rendering.fast.tables import TILE_PX, arc_rows, lens_table, line_rows
from sim2d.rendering.nets import nets_of
from sim2d.rendering.room import ROWS_PER_M, room_panorama
from sim2d.rendering.scene import Ball, Bgr, Box, Post, Robot, Scene, Wall
from sim2d.rendering.sensor import Sensor, vignette_gain


class EyeInField(NamedTuple):
    """A camera's centre of projection and where it looks, field frame."""

    #: Centre of projection.
    x_m: float
    y_m: float
    height_m: float
    #: Orientation when the middle row is read; see `camera_rotation`.
    heading_rad: float
    tilt_rad: float
    roll_rad: float
    #: How far it turns about its own axes (ahead, left, up) while its rows are read from the first to the last.
    turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)


class ForwardFrames(EvenlyLit):
    """Draws one field and all fixed objects around it for one type of camera.

    Parameters
    ----------
    scene : Scene
        Field, boxes, light and room; its robots and ball do not matter.
    camera : PinholeCamera
        Its place and orientation do not matter.
    sensor : Sensor
        Whose vignette, gain and white balance are applied; blur and noise are not.
    backdrop : Backdrop, optional
        Hangs on the room's wall in place of the scene's own clutter.

    Raises
    ------
    ArgumentError
        If the light has texture, shadow or highlights, the sensor compresses, or the lens leaves part of the image
        without rays.
    """

    def __init__(
        self, scene: Scene, camera: PinholeCamera, sensor: Sensor, *, backdrop: Backdrop | None = None
    ) -> None:
        refuse_uneven(scene.light, sensor)
        self.scene, self.camera = scene, camera
        self._cast = np.array(sensor.cast_bgr)
        width, height = camera.size_px
        self._lens = lens_table(camera, vignette_gain(height, width, sensor.vignette) * np.float32(sensor.gain))
        self._light = even_light(scene, scene.light)
        radius_m = float(np.hypot(*scene.carpet_polygon.T).max()) + scene.room.distance_m
        picture, rows_per_m = _wall_picture(scene, backdrop, radius_m / max(camera.focal_px))
        cells = pack_cells((picture * (scene.light.level * self._cast)).astype(np.float32))
        self._wall = WallPicture(cells, picture.shape[1], rows_per_m, radius_m)
        corners = scene.carpet_polygon
        colors = np.array([COLOR_NAMES["green"], COLOR_NAMES[scene.field.line_color], scene.room.floor_bgr])
        self._paint = FloorPaint(
            line_rows(scene.field),
            arc_rows(scene.field),
            scene.field.line_width_m / 2,
            np.hstack([corners, np.roll(corners, -1, axis=0)]),
            not scene.field.is_bounded,  # a floor with recesses is not
            (colors * self._cast).astype(np.float32),
        )
        self._rows: list[list[float]] = []
        self._colors: list[Bgr] = []
        self._add_fixed(scene)
        self._nets = nets_of(scene.field, self._cast)
        self._planes = np.zeros((3, height, width), dtype=np.uint8)
        self._all_rows = np.zeros((0, COLUMNS))
        self._outlines = _empty_outlines(0)

    def _add_fixed(self, scene: Scene) -> None:
        for wall in scene.walls():
            self._add_sheet(wall.lit)
        for bar in scene.bars():
            ends = [bar.x_m, -bar.half_length_m, bar.x_m, bar.half_length_m]
            self._rows.append([BAR, *ends, bar.radius_m, bar.height_m, len(self._colors), 1, -1])
            self._colors.append(bar.color_bgr)
        for thing in (*scene.posts(), *scene.boxes, *scene.bystanders()):
            if isinstance(thing, Post):
                row = [CYLINDER, thing.x_m, thing.y_m, 0, 0, thing.radius_m, thing.height_m, len(self._colors)]
                self._rows.append([*row, len(thing.bands_bgr), -1])
                self._colors += thing.bands_bgr
            else:
                self._add_box(thing)

    def _add_box(self, box: Box) -> None:
        for face in box.faces():
            self._add_sheet(face)
        row = [BOX_TOP, box.x_m, box.y_m, math.cos(box.yaw_rad), math.sin(box.yaw_rad), box.width_m / 2, box.height_m]
        self._rows.append([*row, len(self._colors), 1, box.depth_m / 2])
        self._colors.append(box.color_bgr)

    def _add_sheet(self, wall: Wall) -> None:
        number, ends = len(self._colors), [wall.x0_m, wall.y0_m, wall.x1_m, wall.y1_m]
        self._rows.append([SHEET, *ends, 0, wall.height_m, number, 1, number + 1])
        self._colors += [wall.left_bgr, wall.right_bgr]

    @lru_cache(maxsize=8)  # noqa: B019  (one object a match; the few teams' paint)
    def _paints(self, moving: tuple[Bgr, ...]) -> Float32Array:
        colors = np.array([*self._colors, *moving], dtype=np.float64).reshape(-1, 3)
        return np.asarray(colors * self._cast, dtype=np.float32)

    def draw(self, robots: tuple[Robot, ...], ball: Ball | None, eye: EyeInField) -> UInt8Array:
        """Draw a frame (H, W, 3) uint8 of other robots and the ball: light through the lens, without blur and noise."""
        fixed, number = len(self._rows), len(self._colors)
        count = fixed + len(robots) + (ball is not None)
        if count > len(self._all_rows):
            self._all_rows = np.zeros((count, COLUMNS))
            self._all_rows[:fixed] = np.array(self._rows, dtype=np.float64).reshape(-1, COLUMNS)
            floor = len(self._paint.edges) + len(self._paint.lines) + len(self._paint.arcs) * ARC_PIECES
            self._outlines = _empty_outlines(floor + count + 1 + len(self._nets.rows))
        rows = self._all_rows[:count]
        moving: list[Bgr] = []
        moving_rows: list[tuple[float, ...]] = []
        for k, robot in enumerate(robots):
            first = number + 2 * k
            place = robot.x_m, robot.y_m, 0.0, 0.0
            moving_rows.append((CYLINDER, *place, robot.radius_m, robot.height_m, first, 1.0, first + 1))
            moving += [robot.color_bgr, robot.marker_bgr]
        reach_m = 0.0
        if ball is not None:
            about_x, about_y, about_z = ball.turn_rad
            place, first = (ball.x_m, ball.y_m, about_x, about_y), number + len(moving)
            moving.append(ball.color_bgr)
            patches = -1.0
            if ball.patches_bgr is not None:
                patches = first + 1.0
                moving.append(ball.patches_bgr)
            moving_rows.append((BALL, *place, ball.radius_m, 2 * ball.radius_m, first, about_z, patches))
            reach_m = SHADE_REACH * ball.radius_m
        if moving_rows:
            rows[fixed:] = moving_rows
        things = UprightThings(rows, self._paints(tuple(moving)))
        rotation = np.ascontiguousarray(camera_rotation(eye.heading_rad, eye.tilt_rad, eye.roll_rad), dtype=np.float64)
        at = ForwardEye(float(eye.x_m), float(eye.y_m), float(eye.height_m), rotation, np.array(eye.turn_rad))
        seen = self._lens, at, self._paint, things, self._nets, reach_m, self._light, self._wall
        draw_forward(*seen, self._outlines, TILE_PX, self._planes)
        return np.asarray(cv2.merge(list(self._planes)), dtype=np.uint8)


def _empty_outlines(count: int) -> Outlines:
    return Outlines(np.zeros((count, 10), dtype=np.float32), np.zeros((count, 3), dtype=np.int32))


def _wall_picture(scene: Scene, backdrop: Backdrop | None, pixel_m: float) -> tuple[Float32Array, float]:
    """Return what the room's wall shows, row 0 at the floor, and its rows a metre; a pixel is `pixel_m` wide there."""
    if backdrop is None:
        picture = room_panorama(scene.room.seed)
        half = picture.shape[1] // 2
        # `render_pinhole` rounds columns of negative azimuth up
        return np.concatenate([picture[:, :half], picture[:, half + 1 :], picture[:, :1]], axis=1), float(ROWS_PER_M)
    picture, rows_per_m = backdrop.unrolled()
    # one cell is averaged over at most one pixel
    coarser = max(1, int(pixel_m * rows_per_m))
    rows, columns = picture.shape[:2]
    if coarser > 1:
        shape = (columns // coarser, rows // coarser)
        picture = np.asarray(cv2.resize(picture, shape, interpolation=cv2.INTER_AREA))
    return np.ascontiguousarray(picture[::-1]), rows_per_m * len(picture) / rows
