"""Overhead cameras: the part of the field that each covers, its image, and the visible part of the ball.

The image and the mask of the ball's visible pixels are drawn by the same functions. The true camera pose differs
slightly from the calibration, with which measurements in the image are projected to the field.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import cv2
import numpy as np

from field_models import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.ssl.values.geometry import CameraCalibration
from robocup_vision.ssl.values.simulation import Team
from sim2d.network.world import SIDES, LeagueState
from sim2d.world.state import RobotState

HEIGHT_M = 5.0
SIZE_PX = (1280, 1024)
# sub-pixel bits of OpenCV's drawing
_SHIFT = 6
_SUB = 1 << _SHIFT
_CARPET, _LINE, _BEYOND = (60, 120, 40), (235, 235, 235), (50, 60, 50)
_SIDE, _TOP, _BALL = (35, 35, 35), (20, 20, 20), (20, 110, 245)
_SIDES = {SIDES[Team.YELLOW]: (40, 225, 245), SIDES[Team.BLUE]: (220, 110, 40)}
_BIT_SET, _BIT_CLEAR = (90, 220, 90), (190, 90, 235)
# the pattern on a robot: radii of the team's dot and of the number's dots, and places (ahead, left) of the latter
_TEAM_DOT_M, _NUMBER_DOT_M = 0.025, 0.020
_DOTS_M = ((0.035, 0.055), (0.035, -0.055), (-0.055, 0.035), (-0.055, -0.035))
_OUTLINE = np.linspace(0.0, math.tau, 24, endpoint=False)
_FRONT_RAD = math.acos(0.075 / 0.09)
_NOISE_STD, _BLUR_PX = 3.0, 0.6


@dataclass(frozen=True, slots=True)
class OverheadCamera:
    """One overhead camera, as its calibration describes it."""

    camera_id: int
    #: position, field frame
    x_m: float
    y_m: float
    z_m: float
    #: half the size of the rectangle of floor that it covers
    half_x_m: float
    half_y_m: float

    @property
    def focal_length_px(self) -> float:
        """Focal length at which the covered rectangle fits into the image."""
        return self.z_m * min(SIZE_PX[0] / 2 / self.half_x_m, SIZE_PX[1] / 2 / self.half_y_m)

    def covers(self, x_m: float, y_m: float) -> bool:
        """Return whether a point of the floor is in the camera's rectangle."""
        return abs(x_m - self.x_m) <= self.half_x_m and abs(y_m - self.y_m) <= self.half_y_m

    def pixel(self, x_m: float, y_m: float, z_m: float = 0.0) -> tuple[float, float]:
        """Return the pixel (u, v) of a point of the field frame."""
        scale = self.focal_length_px / (self.z_m - z_m)
        return SIZE_PX[0] / 2 + (x_m - self.x_m) * scale, SIZE_PX[1] / 2 - (y_m - self.y_m) * scale

    def on_floor(self, x_m: float, y_m: float, z_m: float) -> tuple[float, float]:
        """Return where the camera's ray through a point above the floor meets the floor, field frame, metres."""
        stretch = self.z_m / (self.z_m - min(z_m, 0.9 * self.z_m))
        return self.x_m + (x_m - self.x_m) * stretch, self.y_m + (y_m - self.y_m) * stretch

    @property
    def calibration(self) -> CameraCalibration:
        """The calibration that a vision system publishes: turned by pi about x, so that it looks down."""
        return CameraCalibration(
            camera_id=self.camera_id,
            focal_length_px=self.focal_length_px,
            principal_x_px=SIZE_PX[0] / 2,
            principal_y_px=SIZE_PX[1] / 2,
            distortion=0.0,
            q_x=1.0,
            q_y=0.0,
            q_z=0.0,
            q_w=0.0,
            t_x_m=-self.x_m,
            t_y_m=self.y_m,
            t_z_m=self.z_m,
            camera_x_m=self.x_m,
            camera_y_m=self.y_m,
            camera_z_m=self.z_m,
            width_px=SIZE_PX[0],
            height_px=SIZE_PX[1],
        )


def camera_rig(field: Field, columns: int, rows: int, overlap_m: float) -> tuple[OverheadCamera, ...]:
    """Return cameras over equal parts of a field and its boundary, row by row from the corner at -x and -y.

    Columns are along x, rows along y; two neighbours both see a strip of width `overlap_m`.
    """
    reach_x_m, reach_y_m = abs(field.floor_polygon).max(axis=0).tolist()
    step_x_m, step_y_m = 2 * reach_x_m / columns, 2 * reach_y_m / rows
    # high enough that no camera needs a wide lens
    height_m = max(HEIGHT_M, math.hypot(step_x_m, step_y_m) / 2)
    return tuple(
        OverheadCamera(
            row * columns + column,
            -reach_x_m + (column + 0.5) * step_x_m,
            -reach_y_m + (row + 0.5) * step_y_m,
            height_m,
            (step_x_m + overlap_m) / 2,
            (step_y_m + overlap_m) / 2,
        )
        for row in range(rows)
        for column in range(columns)
    )


