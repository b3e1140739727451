"""Compiled fit of the floor's outline to a field's walls: prediction and Gauss-Newton."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.three import solve_3x3

Vector = tuple[float, float, float]
B1, B2, B3 = np.uint64(1), np.uint64(2), np.uint64(3)
# width of the weights, in units of `FloorOutline.unit_px`, above which every second bearing suffices
FAR_UNITS = 2.5


class WallScene(NamedTuple):
    """Walls of a field and the camera on its robot.

    Parameters
    ----------
    walls : (W, 4) float64
        Feet x0, y0, x1, y1, field frame, metres.
    offset_x, offset_y, height : float
        Viewpoint in the robot frame, metres.
    robot_to_camera : (3, 3) float64
        Rotation of directions.
    cos_b, sin_b : (K,) float64
        Evenly spaced camera-frame bearings from 0 counter-clockwise.
    """

    walls: FloatArray
    offset_x: float
    offset_y: float
    height: float
    robot_to_camera: FloatArray
    cos_b: FloatArray
    sin_b: FloatArray


class WallPrediction(NamedTuple):
    """The nearest wall's foot at each bearing.

    Parameters
    ----------
    q : (K,) float64
        Inverse range; 0 without a wall.
    wall : (K,) int64
        Index of the wall; -1 if there is none.
    planes : (W, 4) float64
        For each wall n_x and n_y of its plane's normal n, and its extent along the field's x and y, all divided by
        h n_z.
    """

    q: FloatArray
    wall: Int64Array
    planes: FloatArray


class FloorOutline(NamedTuple):
    """A measured floor outline, and the settings of its comparison in the image.

    Parameters
    ----------
    radius : (K,) float64
        Image radius of the floor's edge; NaN if there is none.
    q_step, radius_of_q : float, (Q,) float64
        Image radius tabulated over the inverse range 0, q_step, 2 q_step ...
    scales : (I,) float64
        Widths of the weights in pixels, one for each iteration.
    unit_px : float
        Half the residual at which the cost is truncated.
    """

    radius: FloatArray
    q_step: float
    radius_of_q: FloatArray
    scales: FloatArray
    unit_px: float


@compiled
def _cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _in_camera(x_m: float, y_m: float, pose: FloatArray, c: float, s: float, scene: WallScene) -> Vector:
    """Return a point of the field's floor in the camera frame; c and s are of the robot's heading."""
    turn, dx, dy = scene.robot_to_camera, x_m - pose[0], y_m - pose[1]
    x, y, z = c * dx + s * dy - scene.offset_x, -s * dx + c * dy - scene.offset_y, -scene.height
    return (
        turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z,
        turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z,
        turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z,
    )


@compiled
def predict_walls(pose: FloatArray, scene: WallScene, out: WallPrediction) -> tuple[float, float]:
    """Predict the inverse range of the nearest wall's foot at each bearing, from a pose (3,) x, y, theta of the robot.

    A wall's foot and the viewpoint span a plane with normal n. The ray (cos, sin, -q h) of a bearing lies in it if
    q = (n_x cos + n_y sin) / (h n_z): walls are straight in q for any mirror and tilt. Returns the derivative of the
    viewpoint by theta, along the field's x and y.
    """
    walls, offset_x, offset_y, height, _, cos_b, sin_b = scene
    best_q, best_wall, planes = out
    count = cos_b.shape[0]
    per_rad = count / (2 * math.pi)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    best_q[:] = 0.0
    best_wall[:] = -1
    end, end_at = (0.0, 0.0, 0.0), 0.0
    for w in range(walls.shape[0]):
        # most walls begin at the end of the one before
        start, start_at = end, end_at
        if w == 0 or walls[w, 0] != walls[w - 1, 2] or walls[w, 1] != walls[w - 1, 3]:
            start = _in_camera(walls[w, 0], walls[w, 1], pose, c, s, scene)
            start_at = math.atan2(start[1], start[0])
        end = _in_camera(walls[w, 2], walls[w, 3], pose, c, s, scene)
        end_at = math.atan2(end[1], end[0])
        normal = _cross(start, (end[0] - start[0], end[1] - start[1], end[2] - start[2]))
        if abs(normal[2]) < 1e-12:
            planes[w] = 0.0
            continue
        # scaled, so that q needs no division at each bearing
        scale = 1.0 / normal[2] / height
        along, aside = normal[0] * scale, normal[1] * scale
        planes[w, 0], planes[w, 1] = along, aside
        planes[w, 2], planes[w, 3] = (walls[w, 2] - walls[w, 0]) * scale, (walls[w, 3] - walls[w, 1]) * scale
        first, span = start_at, end_at - start_at
        span -= 2 * math.pi * math.floor(span / (2 * math.pi) + 0.5)
        if span < 0:
            first, span = first + span, -span
        low = math.ceil(first * per_rad)
        # not a remainder, which would take longer than the rest
        bearing = low + count if low < 0 else low
        for _ in range(math.floor((first + span) * per_rad) - low + 1):
            q = along * cos_b[bearing] + aside * sin_b[bearing]
            if q > best_q[bearing]:
                best_q[bearing] = q
                best_wall[bearing] = w
            bearing += 1
            if bearing == count:
                bearing = 0
    return -s * offset_x - c * offset_y, c * offset_x - s * offset_y


@compiled(error_model="numpy")
def tabulated(outline: FloorOutline, q: float) -> tuple[float, float]:
    """Return the image radius of an inverse range, and its derivative."""
    per_q = 1.0 / outline.q_step
    place = q * per_q
    # extrapolated beyond the table
    cell = np.uint64(np.uint32(min(place, outline.radius_of_q.shape[0] - 2 + 0.999)))
    step = outline.radius_of_q[cell + B1] - outline.radius_of_q[cell]
    return outline.radius_of_q[cell] + (place - cell) * step, step * per_q


@compiled(error_model="numpy")
def agreement(e: float, per_scale: float) -> float:
    """Return the weight of a residual, three times as wide beyond a wall: obstacles hide floor only in front of it."""
    ratio = e * (per_scale if e < 0 else per_scale / 3.0)
    root_weight = 1.0 / (1.0 + ratio * ratio)
    return root_weight * root_weight


@compiled(error_model="numpy")
def truncated_loss(e: float, per_two_units: float) -> float:
    """Return the cost of a residual: at most 1, or 2 for floor beyond a wall."""
    return min(1.0 if e < 0 else 2.0, (e * per_two_units) ** 2)


@compiled(error_model="numpy")
def _off_wall(outline: FloorOutline, r: float, q: float, q_turn: float) -> tuple[float, float]:
    """Return the distance of an edge at a radius from a wall's foot, pixels, and its derivative by the inverse range q.

    The distance is measured along the edge's normal, because the noise is isotropic in the image. `q_turn` is minus
    the derivative of q by the bearing.
    """
    predicted, slope = tabulated(outline, q)
    turn = slope * q_turn / predicted
    oblique = 1.0 / math.sqrt(1.0 + turn * turn)
    return (r - predicted) * oblique, slope * oblique


@compiled(error_model="numpy")
def turned_rate(
    c: float, s: float, fall: float, along: float, aside: float, per_height: float
) -> tuple[float, float, float]:
    """Return the derivatives of a wall's inverse range q by rotations of the camera about its axes; `fall` is q h."""
    # a small rotation t maps a plane's normal n to n - t x n
    return s * per_height + fall * aside, -c * per_height - fall * along, aside * c - along * s


