"""Common part of the fast frames of all cameras: one scene, light without texture, the sensor's colours."""

from __future__ import annotations

import math

import cv2
import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import Float32Array
from robocup_vision.camera import OmniCamera, PinholeCamera
from sim2d.kernels.frame_values import Lighting, UprightThings, WallPicture
from sim2d.kernels.room import pack_cells
from sim2d.kernels.things import COLUMNS
from sim2d.rendering.backdrop import ROOM_ROWS_PER_M, Backdrop, room_panorama
from sim2d.rendering.scene import LAMP_DIRECTION_RAD, Ball, Light, Robot, Scene
from sim2d.rendering.scene_table import ThingTable, floor_paint, in_cast, nets_of
from sim2d.rendering.sensor import Sensor, vignette_gain


class MatchFrames:
    """Draws one field and all fixed objects around it for one kind of camera.

    Parameters
    ----------
    scene : Scene
        Field, boxes, light and room; its robots and ball are not used.
    sensor : Sensor
        Its vignette, gain and white balance are applied, but not its blur and noise.

    Raises
    ------
    ArgumentError
        If the light has texture, shadow or highlights, or the sensor compresses.
    """

    def __init__(
        self, scene: Scene, camera: OmniCamera | PinholeCamera, sensor: Sensor, backdrop: Backdrop | None = None
    ) -> None:
        if sensor.jpeg_quality:
            raise ArgumentError("a match is drawn without compression")
        self.scene, self.camera = scene, camera
        self.set_light(scene.light)
        self._cast = np.array(sensor.cast_bgr)
        width, height = camera.size_px
        self._gain = vignette_gain(height, width, sensor.vignette) * np.float32(sensor.gain)
        self._paint = floor_paint(scene, self._cast)
        self._nets = nets_of(scene.field, self._cast)
        self._fixed = ThingTable(scene.fixed())
        self._rows, self._fixed_colors = self._fixed.values.rows, in_cast(self._fixed.colors, self._cast)
        radius_m = scene.room_radius_m
        pixel_rad = 1.0 / max(camera.focal_px) if isinstance(camera, PinholeCamera) else 0.0
        picture, rows_per_m = _wall_picture(scene, backdrop, pixel_rad * radius_m)
        cells = pack_cells((picture * (scene.light.level * self._cast)).astype(np.float32))
        self._wall = WallPicture(cells, picture.shape[1], rows_per_m, radius_m)

    def set_light(self, light: Light) -> None:
        """Set the light on the field; the room behind keeps its light.

        Raises
        ------
        ArgumentError
            If it has texture, shadow or highlights.
        """
        if light.texture or light.shadow is not None or light.highlights:
            raise ArgumentError("a match is drawn without texture, shadow and highlights")
        per_m = light.level * light.gradient / (self.scene.field.length_m / 2)
        direction = light.gradient_direction_rad
        along = per_m * math.cos(direction), per_m * math.sin(direction)
        self._light = Lighting(float(light.level), *along, 0.05 * light.level, LAMP_DIRECTION_RAD)

    def _things(self, robots: tuple[Robot, ...], ball: Ball | None) -> UprightThings:
        """Return all objects of the scene, including robots and a ball."""
        moving = ThingTable((*robots, *(() if ball is None else (ball,))), len(self._fixed.colors))
        fixed = len(self._fixed.rows)
        count = fixed + len(moving.rows)
        if count > len(self._rows):
            self._rows = np.vstack([self._rows[:fixed], np.zeros((count - fixed, COLUMNS))])
        if moving.rows:
            self._rows[fixed:count] = moving.rows
        colors = np.concatenate([self._fixed_colors, in_cast(moving.colors, self._cast)])
        return UprightThings(self._rows[:count], colors)


def _wall_picture(scene: Scene, backdrop: Backdrop | None, pixel_m: float) -> tuple[Float32Array, float]:
    """Return the wall's picture, row 0 at the floor, and its rows per metre; `pixel_m`: size of a pixel on the wall."""
    if backdrop is None:
        picture = room_panorama(scene.room.seed)
        half = picture.shape[1] // 2
        # `render_pinhole` rounds columns of negative azimuth up
        return np.concatenate([picture[:, :half], picture[:, half + 1 :], picture[:, :1]], axis=1), float(
            ROOM_ROWS_PER_M
        )
    picture, rows_per_m = backdrop.unrolled()
    # reduced to at least one cell for each pixel
    coarser = max(1, int(pixel_m * rows_per_m))
    rows, columns = picture.shape[:2]
    if coarser > 1:
        shape = (columns // coarser, rows // coarser)
        picture = np.asarray(cv2.resize(picture, shape, interpolation=cv2.INTER_AREA))
    return np.ascontiguousarray(picture[::-1]), rows_per_m * len(picture) / rows
