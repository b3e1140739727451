"""Looks for a goal's silhouette among edges of any colour, over a bank of cameras.

Lamps wash paint white and clutter of its hue touches it; still some step of light or colour follows most of its posts
and bar. Edges are kept as levels of a byte a cell: four directions, each as lying there or in a neighbouring cell.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.pinhole import Axis, camera_axes, ideal_pixel, in_camera
from robocup_vision.kernels.goal.edge_places import goal_outline, project_outline
from robocup_vision.kernels.goal.picture import GoalScene

Int32Array = npt.NDArray[np.int32]

# an edge is of those of four directions, 45 degrees apart, that its normal is nearer to than 35 degrees
_NEAR_COSINE_2 = 0.67
# tangent of half the angle between directions
_HALF_STEP = math.tan(math.pi / 8)
# an outline has so many points before its feet: both ends of each edge
_ENDS = 12
_OUTER_FEET = (0, 6)
_OTHER_ENDS = (1, 2, 3, 4, 5, 7, 8, 9, 10, 11)
_SAMPLES = 10
# cells, and a factor of half a view, by which a goal may be said to be in view until its points are projected
_MARGIN = 3.0
_SLACK = 1.2
# of settling: rounds, what each round's steps are of those before, and most of a step of bearing and of roll (rad)
_ROUNDS = 5
_SHRINK = 0.6
_MAX_TURN = 0.1
_MAX_ROLL = 0.02


class Cameras(NamedTuple):
    """A bank of cameras: each place with each tilt, turned so that the goal's middle lies in each column.

    Parameters
    ----------
    places_m : (P, 2) float64
        Field frame.
    tilts_rad : (T,) float64
        Up.
    columns : (C,) float64
        Cells.
    roll_rad, height_m : float
        Of all.
    """

    places_m: FloatArray
    tilts_rad: FloatArray
    columns: FloatArray
    roll_rad: float
    height_m: float


class Evidence(NamedTuple):
    """What a picture shows, cell by cell.

    Parameters
    ----------
    levels : (H, W) uint8
        Edges, see `mark_edges`.
    edge_nats : (4, 3) float64
        Log-likelihood ratio of a goal's edge against clutter, by direction: where none lies, one nearby, one there.
    paint_nats : (H, W) float32
        The same for paint's hue.
    carpet : (H, W) uint8
        Above 0 on carpet.
    """

    levels: UInt8Array
    edge_nats: FloatArray
    paint_nats: npt.NDArray[np.float32]
    carpet: UInt8Array


@compiled
def strongest_gradients(channels: UInt8Array, along: Int32Array, down: Int32Array) -> None:
    """Differences (H, W) of neighbours along rows and down columns, of that of three channels where they are greatest.

    Channels (3, H, W), one after the other and without branches, let the processor work out several pixels at a time.
    """
    height, width = channels.shape[1:]
    along[:], down[:] = 0, 0
    for v in range(1, height - 1):
        for u in range(1, width - 1):
            best = best_u = best_v = np.int32(0)
            for c in range(3):
                du = np.int32(channels[c, v, u + 1]) - np.int32(channels[c, v, u - 1])
                dv = np.int32(channels[c, v + 1, u]) - np.int32(channels[c, v - 1, u])
                size = np.int32(du * du + dv * dv)
                is_greater = size > best
                best = size if is_greater else best
                best_u = du if is_greater else best_u
                best_v = dv if is_greater else best_v
            along[v, u], down[v, u] = best_u, best_v


@compiled
def mark_edges(along: Int32Array, down: Int32Array, least: float, cell_px: int, levels: UInt8Array) -> None:
    """Mark edges where differences are greatest across themselves.

    Parameters
    ----------
    along, down : (H, W) int32
        See `strongest_gradients`.
    least : float
        Squared differences from which there is an edge.
    cell_px : int
        Pixels to a cell, each way.
    levels : (H / cell_px, W / cell_px) uint8
        Result, zero before: bits 0 to 3, an edge of each direction there; bits 4 to 7, there or in a cell beside it.
    """
    height, width = along.shape
    rows, columns = levels.shape
    for v in range(2, height - 2):
        for u in range(2, width - 2):
            du, dv = along[v, u], down[v, u]
            size = du * du + dv * dv
            if size < least:
                continue
            direction = _direction(-float(dv), float(du))
            step_u = 0 if direction == 2 else 1
            step_v = 0 if direction == 0 else (-1 if direction == 3 else 1)
            before = along[v - step_v, u - step_u] ** 2 + down[v - step_v, u - step_u] ** 2
            behind = along[v + step_v, u + step_u] ** 2 + down[v + step_v, u + step_u] ** 2
            if size < before or size <= behind:
                continue
            bits = 0
            if du * du > _NEAR_COSINE_2 * size:
                bits |= 1
            if 0.5 * (du + dv) ** 2 > _NEAR_COSINE_2 * size:
                bits |= 2
            if dv * dv > _NEAR_COSINE_2 * size:
                bits |= 4
            if 0.5 * (du - dv) ** 2 > _NEAR_COSINE_2 * size:
                bits |= 8
            row, column = v // cell_px, u // cell_px
            if row >= rows or column >= columns:
                continue
            levels[row, column] |= bits
            for beside in range(max(row - 1, 0), min(row + 2, rows)):
                for next_to in range(max(column - 1, 0), min(column + 2, columns)):
                    levels[beside, next_to] |= bits << 4


@compiled
def _direction(along: float, down: float) -> int:
    """Which of the four directions an edge that runs so has, by its normal: across, falling, down, rising."""
    if abs(along) < _HALF_STEP * abs(down):
        return 0
    if abs(down) < _HALF_STEP * abs(along):
        return 2
    return 1 if along * down < 0 else 3


@compiled
def _edges_nats(levels: UInt8Array, nats: FloatArray, points: FloatArray) -> float:
    """Sum the evidence along the six edges between points (12, 2); what lies outside the picture says nothing."""
    rows, columns = levels.shape
    total = 0.0
    for e in range(6):
        u, v = points[2 * e, 0], points[2 * e, 1]
        along, down = (points[2 * e + 1, 0] - u) / _SAMPLES, (points[2 * e + 1, 1] - v) / _SAMPLES
        direction = _direction(along, down)
        # rounded by cutting off
        u, v = u + 0.5 * along + 0.5, v + 0.5 * down + 0.5
        for _ in range(_SAMPLES):
            if u >= 0.0 and v >= 0.0 and u < columns and v < rows:
                bits = levels[int(v), int(u)] >> direction
                total += nats[direction, (bits & 1) + ((bits >> 4) & 1)]
            u += along
            v += down
    return total


@compiled
def _paint_nats(paint: npt.NDArray[np.float32], points: FloatArray) -> float:
    """Sum the evidence along the axes of both posts and the bar."""
    rows, columns = paint.shape
    total = 0.0
    for element in range(3):
        n = 4 * element
        u, v = 0.5 * (points[n, 0] + points[n + 2, 0]), 0.5 * (points[n, 1] + points[n + 2, 1])
        along = (0.5 * (points[n + 1, 0] + points[n + 3, 0]) - u) / _SAMPLES
        down = (0.5 * (points[n + 1, 1] + points[n + 3, 1]) - v) / _SAMPLES
        u, v = u + 0.5 * along + 0.5, v + 0.5 * down + 0.5
        for _ in range(_SAMPLES):
            if u >= 0.0 and v >= 0.0 and u < columns and v < rows:
                total += paint[int(v), int(u)]
            u += along
            v += down
    return total


@compiled
def silhouette_nats(scene: GoalScene, evidence: Evidence, unknowns: FloatArray) -> float:
    """Sum the evidence of edges and paint where one camera sees the goal; minus infinity where it is not in front.

    Parameters
    ----------
    scene : GoalScene
        As for `score_places`, of the picture that the evidence is of.
    evidence : Evidence
        Of a picture.
    unknowns : (8,) float64
        The camera, in the order of goal/geometry.py.
    """
    outline, points = np.empty((_ENDS, 3)), np.empty((_ENDS, 2))
    goal_outline(scene, unknowns[0], unknowns[1], unknowns[5], outline)
    if not project_outline(outline, scene.camera, unknowns[2], unknowns[3], unknowns[4], points):
        return -np.inf
    return _paint_nats(evidence.paint_nats, points) + _edges_nats(evidence.levels, evidence.edge_nats, points)


@compiled
def _stands_on_carpet(carpet: UInt8Array, points: FloatArray) -> bool:
    """Whether both outer feet are in the picture, and carpet begins below one of them."""
    rows, columns = carpet.shape
    on_carpet = False
    for n in _OUTER_FEET:
        u, v = points[n, 0] + 0.5, points[n, 1] + 0.5
        if u < 0.0 or v < 0.0 or u >= columns or v >= rows:
            return False
        on_carpet |= carpet[min(int(v) + 2, rows - 1), int(u)] > 0
    return on_carpet


@compiled
def _elevations(outline: FloatArray) -> tuple[float, float]:
    """Tangents of the lowest and the highest point's elevation over the horizon."""
    low, high = np.inf, -np.inf
    for n in range(_ENDS):
        slope = outline[n, 2] / math.hypot(outline[n, 0], outline[n, 1])
        low, high = min(low, slope), max(high, slope)
    return low, high


