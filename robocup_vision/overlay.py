"""The overlay a team wants in its first hour: what the robot sees, drawn over the frame it saw it in."""

from __future__ import annotations

import math
import textwrap

import cv2
import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated
from robocup_vision.vision import View, Vision

Bgr = tuple[int, int, int]

FIELD_COLOR: Bgr = (255, 255, 0)
BOUNDARY_COLOR: Bgr = (40, 40, 255)
FREE_COLOR: Bgr = (120, 255, 120)
OBSTACLE_COLOR: Bgr = (0, 160, 255)
BALL_COLOR: Bgr = (255, 0, 255)
LINE_POINT_COLOR: Bgr = (255, 160, 60)

# smaller pictures are enlarged, so that thin lines and the text stay readable
_MIN_WIDTH = 640
_SHIFT = 4
# as many letters as fit beside one another
_REASON_LETTERS = 72


def draw(view: View, frame: UInt8Array, vision: Vision) -> UInt8Array:
    """Draw a view over its frame.

    The fitted field and its goals of posts in cyan, the floor's detected edge in red, the free space as a green fan,
    obstacles in orange, the ball in magenta, and the pose with its standard deviations as text.

    Parameters
    ----------
    view : View
        What `vision` saw.
    frame : (H, W, 3) uint8
        In this frame.
    vision : Vision
        The object that looked.

    Returns
    -------
    (s H, s W, 3) uint8
        A new picture, a whole number s times as large as the frame.
    """
    scale = max(1, math.ceil(_MIN_WIDTH / frame.shape[1]))
    enlarged = cv2.resize(frame, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
    canvas: UInt8Array = np.asarray(enlarged, dtype=np.uint8)
    _draw_free_space(canvas, view, vision, scale)
    if view.pose:
        to_robot = view.pose.pose.inverse()
        for line in _field_outlines(vision):
            pixels = view.camera.floor_to_pixel(to_robot.transform(line))
            _draw_path(canvas, pixels, vision, scale, FIELD_COLOR)
        for path in _goal_outlines(vision) if isinstance(view.camera, PinholeCamera) else ():
            points = np.column_stack([to_robot.transform(path[:, :2]), path[:, 2]])
            _draw_path(canvas, view.camera.point_to_pixel(points), vision, scale, FIELD_COLOR, 2)
    for points, color in ((view.line_points_px, LINE_POINT_COLOR), (view.boundary_px, BOUNDARY_COLOR)):
        for u, v in points[np.isfinite(points).all(axis=1)]:
            cv2.circle(canvas, _fixed(u, v, scale), 2 << _SHIFT, color, -1, cv2.LINE_AA, _SHIFT)
    camera = vision.camera if view.polar is None else view.polar.camera
    for obstacle in view.obstacles:
        across = np.array([-math.sin(obstacle.bearing_rad), math.cos(obstacle.bearing_rad)]) * obstacle.width_m / 2
        middle = np.array([obstacle.x_m, obstacle.y_m])
        ends = middle + np.linspace(-1.0, 1.0, 7)[:, None] * across
        _draw_path(canvas, camera.floor_to_pixel(ends), vision, scale, OBSTACLE_COLOR, 2)
    if view.ball is not None:
        angle = np.linspace(0.0, math.tau, 25)
        rim = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=1) * vision.field.ball_radius_m
        # about its centre where the camera's height is known, else as if it lay flat on the floor
        rim[:, 2] *= camera.height_m is not None
        pixels = camera.point_to_pixel(rim + np.array([view.ball.x_m, view.ball.y_m, 0.0]))
        _draw_path(canvas, pixels, vision, scale, BALL_COLOR, 2)
    _write(canvas, _summary(view))
    return canvas


def _field_outlines(vision: Vision) -> list[FloatArray]:
    field = vision.field
    spacing = max(field.length_m, field.width_m) / 100
    paths = []
    for x0, y0, x1, y1 in np.vstack([field.lines, field.walls] if field.is_bounded else [field.lines]):
        count = max(2, math.ceil(math.hypot(x1 - x0, y1 - y0) / spacing))
        paths.append(np.linspace([x0, y0], [x1, y1], count))
    for x, y, radius, start, sweep in field.arcs:
        angles = start + np.linspace(0.0, sweep, max(8, math.ceil(abs(sweep) * radius / spacing)))
        paths.append(np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1))
    return paths


