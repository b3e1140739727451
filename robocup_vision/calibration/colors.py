"""Calibration of colours from unlabelled images of the field: floor, white paint, ball and goals.

The floor is learnt in each frame as by `Vision`, and the frames' median is used, which is robust against a few frames
with a robot in front of the lens. Coloured objects are searched near their projected places (a goal, if the pose is
known) or everywhere (the ball), by the colour in the field file adapted to the light on white paint. The median of
their pixels is the result.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from field_models.errors import FrameError
from field_models.field import Field, Goal
from robocup_vision.arrays import BoolArray, FloatArray, Int64Array, UInt8Array, read_only
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.color_table import Colors, build_color_table, colors_for, learn_colors
from robocup_vision.perception.floor_color import LEVELS, FloorColor, PaintColor
from robocup_vision.perception.floor_view import FloorView, sees_floor
from robocup_vision.perception.polar_view import PolarView, hidden_pixels
from robocup_vision.vision import Vision

COLORED = ("ball", "goal_positive_x", "goal_negative_x")
# sampling grid of a picture without a camera file, about that of a floor view
_ROWS = 120
_COLUMNS = 150
# greatest difference, in log ratios, of a frame's floor from the frames' median
_MAX_FLOOR_DIFFERENCE = 0.35
# greatest distance, in log ratios, of an object's colour from the named one under this light
_MAX_COLOR_DISTANCE = 0.6
_MIN_LEVEL = 0.35  # least brightness relative to the floor's, above which hue is reliable
_MIN_PIXELS = 30  # least number of pixels to determine an object's colour
# least ratio of an object's pixels that are surrounded by others of it, as clutter is not compact
_MIN_INNER_RATIO = 0.3
_SPACING_M = 0.02  # spacing of projected points on goals and lines
_MAX_SPREAD = 0.15  # greatest spread of the floor's colour; a wider one would include other objects
_MIN_LINE_LEVEL = 1.2  # least brightness of painted lines relative to the floor
_MIN_LINE_WIDTH_PX = 4.0  # least width of a line whose middle pixels are pure paint


@dataclass(frozen=True)
class ColorCalibration:
    """Colours learnt from images, the result of `calibrate_colors`."""

    colors: Colors  #: content of a colour file
    frames: int  #: number of frames used
    #: number of pixels from which each coloured class was learnt; 0 if it was not seen and has the field file's colour
    pixels: Mapping[str, int]
    notes: tuple[str, ...] = ()  #: messages for the user


@dataclass(frozen=True, eq=False)
class _FrameColors:
    """Colours of one frame, and for each coloured class log R/G, B/G (2,) and number of pixels."""

    colors: Colors
    things: Mapping[str, tuple[FloatArray, int]]


def calibrate_colors(
    field: Field,
    frames: Iterable[tuple[str, Callable[[], UInt8Array]]],
    camera: OmniCamera | PinholeCamera | None = None,
    poses: Mapping[str, Pose2] | None = None,
    mask: UInt8Array | None = None,
) -> ColorCalibration | NotCalibrated:
    """Learn a field's colours from frames, which are read one at a time.

    Parameters
    ----------
    frames : iterable of (str, callable)
        Name of each frame, and a function that reads it: (H, W, 3) uint8 BGR. Unreadable frames are noted and left
        out.
    camera : OmniCamera or PinholeCamera, optional
        Projects the nearest floor into the picture, and with a pose the goals.
    poses : mapping of str to Pose2, optional
        Poses of the robot on the field, by the frame's name. Without one, `Vision` locates the frame if it can.
    mask : (H, W) uint8, optional
        Non-zero pixels are ignored.
    """
    observer = _FrameObserver(field, camera, mask)
    seen, notes = [], []
    for name, read in frames:
        try:
            frame = read()
        except FrameError as error:
            notes.append(f"{error}: left out")
            continue
        found = observer.look(frame, (poses or {}).get(name))
        if found is None:
            notes.append(f"{name}: too dark, or nothing of the floor in view: left out")
        else:
            seen.append(found)
    if not seen:
        return NotCalibrated("none of the images shows enough floor to learn its colour", tuple(notes))
    ratios = np.array([_beside_white(s.colors) for s in seen])
    is_odd = np.abs(ratios - np.median(ratios, axis=0)).max(axis=1) > _MAX_FLOOR_DIFFERENCE
    if is_odd.all():
        return NotCalibrated("the images do not agree on the floor's colour", tuple(notes))
    if is_odd.any():
        notes.append(f"{int(is_odd.sum())} of {len(seen)} images show another floor than the rest: left out")
    used = [s for s, odd in zip(seen, is_odd, strict=True) if not odd]
    floor = _median_floor([s.colors.floor for s in used], _MAX_SPREAD)
    white = _median_paint([s.colors.line for s in used])
    colors = colors_for(field, floor, white)
    measured = {name: [s.things[name] for s in used if name in s.things] for name in COLORED}
    pixels = {name: sum(count for _, count in found) for name, found in measured.items()}
    ball, positive, negative = (
        _weighted_median(found) if found else getattr(colors, name) for name, found in measured.items()
    )
    colors = replace(colors, ball=ball, goal_positive_x=positive, goal_negative_x=negative)
    if max(_beside_white(colors)) > 0:
        notes.append("the floor found is not green: check the preview")
    return ColorCalibration(colors, len(used), pixels, tuple(notes))


class _FrameObserver:
    """Measures colours in successive frames, with or without a known camera."""

    def __init__(
        self,
        field: Field,
        camera: OmniCamera | PinholeCamera | None,
        mask: UInt8Array | None,
    ) -> None:
        self._field, self._camera, self._mask = field, camera, mask
        self._vision: Vision | None = None
        self._view: PolarView | FloorView | None = None
        if isinstance(camera, OmniCamera):
            self._vision = Vision(field, camera, mask=mask)
            self._view = self._vision.polar
        elif camera is not None and camera.known_orientation:
            self._view = FloorView(camera, mask=mask) if sees_floor(camera) else None
        self._goals = {COLORED[1 if goal.side > 0 else 2]: _goal_points(goal, _SPACING_M) for goal in field.goals}
        self._line_m = _line_points(field, _SPACING_M)

    def look(self, frame: UInt8Array, pose: Pose2 | None) -> _FrameColors | None:
        if self._view is None:
            samples, valid = _scattered(frame, self._mask)
        else:
            samples, valid = self._view.sample(frame), self._view.valid
        colors = learn_colors(samples, valid, self._field, math.log(2.0))
        if colors is None:
            return None
        poses: tuple[Pose2, ...] = () if pose is None else (pose,)
        if pose is None and self._vision is not None:
            self._vision.forget()
            estimate = self._vision.look(frame).pose
            poses = estimate.candidates if isinstance(estimate, PoseEstimate) else ()
        if poses and self._camera is not None:
            pixels = _line_pixels(self._line_m, self._camera, poses[0], frame.shape, _MIN_LINE_WIDTH_PX)
            white = _white_of(frame, pixels, colors.floor)
            colors = colors if white is None else colors_for(self._field, colors.floor, white)
        return _FrameColors(colors, self._things(frame, colors, poses))

    def _things(self, frame: UInt8Array, colors: Colors, poses: Sequence[Pose2]) -> dict[str, tuple[FloatArray, int]]:
        named = {name: getattr(colors, name) for name in COLORED}
        free = np.ones(frame.shape[:2], dtype=bool) if self._mask is None else self._mask == 0
        if self._view is not None and isinstance(self._camera, OmniCamera):
            v, u = np.mgrid[: frame.shape[0], : frame.shape[1]]
            radius = np.hypot(u - self._camera.center_px[0], v - self._camera.center_px[1])
            free &= (radius >= self._camera.usable_radius_px[0]) & (radius <= self._camera.usable_radius_px[1])
        frame = np.asarray(cv2.blur(frame, (3, 3)), dtype=np.uint8)
        b, g, r = (np.maximum(channel, 1).astype(np.float32) for channel in cv2.split(frame))
        ratio = np.stack([np.log(r / g), np.log(b / g)], axis=-1)
        is_floor = build_color_table(colors).segment(frame) == 1
        bright = ((r + 2 * g + b) / 4 > _MIN_LEVEL * colors.floor.level) & (frame.min(axis=2) < 250)
        white = _log(colors.line)
        distance = {name: np.linalg.norm(ratio - _log(paint), axis=-1) for name, paint in named.items()}
        to_white = np.linalg.norm(ratio - white, axis=-1)
        things = {}
        for name, paint in named.items():
            if np.linalg.norm(_log(paint) - white) < _MAX_COLOR_DISTANCE:
                continue  # white and black have no hue
            same = [other for other in COLORED if np.linalg.norm(_log(named[other]) - _log(paint)) < 1e-6]
            is_it = free & bright & ~is_floor & (distance[name] < _MAX_COLOR_DISTANCE) & (distance[name] < to_white)
            for other in COLORED:
                if other not in same:
                    is_it &= distance[name] <= distance[other]
            if poses and self._camera is not None and name in self._goals and (len(poses) == 1 or len(same) == 1):
                # of two poses half a turn apart, the colour selects one
                is_it &= _where(self._goals[name], self._camera, poses, is_it.shape)
            elif name in self._goals and len(same) > 1:
                continue  # without a pose goals of one colour are ambiguous, and their named colour is good enough
            core = cv2.erode(is_it.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
            count = int(np.count_nonzero(core))
            if count >= _MIN_PIXELS and count >= _MIN_INNER_RATIO * np.count_nonzero(is_it):
                things[name] = np.median(ratio[core], axis=0), count
        return things


def _scattered(frame: UInt8Array, mask: UInt8Array | None) -> tuple[UInt8Array, UInt8Array]:
    """Sample a whole picture of an unknown camera."""
    height, width = frame.shape[:2]
    rows = np.linspace(1, height - 2, _ROWS).astype(int)
    columns = np.linspace(1, width - 2, _COLUMNS).astype(int)
    golden = (np.arange(_COLUMNS) * 0.6180339887) % 1.0
    columns = columns[np.argsort(golden)]
    blurred = np.asarray(cv2.blur(frame, (3, 3)), dtype=np.uint8)
    valid = np.ones((_ROWS, _COLUMNS), dtype=np.uint8)
    if mask is not None:
        valid = (hidden_pixels(mask)[np.ix_(rows, columns)] == 0).astype(np.uint8)
    return np.ascontiguousarray(blurred[np.ix_(rows, columns)]), valid


def _goal_points(goal: Goal, spacing_m: float) -> FloatArray:
    """Return points (N, 3) on a goal's panels or posts, field frame, metres."""
    up = np.arange(0.0, goal.height_m, spacing_m)
    half = goal.width_m / 2
    if goal.kind == "posts":
        posts = [[goal.line_x_m, side * half, z] for side in (-1, 1) for z in up]
        bar = [[goal.line_x_m, y, goal.height_m] for y in np.arange(-half, half, spacing_m)]
        return np.array(posts + bar)
    points = []
    for x0, y0, x1, y1 in goal.panels:
        count = max(2, math.ceil(math.hypot(x1 - x0, y1 - y0) / spacing_m))
        foot = np.linspace([x0, y0], [x1, y1], count)
        points += [np.column_stack([foot, np.full(count, z)]) for z in up]
    return np.vstack(points)


