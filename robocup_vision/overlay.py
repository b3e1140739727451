"""Draws a view over its frame: what the robot sees."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from functools import lru_cache
from typing import cast

import cv2
import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, Frame, Int32Array, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import EdgePoints, EdgeState, NotLocated
from robocup_vision.image_layers import ImageLayerMaker, Paths, marking_paths
from robocup_vision.pipeline.frames import to_bgr
from robocup_vision.view import RigView, View
from robocup_vision.vision import Vision

Bgr = tuple[int, int, int]

FIELD_COLOR: Bgr = (255, 255, 0)
BOUNDARY_COLOR: Bgr = (40, 40, 255)
FREE_COLOR: Bgr = (120, 255, 120)
OBSTACLE_COLOR: Bgr = (0, 160, 255)
BALL_COLOR: Bgr = (255, 0, 255)
MARKING_COLOR: Bgr = (255, 90, 160)
LINE_POINT_COLOR: Bgr = (255, 160, 60)
EDGE_COLORS: dict[EdgeState, Bgr] = {
    EdgeState.FOUND: (60, 230, 60),
    EdgeState.HIDDEN: (150, 150, 150),
    EdgeState.MISSING: (0, 220, 255),
}

# smaller pictures are enlarged, so that thin lines and the text stay readable
_MIN_WIDTH = 640
_SHIFT = 4
# number of letters that fit into a line
_REASON_LETTERS = 72


def draw(
    view: View,
    frame: Frame | Sequence[Frame | None],
    vision: Vision,
    out: Frame | None = None,
    *,
    markings: bool = False,
) -> UInt8Array:
    """Draw a view over its frame.

    The fitted field and its goals of posts are drawn in cyan, the floor boundary in red, the free space as a green fan,
    obstacles in orange, the ball in magenta, and the pose with its standard deviations as text. Method "edges" adds
    dots where edges of the field were predicted: green found, grey hidden, yellow missing.

    Parameters
    ----------
    view : View
        The view that `vision` returned.
    frame : (H, W, 3) uint8
        Its frame, with the channel order of `vision`; for a rig the frames, whose pictures are put side by side.
    vision : Vision
        The object that returned the view.
    out : (s H, s W, 3) uint8, optional
        The BGR picture to draw on: the frame itself, or a picture that is an integer factor s larger.
    markings : bool
        Whether to draw the view's markings, too, in violet; they are computed for this.

    Returns
    -------
    (s H, s W, 3) uint8
        `out`, or a new BGR picture, an integer factor s larger than the frame.

    Raises
    ------
    ArgumentError
        If the view or the frame has the wrong type, or `out` cannot be drawn on.
    """
    if not isinstance(view, View) or not isinstance(vision, Vision):
        kinds = ", ".join(type(value).__name__ for value in (view, frame, vision))
        raise ArgumentError(f"draw takes a view, its frame and the Vision that looked, got {kinds}")
    if isinstance(view, RigView):
        return _draw_rig(view, frame, vision, out, markings)
    width, height = view.camera.size_px
    if not isinstance(frame, np.ndarray) or frame.shape != (height, width, 3) or frame.dtype != np.uint8:
        given = getattr(frame, "shape", type(frame).__name__)
        raise ArgumentError(f"the frame to draw must be ({height}, {width}, 3) uint8, got {given}")
    if out is None:
        scale = max(1, math.ceil(_MIN_WIDTH / width))
        plain = to_bgr(cast("UInt8Array", frame), vision.channels)
        enlarged = cv2.resize(plain, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
        canvas: UInt8Array = np.asarray(enlarged, dtype=np.uint8)
        canvas = canvas.copy() if np.shares_memory(canvas, frame) else canvas
    else:
        canvas, scale = cast("UInt8Array", out), _scale_of(out, width, height)
    # markings must be found before the frame, which may be `out`, is drawn on
    paths = marking_paths(view) if markings else ()
    draw_layers(view, canvas, vision, scale)
    _draw_paths(canvas, paths, scale, MARKING_COLOR, 2)
    _write(canvas, _summary(view))
    return canvas


def _draw_rig(view: RigView, frames: object, vision: Vision, out: Frame | None, markings: bool) -> UInt8Array:
    """Draw the pictures of a rig's cameras side by side, dark where a camera gave no frame."""
    count = len(view.views)
    if out is not None or not isinstance(frames, (tuple, list)) or len(frames) != count:
        raise ArgumentError(
            f"draw takes the {count} frames of a rig's view and no out; draw(view.views[0], ...) is for one"
        )
    pictures = []
    for one, frame in zip(view.views, frames, strict=True):
        width, height = one.camera.size_px
        dark = np.zeros((height, width, 3), dtype=np.uint8)
        pictures.append(draw(one, dark if frame is None else frame, vision, markings=markings))
    height = max(len(picture) for picture in pictures)
    return np.hstack([np.pad(picture, ((0, height - len(picture)), (0, 0), (0, 0))) for picture in pictures])