@dataclass(frozen=True, slots=True)
class Mounting:
    """The difference of a camera's true pose from its calibration."""

    shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: error of its position, field frame
    rotation_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: small turns about the field's axes


@dataclass(frozen=True, slots=True)
class BallImage:
    """The ball in an image: mean and number of its visible pixels, and the visible ratio."""

    u_px: float
    v_px: float
    area_px: int
    visible_ratio: float


class OverheadView:
    """Draws what one camera sees."""

    def __init__(self, field: Field, camera: OverheadCamera, mounting: Mounting = Mounting()) -> None:
        self._field, self.camera, self.mounting = field, camera, mounting
        roll, pitch, yaw = mounting.rotation_rad
        turn = cv2.Rodrigues(np.array([roll, pitch, yaw]))[0]
        # field to camera: x to the right, y down in the image, z along the view
        down = np.diag([1.0, -1.0, -1.0])
        self._rotation: FloatArray = np.asarray(down @ turn.T, dtype=np.float64)
        shift = np.array(mounting.shift_m)
        self._position: FloatArray = np.array([camera.x_m, camera.y_m, camera.z_m]) + shift
        self._rows: list[list[float]] = self._rotation.tolist()
        self._place: list[float] = self._position.tolist()
        self._background: UInt8Array | None = None

    def project(self, points_m: FloatArray) -> FloatArray:
        """Project points (N, 3) of the field frame into the image: (N, 2) pixels."""
        seen = (points_m - self._position) @ self._rotation.T
        scale = self.camera.focal_length_px / np.maximum(seen[:, 2], 1e-6)
        return np.asarray(seen[:, :2] * scale[:, None] + np.array(SIZE_PX) / 2)

    def pixel(self, x_m: float, y_m: float, z_m: float) -> tuple[float, float]:
        """Project one point into the image: a faster `project`."""
        px, py, pz = self._place
        dx, dy, dz = x_m - px, y_m - py, z_m - pz
        (a, b, c), (d, e, f), (g, h, i) = self._rows
        scale = self.camera.focal_length_px / max(g * dx + h * dy + i * dz, 1e-6)
        return (a * dx + b * dy + c * dz) * scale + SIZE_PX[0] / 2, (d * dx + e * dy + f * dz) * scale + SIZE_PX[1] / 2

    def on_field(self, u_px: float, v_px: float, z_m: float) -> tuple[float, float]:
        """Return the point (x, y), field frame, of a pixel on the plane at height `z_m`, by the calibration."""
        camera = self.camera
        scale = (camera.z_m - z_m) / camera.focal_length_px
        return camera.x_m + (u_px - SIZE_PX[0] / 2) * scale, camera.y_m - (v_px - SIZE_PX[1] / 2) * scale

    def ball(self, state: LeagueState) -> BallImage | None:
        """Return the visible part of the ball, which robots may hide; None if nothing of it is visible."""
        center, radius_px = self._ball_circle(state)
        half = math.ceil(radius_px) + 3
        left, top = math.floor(center[0]) - half, math.floor(center[1]) - half
        if not (-half < left + half < SIZE_PX[0] + half and -half < top + half < SIZE_PX[1] + half):
            return None
        mask = np.zeros((2 * half + 1, 2 * half + 1), np.uint8)
        at = center - (left, top)
        _disc(mask, at, radius_px, 1)
        whole = int(mask.sum())
        ball, robots = state.ball, state.robots
        if ball.z_m + self._field.ball_radius_m < max((robot.height_m for robot in robots), default=0.0):
            for robot in robots:
                # the robot's silhouette on the floor does not reach farther than this
                lean = robot.height_m / max(self.camera.z_m - robot.height_m, 0.1)
                far = math.hypot(robot.pose.x_m - self.camera.x_m, robot.pose.y_m - self.camera.y_m) * lean + 0.3
                if math.hypot(robot.pose.x_m - ball.x_m, robot.pose.y_m - ball.y_m) < far:
                    _polygon(mask, self._silhouette(robot) - (left, top), 0)
        # pixels outside the image are not visible
        mask[:, : max(-left, 0)] = mask[: max(-top, 0)] = 0
        mask[:, max(SIZE_PX[0] - left, 0) :] = mask[max(SIZE_PX[1] - top, 0) :] = 0
        rows, columns = np.nonzero(mask)
        if not len(rows):
            return None
        return BallImage(
            left + float(columns.mean()), top + float(rows.mean()), len(rows), min(len(rows) / max(whole, 1), 1.0)
        )

    def render(self, state: LeagueState, rng: np.random.Generator) -> UInt8Array:
        """Return the camera's image: (H, W, 3) uint8, BGR."""
        if self._background is None:
            self._background = self._draw_field()
        image = self._background.copy()
        flies = state.ball.z_m > max((robot.height_m for robot in state.robots), default=0.0)
        if not flies:
            _disc(image, *self._ball_circle(state), _BALL)
        for robot in state.robots:
            self._draw_robot(image, robot)
        if flies:
            _disc(image, *self._ball_circle(state), _BALL)
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), _BLUR_PX), dtype=np.uint8)
        noise = rng.standard_normal(image.shape, dtype=np.float32) * np.float32(_NOISE_STD)
        return np.clip(image + noise, 0, 255).astype(np.uint8)

    def _draw_field(self) -> UInt8Array:
        field = self._field
        image = np.full((SIZE_PX[1], SIZE_PX[0], 3), _BEYOND, np.uint8)
        _polygon(image, self.project(_raised(field.floor_polygon, 0.0)), _CARPET)
        width = field.line_width_m / 2
        for x0, y0, x1, y1 in field.lines.tolist():
            length = math.hypot(x1 - x0, y1 - y0)
            ax, ay = width * (x1 - x0) / length, width * (y1 - y0) / length
            corners = [
                (x0 - ax - ay, y0 - ay + ax),
                (x1 + ax - ay, y1 + ay + ax),
                (x1 + ax + ay, y1 + ay - ax),
                (x0 - ax + ay, y0 - ay - ax),
            ]
            _polygon(image, self.project(_raised(np.array(corners), 0.0)), _LINE)
        for x, y, radius, start, sweep in field.arcs.tolist():
            angles = start + np.linspace(0.0, sweep, 97)
            for a, b in itertools.pairwise(angles.tolist()):
                piece = [
                    (x + r * math.cos(angle), y + r * math.sin(angle))
                    for r, angle in ((radius - width, a), (radius + width, a), (radius + width, b), (radius - width, b))
                ]
                _polygon(image, self.project(_raised(np.array(piece), 0.0)), _LINE)
        for goal in field.goals:
            if goal.kind == "panels":
                for x0, y0, x1, y1 in goal.panels.tolist():
                    wall = np.array([[x0, y0, 0.0], [x1, y1, 0.0], [x1, y1, goal.height_m], [x0, y0, goal.height_m]])
                    _polygon(image, self.project(wall), _LINE)
        return image

    def _draw_robot(self, image: UInt8Array, robot: RobotState) -> None:
        _polygon(image, self._silhouette(robot), _SIDE)
        _polygon(image, self.project(_outline(robot, robot.height_m)), _TOP)
        dots = [((0.0, 0.0), _TEAM_DOT_M, _SIDES[robot.side])]
        dots += [
            (place, _NUMBER_DOT_M, _BIT_SET if robot.number >> bit & 1 else _BIT_CLEAR)
            for bit, place in enumerate(_DOTS_M)
        ]
        scale = self.camera.focal_length_px / (self._position[2] - robot.height_m)
        for place, radius_m, color in dots:
            x, y = robot.pose.transform(place).tolist()
            _disc(image, np.array(self.pixel(x, y, robot.height_m)), radius_m * scale, color)

    def _ball_circle(self, state: LeagueState) -> tuple[FloatArray, float]:
        ball, radius_m = state.ball, self._field.ball_radius_m
        height = min(ball.z_m + radius_m, 0.9 * float(self._position[2]))
        center = np.array(self.pixel(ball.x_m, ball.y_m, height))
        return center, radius_m * self.camera.focal_length_px / float(self._position[2] - height)

    def _silhouette(self, robot: RobotState) -> FloatArray:
        """Return the outline (N, 2) of a robot in the image, pixels: the convex hull of its foot and its top."""
        both = self.project(np.concatenate([_outline(robot, 0.0), _outline(robot, robot.height_m)]))
        hull = cv2.convexHull(both.astype(np.float32))
        return np.asarray(hull[:, 0], dtype=np.float64)


