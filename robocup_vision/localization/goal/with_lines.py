"""Goal and field lines in one fit: the goal says roughly where, the lines how exactly, and neither needs an exact lens.

Seen from afar a goal alone hardly tells how obliquely it is seen, and its distance stands and falls with focal length
and bar height. The lines around the camera do not, but fit in several places. Together tilt, roll, height and focal
length are unknowns under priors, and what is left is centimetres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.camera.projection import camera_rotation
from robocup_vision.kernels.goal.marks import measure_ridges
from robocup_vision.localization.goal.edges import EdgeSamples, from_ideal, to_ideal
from robocup_vision.localization.goal.fit import GoalModel, residuals
from robocup_vision.localization.goal.geometry import (
    BLOOM,
    EDGES,
    HEADING,
    HEIGHT,
    LOG_FOCAL,
    ROLL,
    TILT,
    UNKNOWNS,
    X,
    Y,
)
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.line_points import LineFinder, LinePoints

LINE_INLIER_PX = 3.0
_LINE_ERROR_PX = 1.0  # of a point: paint, grass and lens
_BUILT_TO_M = 0.01
_RIDGE_SPACING_PX = 8.0
_RIDGE_REACHES_PX = (12.0, 6.0, 4.0)
_MIN_RIDGE_SHARE = 0.75
_WORTH = 0.3
_PATCH_M = 0.15  # neighbours on a line err together: one point counts for so much floor
_MAX_POINTS = 400
_MIN_POINTS = 20
_STEP = np.array([1e-4, 1e-4, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-3])
# a file gives no standard deviation smaller than these once the lines can do better
_HEIGHT_STD_M = 0.02
_LOG_FOCAL_STD = 0.02


@dataclass(frozen=True, eq=False)
class LineFit:
    """A camera fitted to goal and lines.

    Parameters
    ----------
    unknowns : (8,) float64
        See goal_geometry.
    covariance : (8, 8) float64
        Of the unknowns.
    line_share : float
        Inliers among the line points.
    residual_px : (N,) float64
        Of the line points, pixels.
    """

    unknowns: FloatArray
    covariance: FloatArray
    line_share: float
    residual_px: FloatArray


def line_points(
    frame: npt.NDArray[np.uint8], camera: PinholeCamera, unknowns: FloatArray, line_width_m: float
) -> LinePoints:
    """White line points, given the tilt, roll and height that a goal has told."""
    return LineFinder(_held(camera, unknowns), line_width_m).find(frame)


def _held(camera: PinholeCamera, unknowns: FloatArray) -> PinholeCamera:
    return replace(
        camera,
        pan_rad=0.0,
        offset_m=(0.0, 0.0),
        tilt_rad=float(unknowns[TILT]),
        roll_rad=float(unknowns[ROLL]),
        height_m=float(unknowns[HEIGHT]),
    )


def loosened(model: GoalModel) -> GoalModel:
    """Priors for the joint fit: the lines calibrate height and focal length better than most files do."""
    weight = model.weight.copy()
    weight[HEIGHT] = min(weight[HEIGHT], _HEIGHT_STD_M**-2)
    weight[LOG_FOCAL] = min(weight[LOG_FOCAL], _LOG_FOCAL_STD**-2)
    return replace(model, weight=weight)


def fit_goal_and_lines(
    camera: PinholeCamera,
    model: GoalModel,
    start: FloatArray,
    samples: EdgeSamples | None,
    points: LinePoints,
    line_map: LineMap,
    first_scale_px: float = 12.0,
    iterations: int = 14,
) -> LineFit | None:
    """Fit all unknowns to goal edges and line points together.

    Parameters
    ----------
    camera, model : PinholeCamera, GoalModel
        Priors as `loosened` gives them.
    start : (8,) float64
        For the goal at +x.
    samples : EdgeSamples or None
        The goal's edges; None: lines and priors alone.
    points : LinePoints
        Of the same frame.
    line_map : LineMap
        Of the field.
    first_scale_px : float
        How far off the lines may be at first.
    iterations : int
        Of Gauss-Newton.

    Returns
    -------
    LineFit or None
        None where too few points lie on the floor in view.
    """
    thin = _thinned(points)
    if len(thin) < _MIN_POINTS:
        return None
    slopes = (to_ideal(camera, thin.pixels) - np.array(camera.center_px)) / np.array(camera.focal_px)
    free = ~np.isinf(model.weight)
    if samples is not None:
        samples = _as_built(model, samples, start)
    p = start.copy()
    normal, of_lines = np.eye(UNKNOWNS), np.zeros((UNKNOWNS, UNKNOWNS))
    scale = first_scale_px
    for _ in range(iterations):
        residual, jacobian = _line_rows(p, slopes, camera.focal_px, line_map)
        weight = thin.weight / (_LINE_ERROR_PX**2 * (1 + (residual / scale) ** 2) ** 2)
        weight[~np.isfinite(residual)] = 0.0
        residual = np.where(np.isfinite(residual), residual, 0.0)
        jacobian = np.where(np.isfinite(jacobian), jacobian, 0.0)
        of_lines = (jacobian.T * weight) @ jacobian
        normal = of_lines.copy()
        gradient = jacobian.T @ (weight * residual)
        if samples is not None:
            goal_residual = residuals(model, samples, p)
            goal_jacobian = _derivative(model, samples, p, goal_residual)
            goal_scale = max(1.5, scale / 4)
            goal_weight = 1.0 / (samples.sigma**2 * (1 + (goal_residual / goal_scale) ** 2))
            goal_weight[~np.isfinite(goal_residual)] = 0.0
            normal += (goal_jacobian.T * goal_weight) @ goal_jacobian
            gradient += goal_jacobian.T @ (goal_weight * goal_residual)
        prior = np.where(free, model.weight, 0.0)
        normal += np.diag(prior + 1e-9)
        gradient += prior * (p - model.prior)
        normal[~free] = 0.0
        normal[:, ~free] = 0.0
        normal[~free, ~free] = 1.0
        gradient[~free] = 0.0
        step = -np.linalg.solve(normal, gradient)
        p = p + step * min(1.0, 0.3 / max(float(np.abs(step[:HEADING]).max()), 0.3 * abs(step[HEADING]) / 0.1, 1e-9))
        scale = max(0.7 * scale, 2.0)
    residual, _ = _line_rows(p, slopes, camera.focal_px, line_map)
    good = np.isfinite(residual) & (np.abs(residual) < LINE_INLIER_PX)
    # points along a stretch of line err together, so that they are worth fewer than they are
    covariance = np.asarray(
        np.linalg.inv(normal - np.where(np.outer(free, free), (1 - _WORTH) * of_lines, 0.0)), np.float64
    )
    covariance[~free] = 0.0
    covariance[:, ~free] = 0.0
    return LineFit(p, covariance, float(thin.weight[good].sum() / thin.weight.sum()), residual[good])


def _thinned(points: LinePoints) -> LinePoints:
    """At most `_MAX_POINTS`, one per patch of floor, patches growing until they are few enough."""
    patch = _PATCH_M
    while True:
        cell = np.floor(points.floor_m / patch).astype(np.int64)
        _, first = np.unique(cell[:, 0] * 100_003 + cell[:, 1], return_index=True)
        if len(first) <= _MAX_POINTS:
            return points.take(np.sort(first))
        patch *= 1.3


def _on_floor(p: FloatArray, slopes: FloatArray) -> FloatArray:
    """Field points (N, 2) seen along image slopes (N, 2) at the stated focal length; NaN from the horizon on."""
    scale = math.exp(p[LOG_FOCAL])
    ray = np.column_stack([np.ones(len(slopes)), -slopes / scale]) @ camera_rotation(p[HEADING], p[TILT], p[ROLL]).T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(ray[:, 2] < -1e-3, -p[HEIGHT] / ray[:, 2], np.nan)
    return np.asarray(p[[X, Y]] + ray[:, :2] * reach[:, None])


def _line_rows(
    p: FloatArray, slopes: FloatArray, focal_px: tuple[float, float], line_map: LineMap
) -> tuple[FloatArray, FloatArray]:
    """Pixel distances (N,) across the nearest lines, and their derivative (N, 8)."""
    floor = _on_floor(p, slopes)
    seen = np.isfinite(np.sum(floor, axis=1))
    half_u, half_v = np.array([0.5 / focal_px[0], 0.0]), np.array([0.0, 0.5 / focal_px[1]])
    near = line_map.nearest(np.where(seen[:, None], floor, 0.0))
    by_u = _on_floor(p, slopes + half_u) - _on_floor(p, slopes - half_u)
    by_v = _on_floor(p, slopes + half_v) - _on_floor(p, slopes - half_v)
    across = np.hypot((near.normal * by_u).sum(axis=1), (near.normal * by_v).sum(axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        per_m = np.where(seen & (across > 0), 1.0 / across, np.nan)
    jacobian = np.zeros((len(slopes), UNKNOWNS))
    for k in range(BLOOM):
        moved = p.copy()
        moved[k] += _STEP[k]
        jacobian[:, k] = ((_on_floor(moved, slopes) - floor) * near.normal).sum(axis=1) / _STEP[k] * per_m
    return near.distance_m * per_m, jacobian


def _as_built(model: GoalModel, samples: EdgeSamples, p: FloatArray) -> EdgeSamples:
    """Let the samples' noise include that goals are built, and stood on their line, to about a centimetre."""
    shared = _BUILT_TO_M * model.view.focal_px[0] / math.hypot(model.shape.line_x_m - p[X], p[Y])
    count = np.concatenate(
        [
            np.bincount(samples.edge, minlength=EDGES)[samples.edge],
            np.bincount(samples.foot_post, minlength=2)[samples.foot_post],
        ]
    )
    return replace(samples, sigma=np.sqrt(samples.sigma**2 + shared**2 * count))