def draw_layers(view: View, canvas: UInt8Array, vision: Vision, scale: int = 1) -> None:
    """Draw as `draw` does, but without text and checks, on a BGR picture `scale` times as large as the frame."""
    layers = _layer_maker(vision.field).layers(view)
    _draw_free_space(canvas, layers.free_px, scale)
    _draw_paths(canvas, layers.field_px, scale, FIELD_COLOR)
    if isinstance(view.camera, PinholeCamera):
        # in a mirror camera's frame, the walls of goals are already drawn as walls of the field
        _draw_paths(canvas, layers.goals_px, scale, FIELD_COLOR, 2)
    for points, color in ((layers.lines_px, LINE_POINT_COLOR), (layers.edge_px, BOUNDARY_COLOR)):
        _draw_dots(canvas, points, scale, color)
    if view.edge_points is not None:
        _draw_edge_points(canvas, view.edge_points, scale)
    _draw_paths(canvas, layers.obstacles_px, scale, OBSTACLE_COLOR, 2)
    _draw_paths(canvas, layers.ball_px, scale, BALL_COLOR, 2)


def _draw_edge_points(canvas: UInt8Array, points: EdgePoints, scale: int) -> None:
    for state, color in EDGE_COLORS.items():
        _draw_dots(canvas, points.pixels[points.state == state], scale, color)


def _draw_dots(canvas: UInt8Array, points_px: FloatArray, scale: int, color: Bgr) -> None:
    for place in _fixed(points_px, scale).tolist():
        cv2.circle(canvas, place, 2 << _SHIFT, color, -1, cv2.LINE_AA, _SHIFT)


def _draw_free_space(canvas: UInt8Array, outline_px: FloatArray, scale: int) -> None:
    if not len(outline_px):  # no point of the outline is in the picture
        return
    shape = _fixed(outline_px, scale)
    # only the part of the picture with the fan is copied and tinted
    width, height = canvas.shape[1::-1]
    (left, top), (right, bottom) = (shape.min(axis=0) >> _SHIFT).tolist(), (shape.max(axis=0) >> _SHIFT).tolist()
    left, top = max(left - 2, 0), max(top - 2, 0)
    part = canvas[top : min(bottom + 3, height), left : min(right + 3, width)]
    if part.size:
        tint = part.copy()
        inside = shape - np.array([left << _SHIFT, top << _SHIFT], dtype=np.int32)
        cv2.fillPoly(tint, [inside], FREE_COLOR, cv2.LINE_AA, _SHIFT)
        part[...] = cv2.addWeighted(tint, 0.25, part, 0.75, 0.0)
    cv2.polylines(canvas, [shape], True, FREE_COLOR, 1, cv2.LINE_AA, _SHIFT)


def _draw_paths(canvas: UInt8Array, paths: Paths, scale: int, color: Bgr, thickness: int = 1) -> None:
    if paths:
        cv2.polylines(canvas, [_fixed(path, scale) for path in paths], False, color, thickness, cv2.LINE_AA, _SHIFT)


def _fixed(points_px: FloatArray, scale: int) -> Int32Array:
    """Return points (N, 2) in OpenCV's fixed-point format, in pixels of the enlarged picture."""
    # pixel centres are at integers, also in the enlarged picture
    return np.rint(((points_px + 0.5) * scale - 0.5) * (1 << _SHIFT)).astype(np.int32)


@lru_cache(maxsize=8)
def _layer_maker(field: Field) -> ImageLayerMaker:
    return ImageLayerMaker(field)


def _scale_of(out: Frame, width: int, height: int) -> int:
    """Return the factor by which a picture is larger than the frame.

    Raises
    ------
    ArgumentError
        If it is not an integer, or the picture cannot be drawn on.
    """
    if not isinstance(out, np.ndarray) or out.dtype != np.uint8 or out.ndim != 3:
        raise ArgumentError(f"out must be a (s H, s W, 3) uint8 array, got {type(out).__name__}")
    scale = int(out.shape[1]) // width
    if scale < 1 or out.shape != (scale * height, scale * width, 3):
        raise ArgumentError(f"out must be a whole number times ({height}, {width}, 3), got {out.shape}")
    if not (out.flags.writeable and out.flags.c_contiguous):
        raise ArgumentError("out must be writeable and contiguous: a copy of it is")
    return scale


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
    # the part of the picture down to the rim of the last line
    canvas = canvas[: round((18 * len(lines) + 12) * size)]
    letters = np.zeros(canvas.shape[:2], dtype=np.uint8)
    for row, text in enumerate(lines):
        place = (round(6 * size), round((18 + 18 * row) * size))
        cv2.putText(letters, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.47 * size, 255, 1, cv2.LINE_AA)
    # the dark rim is dilated from the letters, since a thicker pen changes their spacing in some versions of OpenCV
    rim = np.asarray(cv2.dilate(letters, np.ones((5, 5), dtype=np.uint8)), dtype=np.uint8)
    cv2.min(canvas, cv2.merge([cv2.bitwise_not(rim)] * 3), canvas)
    cv2.max(canvas, cv2.merge([letters] * 3), canvas)