def camera_mounting(rng: np.random.Generator, position_std_m: float, rotation_std_rad: float) -> Mounting:
    """Draw the pose error of a camera, given its standard deviations along and about each axis."""
    x, y, z, roll, pitch, yaw = (rng.standard_normal(6) * ([position_std_m] * 3 + [rotation_std_rad] * 3)).tolist()
    return Mounting((x, y, z), (roll, pitch, yaw))


def _outline(robot: RobotState, z_m: float) -> FloatArray:
    """Return a robot's outline (N, 3) at a height, field frame: a disc cut off at its flat front."""
    along = np.minimum(np.cos(_OUTLINE), math.cos(_FRONT_RAD)) * robot.radius_m
    aside = np.sin(_OUTLINE) * robot.radius_m
    return _raised(robot.pose.transform(np.stack([along, aside], axis=1)), z_m)


def _raised(points_m: FloatArray, z_m: float) -> FloatArray:
    return np.column_stack([points_m, np.full(len(points_m), z_m)])


def _polygon(image: UInt8Array, corners_px: FloatArray, color: tuple[int, int, int] | int) -> None:
    cv2.fillConvexPoly(image, np.rint(corners_px * _SUB).astype(np.int32), color, shift=_SHIFT)


def _disc(image: UInt8Array, center_px: FloatArray, radius_px: float, color: tuple[int, int, int] | int) -> None:
    center = round(float(center_px[0]) * _SUB), round(float(center_px[1]) * _SUB)
    # OpenCV also fills the pixels that the disc's edge touches, so the radius is reduced
    cv2.circle(image, center, round((radius_px - 0.4) * _SUB), color, cv2.FILLED, shift=_SHIFT)