@compiled(error_model="numpy", fastmath={"reassoc", "nsz", "contract"})
def _add_up(
    scene: WallScene,
    outline: FloorOutline,
    prediction: WallPrediction,
    swing: tuple[float, float],
    scale: float,
    information: FloatArray,
    pull: FloatArray,
) -> None:
    """Sum the normal equations over the bearings.

    Fills `information` (3, 3), the sum of w J^T J, and `pull` (3,), the sum of w e J. `swing` is the derivative of the
    viewpoint by theta. Vectorises: no branches, and sums in any order.
    """
    best_q, best_wall, planes = prediction
    cos_b, sin_b, radius, plane = scene.cos_b, scene.sin_b, outline.radius, planes.reshape(-1)
    per_scale, height, per_height = 1.0 / scale, scene.height, 1.0 / scene.height
    up_x, up_y, up_z = scene.robot_to_camera[:, 2]
    # scalars, because sums in arrays would be stored and loaded at each bearing
    a00, a01, a02, a11, a12, a22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    p0, p1, p2 = 0.0, 0.0, 0.0
    # unsigned, because numba tests signed indices for negative ones
    for k in range(np.uint64(cos_b.shape[0])):
        wall, r, q, c, s = best_wall[k], radius[k], best_q[k], cos_b[k], sin_b[k]
        is_known = (r > 0.0) & (wall >= 0)
        at = np.uint64(4 * max(wall, 0))
        along, aside = plane[at], plane[at + B1]
        e, by_q = _off_wall(outline, r, q, along * s - aside * c)
        e = e if is_known else 0.0
        # derivatives by x and y: the component of the viewpoint's motion across the wall
        fall = by_q * (up_x * c + up_y * s - up_z * (q * height))
        j0, j1 = -fall * plane[at + B3], fall * plane[at + B2]
        t0, t1, t2 = turned_rate(c, s, q * height, along, aside, per_height)
        j2 = by_q * (up_x * t0 + up_y * t1 + up_z * t2) + swing[0] * j0 + swing[1] * j1
        weight = agreement(e, per_scale) if is_known else 0.0
        w0, w1, w2 = weight * j0, weight * j1, weight * j2
        a00 += w0 * j0
        a01 += w0 * j1
        a02 += w0 * j2
        a11 += w1 * j1
        a12 += w1 * j2
        a22 += w2 * j2
        p0 += w0 * e
        p1 += w1 * e
        p2 += w2 * e
    information[0, 0], information[0, 1], information[0, 2] = a00, a01, a02
    information[1, 0], information[1, 1], information[1, 2] = a01, a11, a12
    information[2, 0], information[2, 1], information[2, 2] = a02, a12, a22
    pull[0], pull[1], pull[2] = p0, p1, p2