def _derivative(model: GoalModel, samples: EdgeSamples, p: FloatArray, residual: FloatArray) -> FloatArray:
    jacobian = np.empty((len(residual), UNKNOWNS))
    for k in range(UNKNOWNS):
        moved = p.copy()
        moved[k] += _STEP[k]
        jacobian[:, k] = (residuals(model, samples, moved) - residual) / _STEP[k]
    return jacobian


def line_starts(
    model: GoalModel, unknowns: FloatArray, points: LinePoints, line_map: LineMap, most: int = 3
) -> list[FloatArray]:
    """Cameras that see the goal nearly alike and put the line points best on lines.

    What a far goal leaves open is how obliquely it is seen: the camera may swing about the goal's middle, and come
    nearer or go farther a little.
    """
    thin = _thinned(points)
    turn, stretch = np.meshgrid(np.radians(np.arange(-40.0, 41.0, 4.0)), (0.94, 1.0, 1.06), indexing="ij")
    turn, stretch = turn.ravel(), stretch.ravel()
    dx, dy = unknowns[X] - model.shape.line_x_m, unknowns[Y]
    c, s = np.cos(turn), np.sin(turn)
    starts = np.tile(unknowns, (len(turn), 1))
    starts[:, X] = model.shape.line_x_m + stretch * (c * dx - s * dy)
    starts[:, Y] = stretch * (s * dx + c * dy)
    starts[:, HEADING] += turn
    c, s = np.cos(starts[:, HEADING, None]), np.sin(starts[:, HEADING, None])
    x, y = thin.floor_m[:, 0] * stretch[:, None], thin.floor_m[:, 1] * stretch[:, None]
    field = np.stack([starts[:, X, None] + c * x - s * y, starts[:, Y, None] + s * x + c * y], axis=-1)
    cost = (np.minimum(line_map.rough_distance_m(field), 0.25) * thin.weight).mean(axis=1)
    order = np.argsort(cost, kind="stable")
    chosen: list[int] = []
    for k in order:
        if all(abs(turn[k] - turn[j]) > math.radians(6.0) for j in chosen):
            chosen.append(int(k))
        if len(chosen) == most:
            break
    return [starts[k] for k in chosen]


