"""Straight stretches of line in the line points of one frame, on the floor, without a pose.

Pairs of pieces that are parallel to the line between them propose lines. Each proposal is scored once by all pieces.
The points of the best are removed, and the next best follows. The search is deterministic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import BoolArray, FloatArray, Int64Array
from robocup_vision.perception.line_points import FloorCamera, LinePoints
from robocup_vision.perception.markings.line_pieces import LinePieces

# distances in the picture of the partners with which each piece proposes lines
_PAIRS_PX = (20.0, 60.0, 180.0)
_MAX_LINES = 40
_FIT_STEPS = 2
# least ratio of common pieces of two equivalent proposals
_ALIKE_RATIO = 0.8
# greatest distance of neighbouring points along a line without a gap
_GAP_PX = 8.0
_COVER_PX = 6.0
# least standard deviation of a line point across its line, and the number of neighbouring points that count as one
# independent sample
NOISE_PX, POINTS_PER_SAMPLE = 0.1, 2.0
# greatest deviation of a line from a straight one due to paint, carpet and lens, in line widths, and greatest distance
# of its points in addition to that
SLACK_WIDTHS, GATE_PX = 0.15, 1.5
# least number of points of a segment, and least length in the picture
MIN_POINTS, _MIN_PX = 10, 20.0
# least fraction of a segment's length in the picture on which points lie, and of its points in pieces that are parallel
# to it
_MIN_COVER, _MIN_ALONG = 0.75, 0.5
# least ratio of bare carpet in a gap between two lines; with less, something occludes one line
MIN_BARE_RATIO = 0.5
# least log-likelihood ratio of a line to an arc of the field's curvature
STRAIGHT_NATS = 4.0


def _axes(angle_rad: float) -> tuple[FloatArray, FloatArray]:
    """Return the unit normal (2,) of a line and its direction (2,), to the left of the normal."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([c, s]), np.array([-s, c])


@dataclass(frozen=True, slots=True, eq=False)
class Straight:
    """A straight stretch of line."""

    #: x cos(angle) + y sin(angle) = distance, robot frame
    angle_rad: float
    distance_m: float
    #: mean position of its points along the line, from the foot of the robot's perpendicular, to the left of the normal
    middle_m: float
    ends_m: tuple[float, float]  #: positions of its ends
    covariance: FloatArray  #: (2, 2) float64: of angle and distance, without the errors of the camera's attitude
    points: Int64Array  #: (P,) int64: indices of its line points

    @property
    def normal(self) -> FloatArray:
        """(2,) float64: unit normal."""
        return _axes(self.angle_rad)[0]

    @property
    def along(self) -> FloatArray:
        """(2,) float64: unit direction, to the left of the normal."""
        return _axes(self.angle_rad)[1]

    def at(self, along_m: FloatArray) -> FloatArray:
        """Return the places (..., 2) at positions (...) along the line."""
        return np.asarray(self.distance_m * self.normal + np.asarray(along_m)[..., None] * self.along)


def find_straight(
    points: LinePoints, pieces: LinePieces, camera: FloorCamera, line_width_m: float, radii_m: FloatArray
) -> tuple[list[Straight], BoolArray, BoolArray]:
    """Return the straight stretches of line, the one with most points first, and the points and pieces left for arcs.

    Parameters
    ----------
    radii_m : (R,) float64
        Radii of the field's arcs; a stretch that may be part of one is not returned.

    Returns
    -------
    list of Straight, (N,) bool, (E,) bool
        The stretches; masks of the points and of the pieces on none of them.
    """
    slack_m = SLACK_WIDTHS * line_width_m
    agrees = _proposals(pieces, slack_m)
    weight, found = pieces.weight.copy(), []
    # possible parts of arcs are tested once and left for arcs
    open_points, left_points = np.ones(len(points), dtype=np.bool_), np.ones(len(points), dtype=np.bool_)
    left_pieces = np.ones(len(pieces), dtype=np.bool_)
    for _ in range(_MAX_LINES):
        if not len(agrees):
            break
        score = agrees @ weight
        best = int(np.argmax(score))
        if score[best] < MIN_POINTS:
            break
        members = agrees[best] & (weight > 0)
        stretches = _stretches(points, pieces, members, open_points, camera, slack_m)
        for straight in stretches:
            on_it = _lies_on(pieces, straight, slack_m)
            open_points[straight.points], weight[on_it] = False, 0.0
            # the points of lines that cross this one are near it but in pieces of another direction
            along = pieces.weight[on_it].sum() / points.weight[straight.points].sum()
            if along >= _MIN_ALONG and not _may_be_arc(points, straight, radii_m):
                found.append(straight)
                left_points[straight.points], left_pieces[on_it] = False, False
        if not stretches:
            # equivalent proposals would not give a stretch, either
            alike = (agrees & members) @ weight >= _ALIKE_RATIO * score
            agrees = agrees[~alike]
    return sorted(found, key=lambda one: -len(one.points)), left_points, left_pieces