@compiled
def score_places(scene: GoalScene, evidence: Evidence, cameras: Cameras, found: FloatArray) -> None:
    """Find the best heading and tilt at each place of a bank.

    Parameters
    ----------
    scene : GoalScene
        The goal at +x without feet, and the camera's view in cells.
    evidence : Evidence
        Of a picture.
    cameras : Cameras
        The bank.
    found : (P, 4) float64
        Results: evidence, heading, tilt, the paint's part of the evidence; minus infinity where no goal would be whole.
    """
    outline, points = np.empty((_ENDS, 3)), np.empty((_ENDS, 2))
    view, (rows, columns) = scene.camera, evidence.levels.shape
    reach = _SLACK * max(view[3], rows - view[3]) / view[1]
    for place in range(len(cameras.places_m)):
        x, y = cameras.places_m[place, 0], cameras.places_m[place, 1]
        goal_outline(scene, x, y, cameras.height_m, outline)
        ahead = scene.shape[0] - x
        middle = math.atan2(-y, ahead)
        cos_middle, sin_middle = math.cos(middle), math.sin(middle)
        left = math.tan(math.atan2(0.5 * scene.shape[1] - y, ahead) - middle)
        right = math.tan(math.atan2(-0.5 * scene.shape[1] - y, ahead) - middle)
        low, high = _elevations(outline)
        found[place, 0] = -np.inf
        for tilt in cameras.tilts_rad:
            rise = math.tan(tilt)
            # the optical axis is within half a view of the feet and of the bar
            if rise - low > reach * (1.0 + rise * low) or high - rise > reach * (1.0 + rise * high):
                continue
            axes = camera_axes(0.0, tilt, cameras.roll_rad)
            for column in cameras.columns:
                aside = (column - view[2]) / view[0]
                # columns of the posts, were the camera level
                if (aside - left) * view[0] < -(_MARGIN + view[2]) * (1.0 + aside * left):
                    continue
                if (aside - right) * view[0] > (columns + _MARGIN - view[2]) * (1.0 + aside * right):
                    continue
                away = math.sqrt(1.0 + aside * aside)
                cosine, sine = (cos_middle - sin_middle * aside) / away, (sin_middle + cos_middle * aside) / away
                turn = (cosine, sine)
                # feet first: most cameras have none of them on carpet
                if not _project_turned(outline, _OUTER_FEET, turn, axes, view, points):
                    continue
                if not _stands_on_carpet(evidence.carpet, points):
                    continue
                if not _project_turned(outline, _OTHER_ENDS, turn, axes, view, points) or points[8, 1] < -1.0:
                    continue
                of_paint = _paint_nats(evidence.paint_nats, points)
                # paint that is less like its hue than clutter is somebody else's
                if of_paint < 0.0:
                    continue
                nats = of_paint + _edges_nats(evidence.levels, evidence.edge_nats, points)
                if nats > found[place, 0]:
                    found[place, 0], found[place, 1] = nats, math.atan2(sine, cosine)
                    found[place, 2], found[place, 3] = tilt, of_paint