def _line_points(field: Field, spacing_m: float) -> FloatArray:
    """Return points (2, N, 3) on both edges of the field's lines and arcs, metres."""
    middle, across = [], []
    for x0, y0, x1, y1 in field.lines:
        length = max(math.hypot(x1 - x0, y1 - y0), 1e-9)
        count = max(2, math.ceil(length / spacing_m))
        middle.append(np.linspace([x0, y0], [x1, y1], count))
        across.append(np.tile([(y0 - y1) / length, (x1 - x0) / length], (count, 1)))
    for x, y, radius, start, sweep in field.arcs:
        angle = start + np.linspace(0.0, sweep, max(8, math.ceil(abs(sweep) * radius / spacing_m)))
        out = np.column_stack([np.cos(angle), np.sin(angle)])
        middle.append((x, y) + radius * out)
        across.append(out)
    if not middle:
        return np.empty((2, 0, 3))
    half = np.vstack(across) * field.line_width_m / 2
    edges = np.stack([np.vstack(middle) + half, np.vstack(middle) - half])
    return np.concatenate([edges, np.zeros((*edges.shape[:2], 1))], axis=2)


def _line_pixels(
    edges_m: FloatArray, camera: OmniCamera | PinholeCamera, pose: Pose2, shape: tuple[int, ...], min_width_px: float
) -> Int64Array:
    """Return pixels (N, 2), u and v, on the middle of lines that are wide enough for pure paint."""
    left, right = (_projected(edge_m, camera, pose) for edge_m in edges_m)
    wide = np.hypot(*(left - right).T) >= min_width_px
    return _inside((left[wide] + right[wide]) / 2, shape)