def _proposals(pieces: LinePieces, slack_m: float) -> BoolArray:
    """Return the inlier pieces (H, E) bool of each proposed line."""
    count = len(pieces)
    if count < 2:
        return np.zeros((0, count), dtype=np.bool_)
    x, y = pieces.floor_m.T
    u, v = pieces.pixels.T
    apart_px = np.hypot(u[:, None] - u, v[:, None] - v)
    along = pieces.is_along(x[:, None] - x, y[:, None] - y)
    pairs = along & along.T & (apart_px >= _PAIRS_PX[0] / 2)
    # long pairs are accurate for long lines, and short lines have only short ones
    nearest = [
        np.where(pairs, np.abs(np.log(apart_px + 1e-9) - math.log(px)), np.inf).argmin(axis=1) for px in _PAIRS_PX
    ]
    first, second = np.tile(np.arange(count), len(nearest)), np.concatenate(nearest)
    some = pairs[first, second]
    first, second = np.unique(np.sort(np.stack([first[some], second[some]]), axis=0), axis=1)
    way_x, way_y = x[second] - x[first], y[second] - y[first]
    length = np.maximum(np.hypot(way_x, way_y), 1e-9)
    normal_x, normal_y = (way_y / length)[:, None], (-way_x / length)[:, None]
    off_m = np.abs(normal_x * (x - x[first][:, None]) + normal_y * (y - y[first][:, None]))
    near = off_m <= GATE_PX * pieces.across_m_per_px(normal_x, normal_y) + slack_m
    return np.asarray(near & pieces.is_along(-normal_y, normal_x))


def _lies_on(pieces: LinePieces, straight: Straight, slack_m: float) -> BoolArray:
    """Return the pieces (E,) that belong to a stretch."""
    normal, along = straight.normal, straight.along
    off_m = np.abs(pieces.floor_m @ normal - straight.distance_m)
    at = pieces.floor_m @ along
    within = (at >= straight.ends_m[0] - slack_m) & (at <= straight.ends_m[1] + slack_m)
    near = off_m <= 2 * GATE_PX * pieces.across_m_per_px(normal[0], normal[1]) + slack_m
    return np.asarray(near & within & pieces.is_along(along[0], along[1]))


def scale_m(points: LinePoints, which: Int64Array, normal: FloatArray) -> FloatArray:
    """Return the motion (P,) of points along a floor normal for a step in the picture, metres for each pixel."""
    a, b, c, d = points.floor_per_px.reshape(-1, 4)[which].T
    return np.asarray(np.hypot(a * normal[0] + c * normal[1], b * normal[0] + d * normal[1]))