def _goal_outlines(vision: Vision) -> list[FloatArray]:
    """Axes (N, 3) of posts and bars."""
    paths = []
    for goal in vision.field.goals:
        if goal.kind != "posts":
            continue
        x, half, up = goal.line_x_m, goal.width_m / 2, goal.height_m
        rise, across = np.linspace(0.0, up, 9), np.linspace(-half, half, 17)
        left, right = (np.column_stack([np.full(9, x), np.full(9, y), rise]) for y in (half, -half))
        bar = np.column_stack([np.full(17, x), across, np.full(17, up)])
        paths.append(np.vstack([right, bar, left[::-1]]))
    return paths


def _draw_free_space(canvas: UInt8Array, view: View, vision: Vision, scale: int) -> None:
    bearing, range_m = view.free_space.bearing_rad, view.free_space.range_m
    if view.polar is None or view.grid is None:
        return
    half = view.polar.span_rad[1] / 2 / len(bearing)
    inner = view.grid.ring_bounds_m[0]
    corners = []
    for b, r in zip(bearing, range_m, strict=True):
        turn = b + np.linspace(-half, half, 4)
        corners.append(np.stack([max(r, inner) * np.cos(turn), max(r, inner) * np.sin(turn)], axis=1))
    if not view.polar.is_ring:
        # back along the nearest floor in view
        corners += [inner * np.array([[math.cos(b), math.sin(b)]]) for b in bearing[::-1]]
    pixels = view.polar.camera.floor_to_pixel(np.vstack(corners))
    pixels = pixels[np.isfinite(pixels).all(axis=1)]
    shape = np.array([_fixed(u, v, scale) for u, v in pixels], dtype=np.int32).reshape(-1, 2)
    if not len(shape):  # a table that ends before the free floor does
        return
    tint = canvas.copy()
    cv2.fillPoly(tint, [shape], FREE_COLOR, cv2.LINE_AA, _SHIFT)
    cv2.addWeighted(tint, 0.25, canvas, 0.75, 0.0, canvas)
    cv2.polylines(canvas, [shape], True, FREE_COLOR, 1, cv2.LINE_AA, _SHIFT)


def _draw_path(
    canvas: UInt8Array, pixels: FloatArray, vision: Vision, scale: int, color: Bgr, thickness: int = 1
) -> None:
    if isinstance(vision.camera, PinholeCamera):
        # what lies far outside the picture need not be drawn, nor fit into OpenCV's numbers
        off_px = np.abs(pixels - vision.camera.center_px)
        shown = (off_px[:, 0] < vision.camera.size_px[0]) & (off_px[:, 1] < vision.camera.size_px[1])
    else:
        radius = np.hypot(*(pixels - vision.camera.center_px).T)
        shown = radius <= vision.camera.usable_radius_px[1] * 1.05
    for i in np.flatnonzero(shown[:-1] & shown[1:]):
        (u0, v0), (u1, v1) = pixels[i : i + 2]
        cv2.line(canvas, _fixed(u0, v0, scale), _fixed(u1, v1, scale), color, thickness, cv2.LINE_AA, _SHIFT)


def _fixed(u: float, v: float, scale: int) -> tuple[int, int]:
    # pixel centres at integers, also in the enlarged picture
    unit = 1 << _SHIFT
    return round(((u + 0.5) * scale - 0.5) * unit), round(((v + 0.5) * scale - 0.5) * unit)


def _summary(view: View) -> list[str]:
    if isinstance(view.pose, NotLocated):
        return ["not located:", *textwrap.wrap(view.pose.reason, _REASON_LETTERS)]
    pose, std = view.pose.pose, view.pose.std
    both = "  or its half turn" if len(view.pose.candidates) > 1 else ""
    return [
        f"x {pose.x_m:+.3f} m  y {pose.y_m:+.3f} m  {math.degrees(pose.theta_rad):+.1f} deg{both}",
        f"+- {std[0] * 1e3:.1f} mm  {std[1] * 1e3:.1f} mm  {math.degrees(std[2]):.2f} deg  "
        f"{view.pose.inlier_ratio:.0%} agree",
    ]


def _write(canvas: UInt8Array, lines: list[str]) -> None:
    size = canvas.shape[1] / _MIN_WIDTH
    letters = np.zeros(canvas.shape[:2], dtype=np.uint8)
    for row, text in enumerate(lines):
        place = (round(6 * size), round((18 + 18 * row) * size))
        cv2.putText(letters, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.47 * size, 255, 1, cv2.LINE_AA)
    # a thicker pen would move the letters apart in some versions of OpenCV, so the dark rim is grown from them
    rim = np.asarray(cv2.dilate(letters, np.ones((5, 5), dtype=np.uint8)), dtype=np.uint8)
    np.minimum(canvas, 255 - rim[..., None], out=canvas)
    np.maximum(canvas, letters[..., None], out=canvas)
