"""Fast renderer of a mirror camera's frames: one ray for each pixel from tables, with edges averaged along bearings.

Like `MirrorRenderer` it draws walls, goals with nets, boxes, robots, ball and lines under a linear light gradient, but
no texture, shadows, highlights and bystanders. Along a bearing of an upright mirror, objects hide each other in order
of distance. That makes it several times faster than the tiles of `ForwardFrames`, which need rays that change evenly
from pixel to pixel, unlike a mirror's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import Float32Array, FloatArray, UInt8Array
from robocup_vision.camera import OmniCamera
from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.geometry import Pose2
from sim2d.kernels.floor_lines import GAIN, X, Y
from sim2d.kernels.frame_values import Bearings, MirrorView, PixelRays, Viewpoint
from sim2d.kernels.match_pixels import draw_over_carpet, fill_carpet
from sim2d.rendering.fast.match_frames import MatchFrames
from sim2d.rendering.mirror import BODY_BGR
from sim2d.rendering.rays import RIM_MARGIN, MirrorRays
from sim2d.rendering.scene import Ball, Robot, Scene
from sim2d.rendering.sensor import Sensor

ENTRIES, SPANS = 14, 32  # greatest numbers of objects along a bearing, and of spans that they make
# step of the derivatives by a lean, and the smallest lean that is drawn, which moves the picture by a tenth of a pixel
_STEP_RAD, _MIN_LEAN_RAD = math.radians(1.0), math.radians(0.01)
# OpenCV's second map is not used when coordinates are interleaved
_NO_MAP = np.empty(0, dtype=np.float32)


class MirrorFrames(MatchFrames):
    """Draws the frames of a mirror camera with a known viewpoint height; see `MatchFrames`.

    Raises
    ------
    ArgumentError
        As `MatchFrames`, or if the room has bystanders.
    """

    camera: OmniCamera

    def __init__(self, scene: Scene, camera: OmniCamera, sensor: Sensor) -> None:
        super().__init__(scene, camera, sensor)
        prepare("mirror_frames", "sim2d")
        if scene.room.bystanders:
            raise ArgumentError("a mirror camera's match is drawn without bystanders")
        width, height = camera.size_px
        self._farthest_m = 2 * scene.room_radius_m
        self._table = mirror_pixels(camera, self._gain, self._farthest_m)
        count, rays = len(self._table.rays.directions), len(self._table.rays.pixels)
        self._bearings = Bearings(
            np.zeros(count, dtype=np.int32),
            np.zeros((count, ENTRIES, 5), dtype=np.float32),
            np.zeros((count, SPANS), dtype=np.float32),
            np.zeros((count, SPANS), dtype=np.int32),
            np.zeros((count, SPANS, 3), dtype=np.float32),
            np.zeros(rays, dtype=np.float32),
            np.zeros(rays, dtype=np.int32),
        )
        self._planes = np.zeros((3, width * height), dtype=np.uint8)
        self._image_planes = [plane.reshape(height, width) for plane in self._planes]

    def draw(
        self,
        robots: tuple[Robot, ...],
        ball: Ball | None,
        pose: Pose2,
        *,
        pitch_rad: float = 0.0,
        roll_rad: float = 0.0,
    ) -> UInt8Array:
        """Draw a frame (H, W, 3) uint8 with other robots and the ball: light through the lens, without blur and noise.

        Parameters
        ----------
        pose : Pose2
            Pose of the robot that carries the camera, field frame.
        pitch_rad, roll_rad : float
            Lean of the robot's body about its foot; positive: nose up, and right side down.
        """
        if not (pitch_rad or roll_rad):
            return self._draw_upright(robots, ball, pose)
        moved = pose.compose(Pose2(*self._leaning.shift_m(pitch_rad, roll_rad), 0.0))
        return self._leaning.lean(self._draw_upright(robots, ball, moved), pitch_rad, roll_rad)

    @cached_property
    def _leaning(self) -> LeaningMirror:
        return LeaningMirror(self.camera)

    def _draw_upright(self, robots: tuple[Robot, ...], ball: Ball | None, pose: Pose2) -> UInt8Array:
        table, eye, things = self._table, self._viewpoint(pose), self._things(robots, ball)
        fill_carpet(table.floor, self._light, eye, self._paint.colors[0], table.body, self._planes)
        frame = np.asarray(cv2.merge(self._image_planes), dtype=np.uint8)
        of_scene = things, self._paint, self._nets, self._wall, self._light
        draw_over_carpet(MirrorView(*of_scene, table.rays, self._farthest_m, eye), self._bearings, frame.reshape(-1, 3))
        return frame

    def _viewpoint(self, pose: Pose2) -> Viewpoint:
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        forward, left = self.camera.offset_m
        x_m, y_m = pose.x_m + c * forward - s * left, pose.y_m + s * forward + c * left
        return Viewpoint(float(x_m), float(y_m), float(pose.theta_rad), self._table.height_m)


@dataclass(frozen=True, eq=False)
class PixelTable:
    """A camera's pixels in the format of the compiled loops (`kernels.match_pixels`)."""

    #: Height of the viewpoint.
    height_m: float
    #: Rays of the pixels that show the scene.
    rays: PixelRays
    #: (3, H * W) float32: x and y of the floor point, robot frame, and gain of every pixel; 0 without a ray.
    floor: Float32Array
    #: (3, H * W) uint8: colours of the pixels without a ray: the robot's own body, and black.
    body: UInt8Array


