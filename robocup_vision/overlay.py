"""The overlay a team wants in its first hour: what the robot sees, drawn over the frame it saw it in."""

from __future__ import annotations

import math
import textwrap
from itertools import pairwise

import cv2
import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import EdgePoints, EdgeState, NotLocated
from robocup_vision.image_layers import ImageLayerMaker, Paths
from robocup_vision.vision import View, Vision

Bgr = tuple[int, int, int]

FIELD_COLOR: Bgr = (255, 255, 0)
BOUNDARY_COLOR: Bgr = (40, 40, 255)
FREE_COLOR: Bgr = (120, 255, 120)
OBSTACLE_COLOR: Bgr = (0, 160, 255)
BALL_COLOR: Bgr = (255, 0, 255)
LINE_POINT_COLOR: Bgr = (255, 160, 60)
EDGE_COLORS: dict[EdgeState, Bgr] = {
    EdgeState.FOUND: (60, 230, 60),
    EdgeState.HIDDEN: (150, 150, 150),
    EdgeState.MISSING: (0, 220, 255),
}

# smaller pictures are enlarged, so that thin lines and the text stay readable
_MIN_WIDTH = 640
_SHIFT = 4
# as many letters as fit beside one another
_REASON_LETTERS = 72


def draw(view: View, frame: UInt8Array, vision: Vision) -> UInt8Array:
    """Draw a view over its frame.

    The fitted field and its goals of posts in cyan, the floor's detected edge in red, the free space as a green fan,
    obstacles in orange, the ball in magenta, and the pose with its standard deviations as text. Method "edges" adds
    dots where edges of the field were predicted: green found, grey hidden, yellow missing.

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
    layers = ImageLayerMaker(vision.field).layers(view)
    _draw_free_space(canvas, layers.free_px, scale)
    _draw_paths(canvas, layers.field_px, scale, FIELD_COLOR)
    if isinstance(view.camera, PinholeCamera):
        # the walls of a goal in a mirror camera's frame are walls of the field
        _draw_paths(canvas, layers.goals_px, scale, FIELD_COLOR, 2)
    for points, color in ((layers.lines_px, LINE_POINT_COLOR), (layers.edge_px, BOUNDARY_COLOR)):
        for u, v in points:
            cv2.circle(canvas, _fixed(u, v, scale), 2 << _SHIFT, color, -1, cv2.LINE_AA, _SHIFT)
    if view.edge_points is not None:
        _draw_edge_points(canvas, view.edge_points, scale)
    _draw_paths(canvas, layers.obstacles_px, scale, OBSTACLE_COLOR, 2)
    _draw_paths(canvas, layers.ball_px, scale, BALL_COLOR, 2)
    _write(canvas, _summary(view))
    return canvas


def _draw_edge_points(canvas: UInt8Array, points: EdgePoints, scale: int) -> None:
    for state, color in EDGE_COLORS.items():
        for u, v in points.pixels[points.state == state]:
            cv2.circle(canvas, _fixed(u, v, scale), 2 << _SHIFT, color, -1, cv2.LINE_AA, _SHIFT)


def _draw_free_space(canvas: UInt8Array, outline_px: FloatArray, scale: int) -> None:
    if not len(outline_px):  # a table that ends before the free floor does
        return
    shape = np.array([_fixed(u, v, scale) for u, v in outline_px], dtype=np.int32)
    tint = canvas.copy()
    cv2.fillPoly(tint, [shape], FREE_COLOR, cv2.LINE_AA, _SHIFT)
    cv2.addWeighted(tint, 0.25, canvas, 0.75, 0.0, canvas)
    cv2.polylines(canvas, [shape], True, FREE_COLOR, 1, cv2.LINE_AA, _SHIFT)


def _draw_paths(canvas: UInt8Array, paths: Paths, scale: int, color: Bgr, thickness: int = 1) -> None:
    for path in paths:
        for (u0, v0), (u1, v1) in pairwise(path):
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