def _projected(points_m: FloatArray, camera: OmniCamera | PinholeCamera, pose: Pose2) -> FloatArray:
    """Return the pixels (N, 2), u and v, of places (N, 3) on the field."""
    return camera.point_to_pixel(np.column_stack([pose.inverse().transform(points_m[:, :2]), points_m[:, 2]]))


def _inside(pixels: FloatArray, shape: tuple[int, ...]) -> Int64Array:
    """Return the different whole pixels (M, 2) inside a picture."""
    whole = np.rint(pixels[np.isfinite(pixels).all(axis=1)]).astype(np.int64)
    inside = (whole >= 0).all(axis=1) & (whole[:, 0] < shape[1]) & (whole[:, 1] < shape[0])
    return np.asarray(np.unique(whole[inside], axis=0))


def _white_of(frame: UInt8Array, pixels: Int64Array, floor: FloorColor) -> PaintColor | None:
    """Return the white of the field's lines, from pixels that are brighter than the floor and not saturated."""
    colors = frame[pixels[:, 1], pixels[:, 0]].astype(np.float64)
    level = (colors[:, 2] + 2 * colors[:, 1] + colors[:, 0]) / 4
    blue, green, red = np.maximum(colors[(level > _MIN_LINE_LEVEL * floor.level) & (colors.max(axis=1) < 250)], 1.0).T
    if len(green) < _MIN_PIXELS:
        return None
    return PaintColor(float(np.median(red / green)), float(np.median(blue / green)))