@compiled
def _project_turned(
    outline: FloatArray,
    which: tuple[int, ...],
    turn: tuple[float, float],
    axes: tuple[Axis, Axis, Axis],
    view: FloatArray,
    points: FloatArray,
) -> bool:
    """Project some points as `project_outline` does, of a camera turned by a cosine and sine from these axes."""
    cosine, sine = turn
    for n in which:
        x, y = outline[n, 0], outline[n, 1]
        ahead, left, up = in_camera(axes, cosine * x + sine * y, cosine * y - sine * x, outline[n, 2])
        if ahead <= 0.05:
            return False
        points[n, 0], points[n, 1] = ideal_pixel(view[0], view[1], view[2], view[3], ahead, left, up)
    return True


@compiled
def settle(
    scene: GoalScene, levels: UInt8Array, edge_nats: FloatArray, height_m: float, step_px: float, p: FloatArray
) -> float:
    """Climb from a camera to a better one nearby, in ever smaller steps; returns its evidence.

    Parameters
    ----------
    scene : GoalScene
        As for `score_places`.
    levels, edge_nats
        See `Evidence`.
    height_m : float
        Of the camera.
    step_px : float
        First steps of place and roll move the silhouette's ends by so much; those of heading and tilt by half of it.
    p : (5,) float64
        x, y, heading, tilt, roll; changed.
    """
    outline, points = np.empty((_ENDS, 3)), np.empty((_ENDS, 2))
    best = -np.inf
    for _ in range(_ROUNDS):
        dx, y = scene.shape[0] - p[0], p[1]
        distance, bearing = math.hypot(dx, y), math.atan2(y, dx)
        aside, tilt, roll = p[2] - math.atan2(-y, dx), p[3], p[4]
        turn = 0.5 * step_px / scene.camera[0]
        step = step_px * distance / (scene.camera[0] * scene.shape[1])
        for a in range(-1, 2):
            for b in range(-1, 2):
                away, turned = distance * (1.0 + a * step), bearing + b * min(2.0 * step, _MAX_TURN)
                at_x, at_y = scene.shape[0] - away * math.cos(turned), away * math.sin(turned)
                goal_outline(scene, at_x, at_y, height_m, outline)
                middle = math.atan2(-at_y, scene.shape[0] - at_x) + aside
                for c in range(-1, 2):
                    rolled = roll + c * min(step, _MAX_ROLL)
                    for d in range(-1, 2):
                        heading = middle + d * turn
                        for e in range(-1, 2):
                            nodded = tilt + e * turn
                            if not project_outline(outline, scene.camera, heading, nodded, rolled, points):
                                continue
                            nats = _edges_nats(levels, edge_nats, points)
                            if nats > best:
                                best = nats
                                p[0], p[1], p[2], p[3], p[4] = at_x, at_y, heading, nodded, rolled
        step_px *= _SHRINK
    return best