def mirror_pixels(camera: OmniCamera, gain: Float32Array, farthest_m: float) -> PixelTable:
    """Compute a mirror camera's pixels.

    Parameters
    ----------
    camera : OmniCamera
        Must have a known viewpoint height.
    gain : (H, W) float32
        Relative light of each pixel.
    farthest_m : float
        Greatest distance of floor points; farther ones are moved to it.
    """
    drawn = MirrorRays(camera, 1)
    per_turn = round(math.tau * camera.usable_radius_px[1])  # one bearing for each pixel of the rim
    pixel = drawn.pixel_index
    width = camera.size_px[0]
    low, high = _slope_range(camera, np.stack([pixel % width, pixel // width], axis=-1).astype(np.float64))
    place = np.rint(np.arctan2(drawn.sin, drawn.cos) * per_turn / math.tau).astype(np.int32) % per_turn
    along = np.minimum(drawn.floor_m, farthest_m)
    on_floor = drawn.floor_m < farthest_m
    radial, tangential = drawn.patch_m
    order = np.lexsort((low, place))
    rows = np.stack(
        [
            along * drawn.cos,
            along * drawn.sin,
            low,
            high,
            gain.ravel()[pixel],
            radial,
            tangential,
            along - radial / 2,
            along + radial / 2,
        ]
    )
    rays = np.ascontiguousarray(rows[:, order], dtype=np.float32)
    pixel = pixel[order]
    angle = np.arange(per_turn) * math.tau / per_turn
    image = np.zeros((3, gain.size), dtype=np.float32)
    image[:, pixel] = rays[[X, Y, GAIN]]
    body = (drawn.body_part * gain).reshape(1, -1) * np.array(BODY_BGR)[:, None]
    body[:, pixel] = 0
    directions = np.stack([angle, np.cos(angle), np.sin(angle)], axis=1)
    return PixelTable(
        drawn.height_m,
        PixelRays(
            rays,
            pixel.astype(np.uint32),
            np.searchsorted(place[order], np.arange(per_turn + 1)).astype(np.int32),
            directions,
            _spread(along[on_floor], tangential[on_floor] / 2 + along[on_floor] * math.pi / per_turn),
        ),
        image,
        np.rint(np.clip(body, 0, 255)).astype(np.uint8),
    )


def _spread(along: FloatArray, reach: FloatArray) -> FloatArray:
    """Return a straight line (constant, slope by distance) above every lateral reach (N,)."""
    near, far = np.argmin(along), np.argmax(along)
    per_m = max(0.0, float(reach[far] - reach[near]) / max(float(along[far] - along[near]), 1e-9))
    return np.array([float((reach - per_m * along).max()), per_m])


def _slope_range(camera: OmniCamera, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and greatest slope (N,) within each pixel (N, 2), by central differences."""

    def slope(du: float, dv: float) -> FloatArray:
        ray = camera.pixel_to_ray(pixels + np.array([du, dv]))
        return np.asarray(ray[:, 2] / np.maximum(np.hypot(ray[:, 0], ray[:, 1]), 1e-9))

    middle = slope(0.0, 0.0)
    half = np.hypot(slope(0.25, 0.0) - slope(-0.25, 0.0), slope(0.0, 0.25) - slope(0.0, -0.25))
    half = np.maximum(np.nan_to_num(half), 1e-6)  # NaN where the mirror's curve ends within the pixel
    return middle - half, middle + half


class LeaningMirror:
    """Applies a small lean of the body to pictures of an upright mirror camera.

    Each pixel of the leaning camera shows the upright picture at another place, which is linear in the lean.
    """

    def __init__(self, camera: OmniCamera) -> None:
        self._height_m = camera.height_m or 0.0
        width, height = camera.size_px
        u, v = np.meshgrid(np.arange(width), np.arange(height))
        pixels = np.stack([u, v], axis=-1).astype(np.float64)
        self._upright = pixels.astype(np.float32)
        self._source = np.empty_like(self._upright)
        from_center = pixels - camera.center_px
        radius = np.hypot(from_center[..., 0], from_center[..., 1])
        inner, rim = camera.usable_radius_px[0], camera.usable_radius_px[1] * (1 + RIM_MARGIN)
        # the robot's body leans with its camera, and pixels outside the rim are black
        shows = (radius > inner) & (radius < rim)
        with np.errstate(invalid="ignore"):
            rays = camera.pixel_to_ray(pixels)
        self._by_pitch, self._by_roll = (
            _derivative(camera, rays, shows, lean) for lean in ((_STEP_RAD, 0.0), (0.0, _STEP_RAD))
        )

    def shift_m(self, pitch_rad: float, roll_rad: float) -> tuple[float, float]:
        """Return the camera's displacement forward and left by a lean of the body about its foot."""
        return -self._height_m * math.sin(pitch_rad), -self._height_m * math.sin(roll_rad)

    def lean(self, frame: UInt8Array, pitch_rad: float, roll_rad: float) -> UInt8Array:
        """Return a frame (H, W, 3) uint8 as seen by the leaning camera; unchanged for tiny leans.

        Parameters
        ----------
        pitch_rad, roll_rad : float
            Positive: nose up, and right side down.
        """
        if max(abs(pitch_rad), abs(roll_rad)) < _MIN_LEAN_RAD:
            return frame
        cv2.scaleAdd(self._by_pitch, pitch_rad, self._upright, self._source)
        cv2.scaleAdd(self._by_roll, roll_rad, self._source, self._source)
        # OpenCV is fastest with fixed-point maps
        whole, parts = cv2.convertMaps(self._source, _NO_MAP, cv2.CV_16SC2)
        moved = cv2.remap(frame, whole, parts, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(moved, dtype=np.uint8)


def _derivative(
    camera: OmniCamera, rays: FloatArray, shows: npt.NDArray[np.bool_], lean: tuple[float, float]
) -> Float32Array:
    """Return the derivative of each pixel's source by the lean (H, W, 2) float32, by central differences."""
    pixels = []
    for sign in (1.0, -1.0):
        turned = rays @ camera_rotation(0.0, sign * lean[0], sign * lean[1]).T
        with np.errstate(invalid="ignore"):
            pixels.append(camera.ray_to_pixel(turned))
    per_rad = (pixels[0] - pixels[1]) / (2 * _STEP_RAD)
    return np.where(shows[..., None] & np.isfinite(per_rad), per_rad, 0.0).astype(np.float32)