@dataclass(frozen=True, slots=True)
class Ridges:
    """Where field lines were seen near where a camera predicts them.

    Parameters
    ----------
    pixels : (N, 2) float64
        On the lines' middles.
    expected : int
        How many places in view were looked at.
    """

    pixels: FloatArray
    expected: int


def line_ridges(
    frame: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    unknowns: FloatArray,
    line_map: LineMap,
    line_width_m: float,
    reach_px: float,
) -> Ridges:
    """Look for every field line where the camera `unknowns` predicts it, to `reach_px` across.

    Places are a few pixels apart along each line; where two lines run so close that either could be meant, the nearer
    one is taken and the fit's robust loss has the last word.
    """
    place, normal, seen_width = _ridge_places(camera, unknowns, line_map, line_width_m)
    start, across_px = np.ascontiguousarray(from_ideal(camera, place)), np.ascontiguousarray(normal)
    offset, contrast = np.empty(len(place)), np.empty(len(place))
    measure_ridges(frame, start, across_px, np.full(len(place), reach_px), seen_width, 0.0, offset, contrast)
    good = np.isfinite(offset)
    if good.any():
        good &= contrast > 0.25 * np.median(contrast[good])
    return Ridges(start[good] + across_px[good] * offset[good, None], len(place))


def expected_ridges(camera: PinholeCamera, unknowns: FloatArray, line_map: LineMap, line_width_m: float) -> int:
    """How many places along field lines a camera should have in view."""
    return len(_ridge_places(camera, unknowns, line_map, line_width_m)[0])