def fit_line(points: LinePoints, which: Int64Array, angle_rad: float) -> tuple[float, float, float, FloatArray]:
    """Fit a line to points with equal errors in pixels.

    Returns
    -------
    float, float, float, (2, 2) float64
        Angle, distance, mean position along the line, and covariance of angle and distance; see `Straight`.
    """
    floor, own = points.floor_m[which], points.weight[which]
    for _ in range(_FIT_STEPS):
        normal, along = _axes(angle_rad)
        scale = scale_m(points, which, normal)
        weight = own / scale**2
        total = weight.sum()
        at, off = floor @ along, floor @ normal
        middle, distance = float(weight @ at / total), float(weight @ off / total)
        spread = float(weight @ (at - middle) ** 2)
        slope = float(weight @ ((at - middle) * (off - distance))) / max(spread, 1e-12)
        center = distance * normal + middle * along
        angle_rad -= math.atan(slope)
    normal, along = _axes(angle_rad)
    distance, middle = float(center @ normal), float(center @ along)
    residual_px = (floor @ normal - distance) / scale
    noise_px = max(NOISE_PX, math.sqrt(float(own @ residual_px**2 / own.sum())))
    variance = POINTS_PER_SAMPLE * noise_px**2
    turn = variance / max(spread, 1e-12)
    covariance = np.array([[turn, middle * turn], [middle * turn, variance / total + middle**2 * turn]])
    return angle_rad, distance, middle, covariance


def _near(points: LinePoints, angle_rad: float, distance_m: float, which: Int64Array, slack_m: float) -> Int64Array:
    """Return the points that lie on a line."""
    normal, _ = _axes(angle_rad)
    off_m = np.abs(points.floor_m[which] @ normal - distance_m)
    return which[off_m <= GATE_PX * scale_m(points, which, normal) + slack_m]


def _stretches(
    points: LinePoints, pieces: LinePieces, members: BoolArray, free: BoolArray, camera: FloorCamera, slack_m: float
) -> list[Straight]:
    """Return the stretches of a proposed line, divided only where there is bare carpet between them."""
    places = pieces.floor_m[members]
    middle = places.mean(axis=0)
    way = np.linalg.svd(places - middle)[2][0]
    angle = math.atan2(-way[0], way[1])
    distance = float(middle @ [math.cos(angle), math.sin(angle)])
    left = np.flatnonzero(free)
    chosen = left
    for _ in range(3):
        chosen = _near(points, angle, distance, left, slack_m)
        if len(chosen) < MIN_POINTS:
            return []
        angle, distance, _, _ = fit_line(points, chosen, angle)
    found = []
    for run in _runs(points, chosen, angle, distance, camera):
        if len(run) < MIN_POINTS:
            continue
        straight = stretch_of(points, run, angle)
        if _is_whole(points, straight, camera):
            found.append(straight)
    return found


def stretch_of(points: LinePoints, which: Int64Array, angle_rad: float) -> Straight:
    """Return the stretch of line through points; `angle_rad` is an approximate direction."""
    angle, distance, middle, covariance = fit_line(points, which, angle_rad)
    at = points.floor_m[which] @ _axes(angle)[1]
    return Straight(angle, distance, middle, (float(at.min()), float(at.max())), covariance, which)


def _runs(
    points: LinePoints, which: Int64Array, angle_rad: float, distance_m: float, camera: FloorCamera
) -> list[Int64Array]:
    """Divide the points of a line where bare carpet lies between them."""
    normal, along = _axes(angle_rad)
    at = points.floor_m[which] @ along
    order = np.argsort(at, kind="stable")
    which, at = which[order], at[order]
    step_px = np.hypot(*np.diff(points.pixels[which], axis=0).T)
    gaps = np.flatnonzero(step_px > _GAP_PX)
    # length in the picture of the points between gaps
    extent_px = np.add.reduceat(
        np.append(np.where(step_px > _GAP_PX, 0.0, step_px), 0.0), np.concatenate([[0], gaps + 1])
    )
    cuts = []
    for index, gap in enumerate(gaps.tolist()):
        between = np.linspace(at[gap], at[gap + 1], 34)[1:-1]
        pixels = camera.floor_to_pixel(distance_m * normal + between[:, None] * along)
        # a gap longer than the visible line on either side is not attributed to occlusion
        if step_px[gap] > extent_px[index : index + 2].min() or is_bare(points, pixels).mean() > MIN_BARE_RATIO:
            cuts.append(gap + 1)
    return np.split(which, cuts)