def _where(
    points_m: FloatArray, camera: OmniCamera | PinholeCamera, poses: Sequence[Pose2], shape: tuple[int, ...]
) -> BoolArray:
    """Return a mask (H, W) of the pixels near places on the field at any of the poses."""
    seen = np.zeros(shape, dtype=np.uint8)
    for pose in poses:
        u, v = _inside(_projected(points_m, camera, pose), shape).T
        seen[v, u] = 1
    return np.asarray(cv2.dilate(seen, np.ones((5, 5), np.uint8)) > 0)


def _log(paint: PaintColor) -> FloatArray:
    return np.log([max(paint.red_ratio, 1e-3), max(paint.blue_ratio, 1e-3)])


def _beside_white(colors: Colors) -> FloatArray:
    return np.asarray(_log(colors.floor.lit) - _log(colors.line))


def _median_floor(floors: Sequence[FloorColor], max_spread: float) -> FloorColor:
    """Return the median of the frames' floors, with colours compared at equal absolute brightness."""
    level = float(np.exp(np.median(np.log([f.level for f in floors]))))
    curves = {
        key: np.array([np.interp(LEVELS + math.log(level / f.level), LEVELS, np.log(getattr(f, key))) for f in floors])
        for key in ("red_ratio", "blue_ratio")
    }
    red, blue = (np.median(curve, axis=0) for curve in curves.values())
    own = np.median([f.spread for f in floors], axis=0)
    lit = np.array([_log(f.lit) for f in floors])
    between = 1.4826 * np.median(np.abs(lit - np.median(lit, axis=0)), axis=0)
    spread = np.minimum(np.hypot(own, between), max_spread)
    noise = float(np.median([f.noise for f in floors]))
    return FloorColor(level, noise, read_only(np.exp(red)), read_only(np.exp(blue)), read_only(spread))


def _median_paint(paints: Sequence[PaintColor]) -> PaintColor:
    red, blue = np.exp(np.median([_log(p) for p in paints], axis=0))
    return PaintColor(float(red), float(blue))


def _weighted_median(measured: Sequence[tuple[FloatArray, int]]) -> PaintColor:
    weight = np.array([count for _, count in measured], dtype=np.float64)
    ratios = []
    for channel in np.array([ratio for ratio, _ in measured]).T:
        order = np.argsort(channel)
        way = np.cumsum(weight[order])
        ratios.append(float(np.exp(channel[order][np.searchsorted(way, way[-1] / 2)])))
    return PaintColor(*ratios)