def _ridge_places(
    camera: PinholeCamera,
    unknowns: FloatArray,
    line_map: LineMap,
    line_width_m: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where lines are due (N, 2) in the ideal image, normals (N, 2) across them and their widths (N,), pixels."""
    field_points, directions = along_lines(line_map)
    rotation = camera_rotation(unknowns[HEADING], unknowns[TILT], unknowns[ROLL])
    eye = np.array([unknowns[X], unknowns[Y], unknowns[HEIGHT]])
    scale = math.exp(unknowns[LOG_FOCAL]) * np.array(camera.focal_px)

    def image(points: FloatArray) -> FloatArray:
        ray = (np.column_stack([points, np.zeros(len(points))]) - eye) @ rotation
        depth = np.where(ray[:, 0] > 0.1, ray[:, 0], np.nan)
        return np.asarray(np.array(camera.center_px) - scale * ray[:, 1:] / depth[:, None])

    across = np.column_stack([-directions[:, 1], directions[:, 0]])
    pixel = image(field_points)
    ahead = image(field_points + 0.01 * directions)
    side = image(field_points + line_width_m * across)
    width, height = camera.size_px
    inside = (pixel[:, 0] > 2) & (pixel[:, 0] < width - 3) & (pixel[:, 1] > 2) & (pixel[:, 1] < height - 3)
    inside &= np.isfinite(ahead).all(axis=1) & np.isfinite(side).all(axis=1)
    along = ahead - pixel
    length = np.hypot(along[:, 0], along[:, 1])
    with np.errstate(invalid="ignore", divide="ignore"):
        tangent = along / length[:, None]
        normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
        seen_width = np.abs(((side - pixel) * normal).sum(axis=1))
    inside &= (seen_width > 0.7) & (seen_width < 40)
    pick = np.flatnonzero(inside)
    # one place every few pixels, however the points crowd in the distance
    cell = np.floor(pixel[pick] / _RIDGE_SPACING_PX).astype(np.int64)
    _, first = np.unique(cell[:, 0] * 100_003 + cell[:, 1], return_index=True)
    pick = pick[np.sort(first)]
    return pixel[pick], normal[pick], seen_width[pick]


def fit_ridges(
    frame: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    model: GoalModel,
    start: FloatArray,
    samples: EdgeSamples | None,
    line_map: LineMap,
    line_width_m: float,
) -> LineFit | None:
    """Look for the lines ever closer to where they are predicted; None unless most of what should be in view is.

    Lines that a wrong camera predicts lie on bare carpet: what is missing speaks against it louder than what happens to
    lie on some line speaks for it.
    """
    found: LineFit | None = None
    p = start
    for reach in _RIDGE_REACHES_PX:
        ridges = line_ridges(frame, camera, p, line_map, line_width_m, reach)
        if len(ridges.pixels) < _MIN_POINTS:
            return None
        found = fit_goal_and_lines(
            camera, model, p, samples, ridge_points(camera, p, ridges), line_map, reach / 2, iterations=6
        )
        if found is None:
            return None
        p = found.unknowns
    assert found is not None
    # the last word: what is seen within reach of where the final camera puts it
    ridges = line_ridges(frame, camera, p, line_map, line_width_m, LINE_INLIER_PX)
    share = len(ridges.pixels) / max(ridges.expected, 1)
    return replace(found, line_share=share) if share >= _MIN_RIDGE_SHARE else None


@lru_cache(maxsize=4)
def along_lines(line_map: LineMap) -> tuple[FloatArray, FloatArray]:
    """Points (N, 2) every 4 cm along a field's lines, and their directions (N, 2)."""
    points, directions = [], []
    for x0, y0, x1, y1 in line_map.lines:
        length = math.hypot(x1 - x0, y1 - y0)
        at = np.arange(0.1, length - 0.1, 0.04)[:, None]
        direction = np.array([[x1 - x0, y1 - y0]]) / length
        points.append(np.array([[x0, y0]]) + at * direction)
        directions.append(np.repeat(direction, len(at), axis=0))
    for x, y, radius, start, sweep in line_map.arcs:
        angle = start + np.sign(sweep) * np.arange(0.02, abs(sweep), 0.04 / radius)
        points.append(np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)]))
        directions.append(np.column_stack([-np.sin(angle), np.cos(angle)]))
    return np.vstack(points), np.vstack(directions)


def ridge_points(camera: PinholeCamera, unknowns: FloatArray, ridges: Ridges) -> LinePoints:
    """Ridges as line points of the camera as it is held."""
    return LinePoints.from_pixels(_held(camera, unknowns), ridges.pixels)