def is_bare(points: LinePoints, pixels: FloatArray) -> BoolArray:
    """Whether pixels (..., 2) show bare carpet."""
    if points.bare_floor is None:
        return np.zeros(pixels.shape[:-1], dtype=np.bool_)
    return marked_at(points.bare_floor, pixels)


def marked_at(picture: npt.NDArray[np.generic], pixels: FloatArray) -> BoolArray:
    """Whether a picture (H, W) is non-zero at pixels (..., 2); false outside."""
    height, width = picture.shape
    shown = np.asarray(np.isfinite(pixels).all(axis=-1))
    at = np.rint(np.where(shown[..., None], pixels, -1.0)).astype(np.int64)
    u, v = at[..., 0], at[..., 1]
    inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
    return np.asarray(inside & (picture[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)] != 0))


def _is_whole(points: LinePoints, straight: Straight, camera: FloorCamera) -> bool:
    """Whether a stretch is long enough in the picture and mostly covered by points."""
    low, high = straight.ends_m
    path = camera.floor_to_pixel(straight.at(np.linspace(low, high, 65)))
    way_px = np.append(0.0, np.cumsum(np.nan_to_num(np.hypot(*np.diff(path, axis=0).T))))
    if way_px[-1] < _MIN_PX:
        return False
    at = np.interp(points.floor_m[straight.points] @ straight.along, np.linspace(low, high, 65), way_px)
    count = max(int(way_px[-1] / _COVER_PX), 1)
    covered = np.bincount(np.minimum((at / way_px[-1] * count).astype(np.int64), count - 1), minlength=count) > 0
    return bool(covered.mean() >= _MIN_COVER)


def _may_be_arc(points: LinePoints, straight: Straight, radii_m: FloatArray) -> bool:
    """Whether the points of a stretch may lie on an arc of one of the radii."""
    if not len(radii_m):
        return False
    floor, scale = points.floor_m[straight.points], scale_m(points, straight.points, straight.normal)
    weight = points.weight[straight.points] / scale**2 / POINTS_PER_SAMPLE
    at, off = floor @ straight.along - straight.middle_m, floor @ straight.normal - straight.distance_m
    basis = np.stack([np.ones_like(at), at], axis=1)
    gram = (basis.T * weight) @ basis

    def cost(values: FloatArray) -> float:
        fit = np.linalg.lstsq(gram, (basis.T * weight) @ values, rcond=None)[0]
        return float(weight @ (values - basis @ fit) ** 2)

    noise2 = max(NOISE_PX**2, cost(off) / max(float(len(at)) / POINTS_PER_SAMPLE, 1.0))
    nats = 0.5 * (min(cost(off - s * at**2 / (2 * r)) for r in radii_m for s in (-1, 1)) - cost(off)) / noise2
    return nats < STRAIGHT_NATS


def middle_shifts_m(camera: FloorCamera, places_m: FloatArray, normals: FloatArray, line_width_m: float) -> FloatArray:
    """Return the offsets (P, 2) of the point midway between a line's edges in the picture from its middle, metres.

    Parameters
    ----------
    places_m, normals : (P, 2) float64
        Middles of the line, and the directions across it, robot frame.
    """
    half = 0.5 * line_width_m * normals
    midway = 0.5 * (camera.floor_to_pixel(places_m + half) + camera.floor_to_pixel(places_m - half))
    return np.asarray(np.nan_to_num(camera.pixel_to_floor(midway) - places_m))


def fit_middles(
    points: LinePoints, lines: list[Straight], camera: FloorCamera, line_width_m: float
) -> tuple[LinePoints, list[Straight]]:
    """Return line points corrected to the middles of their lines, and the lines refitted to them."""
    floor = points.floor_m.copy()
    for line in lines:
        places = floor[line.points]
        normals = np.broadcast_to(line.normal, places.shape)
        floor[line.points] -= middle_shifts_m(camera, places, normals, line_width_m)
    points = replace(points, floor_m=floor)
    return points, [stretch_of(points, line.points, line.angle_rad) for line in lines]
