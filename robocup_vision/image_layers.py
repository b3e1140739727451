"""Converts a view to points and paths in its frame's pixels, for the overlay picture and the live page.

It only computes positions; the callers draw.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.view import View

Paths = tuple[FloatArray, ...]

_NO_POINTS = np.empty((0, 2))
# points along an obstacle's near side, as multiples of half its width
_ACROSS = np.linspace(-1.0, 1.0, 7)
# a mirror camera's paths are drawn slightly beyond its usable radius
_BEYOND_RADIUS = 1.05
# drawn length of a crossing's arms
_ARM_M = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class ImageLayers:
    """The layers of a view, in pixels of its frame. Points are finite; paths have two points or more."""

    edge_px: FloatArray  #: (K, 2) float64: the floor boundary
    lines_px: FloatArray  #: (N, 2) float64: points on painted lines
    free_px: FloatArray  #: (P, 2) float64: outline of the free floor; empty if none is known
    field_px: Paths  #: lines and walls of the field at the view's pose
    #: goals at the view's pose: posts and bars in a pinhole camera's frame, the walls' feet in a mirror camera's
    goals_px: Paths
    obstacles_px: Paths  #: near sides of obstacles, on the floor
    ball_px: Paths  #: the ball's rim


class ImageLayerMaker:
    """Makes the layers of views of one field."""

    def __init__(self, field: Field) -> None:
        self._field = field
        self._lines, self._line_ends = _stacked(field_outlines(field))
        self._posts, self._post_ends = _stacked(_post_outlines(field))
        goal_walls, self._goal_wall_ends = _stacked(_goal_wall_outlines(field))
        self._floor = np.vstack([self._lines, goal_walls])

    def layers(self, view: View) -> ImageLayers:
        """Return the layers of a view."""
        field_px, goals_px = self._at_pose(view)
        edge = view.boundary_px
        return ImageLayers(
            edge[np.isfinite(edge).all(axis=1)],
            view.line_points_px,
            _free_outline(view),
            field_px,
            goals_px,
            _obstacles(view),
            self._ball(view),
        )

    def field_at(self, camera: OmniCamera | PinholeCamera, pose: Pose2) -> Paths:
        """Return the lines and walls of the field as a camera shows them from a pose of the robot."""
        return _pieces(camera, camera.floor_to_pixel(pose.inverse().transform(self._lines)), self._line_ends)

    def _at_pose(self, view: View) -> tuple[Paths, Paths]:
        if not view.pose:
            return (), ()
        camera, to_robot = view.camera, view.pose.pose.inverse()
        # one projection of all points takes less time than two
        floor_px = camera.floor_to_pixel(to_robot.transform(self._floor))
        field_px = _pieces(camera, floor_px[: len(self._lines)], self._line_ends)
        if not isinstance(camera, PinholeCamera):
            return field_px, _pieces(camera, floor_px[len(self._lines) :], self._goal_wall_ends)
        if not len(self._posts):
            return field_px, ()
        points = np.column_stack([to_robot.transform(self._posts[:, :2]), self._posts[:, 2]])
        return field_px, _pieces(camera, camera.point_to_pixel(points), self._post_ends)

    def _ball(self, view: View) -> Paths:
        if view.ball is None or view.polar is None:
            return ()
        camera = view.polar.camera
        angle = np.linspace(0.0, math.tau, 25)
        rim = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=1) * self._field.ball_radius_m
        # at the height of the ball's centre if the camera's height is known, otherwise on the floor
        rim[:, 2] *= camera.height_m is not None
        pixels = camera.point_to_pixel(rim + np.array([view.ball.x_m, view.ball.y_m, 0.0]))
        return _pieces(camera, pixels, np.array([len(pixels)]))


def field_outlines(field: Field) -> list[FloatArray]:
    """Return lines, arcs and walls of a field as paths (N, 2), dense enough to look smooth in a mirror's picture."""
    spacing = max(field.length_m, field.width_m) / 100
    paths = []
    for x0, y0, x1, y1 in np.vstack([field.lines, field.walls] if field.is_bounded else [field.lines]):
        count = max(2, math.ceil(math.hypot(x1 - x0, y1 - y0) / spacing))
        paths.append(np.linspace([x0, y0], [x1, y1], count))
    for x, y, radius, start, sweep in field.arcs:
        angles = start + np.linspace(0.0, sweep, max(8, math.ceil(abs(sweep) * radius / spacing)))
        paths.append(np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1))
    return paths


def _post_outlines(field: Field) -> list[FloatArray]:
    """Return the axes (N, 3) of posts and bars, one path per goal."""
    paths = []
    for goal in field.goals:
        if goal.kind != "posts":
            continue
        x, half, up = goal.line_x_m, goal.width_m / 2, goal.height_m
        rise, across = np.linspace(0.0, up, 9), np.linspace(-half, half, 17)
        left, right = (np.column_stack([np.full(9, x), np.full(9, y), rise]) for y in (half, -half))
        bar = np.column_stack([np.full(17, x), across, np.full(17, up)])
        paths.append(np.vstack([right, bar, left[::-1]]))
    return paths