@compiled
def empty_prediction(scene: WallScene) -> WallPrediction:
    """Return the arrays of a prediction."""
    count = scene.cos_b.shape[0]
    return WallPrediction(np.empty(count), np.empty(count, np.int64), np.empty((scene.walls.shape[0], 4)))


class Comparison(NamedTuple):
    """Walls, the outline to which they are fitted, and arrays for their prediction."""

    scene: WallScene
    outline: FloorOutline
    prediction: WallPrediction


@compiled
def thinned(fine: Comparison) -> Comparison:
    """Return a comparison at every second bearing, which suffices at the wide scales of a fit.

    It has all bearings if no scale is wide, or if their number is odd.
    """
    scene, outline = fine.scene, fine.outline
    count = scene.cos_b.shape[0]
    is_far = False
    for scale in outline.scales:
        is_far |= scale > FAR_UNITS * outline.unit_px
    step = 2 if is_far and count % 2 == 0 else 1
    few = count // step
    cos_b, sin_b, radius = np.empty(few), np.empty(few), np.empty(few)
    for k in range(few):
        cos_b[k], sin_b[k], radius[k] = scene.cos_b[step * k], scene.sin_b[step * k], outline.radius[step * k]
    half = WallScene(
        scene.walls, scene.offset_x, scene.offset_y, scene.height, scene.robot_to_camera, cos_b, sin_b
    )  # fmt: skip
    seen = FloorOutline(radius, outline.q_step, outline.radius_of_q, outline.scales, outline.unit_px)
    return Comparison(half, seen, empty_prediction(half))