def _goal_wall_outlines(field: Field) -> list[FloatArray]:
    """Return the feet (N, 2) of the walls of goals that have walls."""
    return [
        np.vstack([np.linspace(wall[:2], wall[2:], 9) for wall in goal.panels])
        for goal in field.goals
        if goal.kind != "posts"
    ]


def _stacked(paths: list[FloatArray]) -> tuple[FloatArray, Int64Array]:
    """Return the points of all paths in one array, so that they can be projected together, and each path's end."""
    if not paths:
        return _NO_POINTS, np.empty(0, dtype=np.int64)
    return np.vstack(paths), np.cumsum([len(path) for path in paths])


def _pieces(camera: OmniCamera | PinholeCamera, pixels: FloatArray, ends: Int64Array) -> Paths:
    """Return the parts of paths that are in the picture."""
    if not len(pixels):
        return ()
    if isinstance(camera, PinholeCamera):
        # points far outside the picture are not drawn; they might overflow OpenCV's integers
        off_px = np.abs(pixels - camera.center_px)
        shown = (off_px[:, 0] < camera.size_px[0]) & (off_px[:, 1] < camera.size_px[1])
    else:
        radius = np.hypot(*(pixels - camera.center_px).T)
        shown = radius <= camera.usable_radius_px[1] * _BEYOND_RADIUS
    first = np.zeros(len(pixels), dtype=bool)
    first[0] = True
    first[ends[:-1]] = True
    # a part continues at a point if the point before is shown, too, and belongs to the same path
    goes_on = np.zeros(len(pixels) + 1, dtype=bool)
    goes_on[1:-1] = shown[:-1] & shown[1:] & ~first[1:]
    begins = np.flatnonzero(shown & ~goes_on[:-1])
    stops = np.flatnonzero(shown & ~goes_on[1:]) + 1
    return tuple(
        pixels[begin:stop] for begin, stop in zip(begins.tolist(), stops.tolist(), strict=True) if stop - begin > 1
    )


def _obstacles(view: View) -> Paths:
    if view.polar is None or not view.obstacles:
        return ()
    x, y, bearing, width = np.array([(o.x_m, o.y_m, o.bearing_rad, o.width_m) for o in view.obstacles]).T[..., None]
    along = width / 2 * _ACROSS
    points = np.stack([x - along * np.sin(bearing), y + along * np.cos(bearing)], axis=2).reshape(-1, 2)
    ends = len(_ACROSS) * np.arange(1, len(view.obstacles) + 1)
    return _pieces(view.polar.camera, view.polar.camera.floor_to_pixel(points), ends)


def marking_paths(view: View) -> Paths:
    """Return a view's markings in its frame: segments, circles, arms of crossings, crosses at posts' feet and marks.

    This computes the markings, see `View.markings`.
    """
    source, markings = view.marking_source, view.markings
    if source is None or not markings:
        return ()
    along = np.linspace(0.0, 1.0, 33)[:, None]
    turn = np.linspace(0.0, math.tau, 65)
    round_m = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    paths = [np.array(one.start_m) * (1 - along) + np.array(one.end_m) * along for one in markings.segments]
    paths += [np.array([one.x_m, one.y_m]) + one.radius_m * round_m for one in markings.circles]
    for crossing in markings.crossings:
        for arm in crossing.arms_rad:
            ends = np.array([[0.0, 0.0], [math.cos(arm), math.sin(arm)]]) * _ARM_M
            paths.append(np.array([crossing.x_m, crossing.y_m]) + ends)
    feet = [(one.x_m, one.y_m) for one in markings.posts] + [(one.x_m, one.y_m) for one in markings.penalty_marks]
    for x, y in feet:
        for way in ((1.0, 0.0), (0.0, 1.0)):
            paths.append(np.array([x, y]) + np.outer([-1.0, 1.0], way) * _ARM_M)
    points, ends_at = _stacked(paths)
    return _pieces(source.camera, source.camera.floor_to_pixel(points), ends_at)


def _free_outline(view: View) -> FloatArray:
    bearing, range_m = view.free_space.bearing_rad, view.free_space.range_m
    if view.polar is None or view.grid is None or not len(bearing):
        return _NO_POINTS
    half = view.polar.span_rad[1] / 2 / len(bearing)
    inner = view.grid.ring_bounds_m[0]
    turn = (bearing[:, None] + np.linspace(-half, half, 4)).ravel()
    reach = np.repeat(np.maximum(range_m, inner), 4)
    if not view.polar.is_ring:
        # back along the nearest floor in view
        turn = np.concatenate([turn, bearing[::-1]])
        reach = np.concatenate([reach, np.full(len(bearing), inner)])
    corners = np.stack([reach * np.cos(turn), reach * np.sin(turn)], axis=1)
    pixels = view.polar.camera.floor_to_pixel(corners)
    return pixels[np.isfinite(pixels).all(axis=1)]