@compiled
def settle(pose: FloatArray, fine: Comparison, thin: Comparison) -> None:
    """Fit a pose to a measured floor outline by Gauss-Newton on image radii, with annealed redescending weights.

    Parameters
    ----------
    pose : (3,) float64
        In: start. Out: x, y, theta.
    fine : Comparison
        Walls and outline. Its prediction is that of the fitted pose in the end.
    thin : Comparison
        `thinned` of it.
    """
    outline = fine.outline
    iterations = outline.scales.shape[0]
    information, pull, work, step = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty(3)
    for iteration in range(iterations + 1):
        scale = outline.scales[min(iteration, iterations - 1)]
        # two branches, because a read-only outline has another type than its thinned copy
        if iteration < iterations and scale > FAR_UNITS * outline.unit_px:
            swing = predict_walls(pose, thin.scene, thin.prediction)
            _add_up(thin.scene, thin.outline, thin.prediction, swing, scale, information, pull)
        else:
            swing = predict_walls(pose, fine.scene, fine.prediction)
            if iteration == iterations:
                break
            _add_up(fine.scene, fine.outline, fine.prediction, swing, scale, information, pull)
        for i in range(3):
            information[i, i] += 1e-6
        if not solve_3x3(information, pull, work, step):
            continue
        # the linearisation holds for short steps only
        length = math.sqrt(step[0] * step[0] + step[1] * step[1])
        shrink = min(1.0, 0.5 / max(length, 1e-9), 0.5 / max(abs(step[2]), 1e-9))
        for i in range(3):
            pose[i] += shrink * step[i]


@compiled(error_model="numpy", fastmath={"reassoc", "nsz", "contract"})
def compare_outline(
    scene: WallScene,
    outline: FloorOutline,
    prediction: WallPrediction,
    center: tuple[float, float],
    residual: FloatArray,
    predicted: FloatArray,
) -> tuple[float, int]:
    """Compare an outline with predicted walls.

    Parameters
    ----------
    scene, outline, prediction : WallScene, FloorOutline, WallPrediction
        Walls, outline and their prediction.
    center : (float, float)
        Image centre along bearing 0 and a quarter turn on, relative to the camera file, pixels.
    residual, predicted : (K,) float64
        Filled, pixels: distance of the edge from the wall's foot along the edge's normal, positive for floor beyond the
        wall, NaN without an edge or a wall; and the foot's image radius, NaN without a wall.

    Returns
    -------
    (float, int)
        Truncated mean cost, 0 (perfect) to 1, and the number of bearings with an edge.
    """
    cost, used, missed, plane, per_two_units = 0.0, 0, 0, prediction.planes.reshape(-1), 0.5 / outline.unit_px
    center_u, center_v = center
    for k in range(np.uint64(scene.cos_b.shape[0])):
        r, wall = outline.radius[k], prediction.wall[k]
        is_seen, is_met = r > 0.0, wall >= 0
        c, s = scene.cos_b[k], scene.sin_b[k]
        place = np.uint64(4 * max(wall, 0))
        at, slope = tabulated(outline, prediction.q[k])
        turn = slope * (plane[place + B1] * c - plane[place] * s) / at
        foot = at + center_u * (c + turn * s) + center_v * (s - turn * c)
        e = (r - foot) / math.sqrt(1.0 + turn * turn)
        predicted[k] = foot if is_met else np.nan
        residual[k] = e if is_seen & is_met else np.nan
        cost += truncated_loss(e, per_two_units) if is_seen & is_met else 0.0
        used += is_seen
        missed += is_seen & (not is_met)
    return (cost + missed) / max(used, 1), used


@compiled
def inliers_of(residual: FloatArray, inlier_px: float) -> tuple[float, float]:
    """Return the inlier ratio of the known residuals (K,), and the root mean square of the inliers."""
    used, inliers, squares = 0, 0, 0.0
    for k in range(residual.shape[0]):
        e = residual[k]
        if e == e:
            used += 1
            if abs(e) < inlier_px:
                inliers += 1
                squares += e * e
    return inliers / max(used, 1), math.sqrt(squares / max(inliers, 1))


@compiled
def position_std_m(covariance: FloatArray) -> float:
    """Return the largest standard deviation of the position, from a covariance of x, y and more."""
    mean = 0.5 * (covariance[0, 0] + covariance[1, 1])
    half = math.sqrt((0.5 * (covariance[0, 0] - covariance[1, 1])) ** 2 + covariance[0, 1] ** 2)
    return math.sqrt(mean + half)
