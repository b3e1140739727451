"""Accuracy of the mirror camera's whole job on rendered images: pose, free space and ball, condition by condition.

Images: ssl_2001, 256 x 220, each condition of `sim2d.rendering.random_scenes.CONDITIONS` (what `robocup-vision render
--condition` draws): 400 each (--quick: 5, --full: 2000) with 0 to 8 boxes, and 120 (3, 400) nominal ones of 640 x
480. One setting of `Vision` for all; it forgets before every image. Everything below counts modulo a half turn about
the field's centre, and only the first candidate, never the one that truth likes better.

POSE. "5 cm/3 deg", "10 cm/5 deg": ratio of ALL images located that near. "mm", "deg": median errors of the located
ones. NEES: 3 degrees of freedom, over the located ones, so a consistent one has a mean of 3, a median of 2.37 and 95 %
inside the bound 7.81; wanted on the nominal set are a mean of 1.5 to 6 and 90 to 99 % inside. "hull" rows, for
comparison: the published method. Right half: of the nominal images in which at least 20 pixels within the usable
radius show the inside of a goal (by casting a ray through every second pixel at walls and boxes), the ratio whose
first candidate is the pose and not its half turn; images not located count as wrong.

FREE SPACE. A bearing is one of the directions of `Vision.grid` in one image. Its truth is the least exact free
range (`Scene.free_range_m`) over 33 rays across its sector; measured and true ranges become numbers of free rings,
the true one at most the rings that the image shows there. "within 1 cell": ratio of bearings whose numbers differ by
at most 1. "false, any": ratio of bearings more than one ring short of the truth; "false, line/shadow": those of them
whose blocking cell has a painted line or the hard shadow in it. "missed": of the pairs of a bearing and a box that is
the first thing on its rays and hides, from its foot to the top of its image, at least half of some cell (in image
radius and bearing), the ratio whose measured range reaches beyond the first such cell.

BALL. Half of the images have one in the open, 1.5 m away at most. "found": ratio of these in which it is reported
within 0.10 m of its place; "mm": median error of those; "false": ratio of the images without one in which one is
reported, with red and orange boxes in view.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from operator import itemgetter
from typing import Literal

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Kind, Pool, Table, percent, program, verdict
from field_models import Field, load_field
from robocup_vision import NotLocated, PoseEstimate, Vision
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import OmniCamera
from robocup_vision.evaluation.dataset import Truth
from robocup_vision.evaluation.scoring import FAIR_M, FAIR_RAD, Row, figures, pose_error
from robocup_vision.geometry import Pose2
from robocup_vision.localization.line_map import LineMap
from robocup_vision.perception.free_space import FreeSpace
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.random_scenes import CONDITIONS, sample
from sim2d.rendering.scene import Scene

RAYS_PER_SECTOR = 33
PIXEL_STRIDE = 2


@dataclass(frozen=True)
class Free:
    """Counts over an image's bearings."""

    bearings: int
    within_a_cell: int
    falsely_blocked: int
    by_line_or_shadow: int
    covered: int
    missed: int


def goal_pixels(scene: Scene, pose: Pose2, camera: OmniCamera) -> int:
    """Count the pixels within the usable radius whose ray meets the inside of a goal before anything else."""
    width, height = camera.size_px
    v, u = np.mgrid[:height:PIXEL_STRIDE, :width:PIXEL_STRIDE]
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    radius = np.hypot(*(pixels - camera.center_px).T)
    inner, outer = camera.usable_radius_px
    rays = camera.pixel_to_ray(pixels[(radius >= inner) & (radius <= outer)])
    horizontal = np.hypot(rays[:, 0], rays[:, 1])
    slope = rays[:, 2] / horizontal
    eye_height = float(camera.viewpoint_m[2])
    x, y = pose.transform(camera.offset_m)
    direction = np.arctan2(rays[:, 1], rays[:, 0]) + pose.theta_rad
    cos, sin = np.cos(direction), np.sin(direction)
    nearest = np.where(slope < 0, eye_height / np.maximum(-slope, 1e-9), np.inf)
    is_goal = np.zeros(len(rays), dtype=bool)
    panels = np.vstack([goal.panels for goal in scene.field.goals])
    things = [(wall.x0_m, wall.y0_m, wall.x1_m, wall.y1_m, wall.height_m) for wall in scene.walls()]
    for box in scene.boxes:
        corners = box.corners
        ends = np.hstack([corners, np.roll(corners, -1, axis=0)])
        things += [(x0, y0, x1, y1, box.height_m) for x0, y0, x1, y1 in ends.tolist()]
    for x0, y0, x1, y1, thing_height in things:
        ax, ay, bx, by = x0 - x, y0 - y, x1 - x, y1 - y
        cross_a, cross_b = ax * sin - ay * cos, bx * sin - by * cos
        with np.errstate(divide="ignore", invalid="ignore"):
            range_m = (ax * by - ay * bx) / (cross_a - cross_b)
        up = eye_height + range_m * slope
        hit = (cross_a * cross_b <= 0) & (range_m > 0) & (range_m < nearest) & (up >= 0) & (up <= thing_height)
        nearest[hit] = range_m[hit]
        panel = np.array([x0, y0, x1, y1])
        same = [np.abs(panels - way).max(axis=1).min() < 1e-6 for way in (panel, panel[[2, 3, 0, 1]])]
        # walls run counter-clockwise: their inside is on the left
        is_goal[hit] = any(same) and ax * by - ay * bx > 0
    return int(np.count_nonzero(is_goal)) * PIXEL_STRIDE**2


def judge_free_space(measured: FreeSpace, vision: Vision, scene: Scene, pose: Pose2) -> Free:
    """Compare the free ranges of one image with the exact ones, in cells."""
    grid = vision.grid
    bounds = grid.ring_bounds_m
    count, rings = len(grid.bearing_rad), len(bounds) - 1
    half = math.pi / count
    rays = (grid.bearing_rad[:, None] + np.linspace(-half, half, RAYS_PER_SECTOR) * (1 - 1e-6)).ravel()
    exact_m = scene.free_range_m(pose, rays).reshape(count, -1)
    seen = _seen_rings(vision)
    true_ring = np.minimum(np.clip(np.searchsorted(bounds, exact_m.min(axis=1), side="right") - 1, 0, rings), seen)
    # measured ranges are ring bounds
    ring = np.searchsorted(bounds, measured.range_m * (1 + 1e-9), side="right") - 1
    falsely = np.flatnonzero(ring < true_ring - 1)
    blamed = sum(_has_line_or_shadow(vision, scene, pose, int(ring[j]) * count + int(j)) for j in falsely)
    covered, missed = _boxes(vision, scene, pose, rays, exact_m, ring, seen)
    return Free(count, int(np.count_nonzero(np.abs(ring - true_ring) <= 1)), len(falsely), blamed, covered, missed)


@lru_cache(maxsize=4)
def _seen_rings(vision: Vision) -> npt.NDArray[np.int64]:
    """(J,) rings of each direction up to the last that the image shows."""
    cell, count = vision.grid.cell, len(vision.grid.bearing_rad)
    seen = np.zeros(count, dtype=np.int64)
    ring, direction = np.divmod(cell[cell >= 0], count)
    np.maximum.at(seen, direction, ring + 1)
    return seen


@lru_cache(maxsize=1)
def _line_map(field: Field) -> LineMap:
    return LineMap(field)


def _has_line_or_shadow(vision: Vision, scene: Scene, pose: Pose2, cell: int) -> bool:
    places = pose.transform(vision.polar.floor_m[vision.grid.cell == cell])
    if not len(places):
        return False
    # a sample as far from a line as its neighbours are from it still sees some of it
    spread = float(np.max(np.ptp(places, axis=0))) / max(math.sqrt(len(places)), 1.0)
    near_line = _line_map(scene.field).nearest(places).distance_m.min() <= scene.field.line_width_m / 2 + spread
    shadow = scene.light.shadow
    if shadow is None:
        return bool(near_line)
    along = places @ (math.cos(shadow.direction_rad), math.sin(shadow.direction_rad))
    return bool(near_line or np.any((along >= shadow.low_m) & (along <= shadow.high_m)))


def _boxes(
    vision: Vision,
    scene: Scene,
    pose: Pose2,
    rays: FloatArray,
    exact_m: FloatArray,
    ring: npt.NDArray[np.int64],
    seen: npt.NDArray[np.int64],
) -> tuple[int, int]:
    """Pairs of bearing and box that covers half a cell, and those of them in which it was missed."""
    bounds, eye_height = vision.grid.ring_bounds_m, float(vision.camera.viewpoint_m[2])
    assert isinstance(vision.camera, OmniCamera)
    curve = vision.camera.floor_range
    bounds_px = curve.radius_px(1.0 / bounds)
    walls_m = Scene(scene.field).free_range_m(pose, rays).reshape(exact_m.shape)
    covered = missed = 0
    for box in scene.boxes:
        alone_m = Scene(scene.field, boxes=(box,)).free_range_m(pose, rays).reshape(exact_m.shape)
        first = (alone_m < walls_m - 1e-9) & (alone_m <= exact_m + 1e-9)
        if not first.any():
            continue
        foot_px = np.where(first, curve.radius_px(1.0 / alone_m), np.inf)
        # its image ends at its top's near edge or beyond: at a height h it hides floor up to r H / (H - h)
        top_px = curve.radius_px((1 - box.height_m / eye_height) / alone_m) if box.height_m < eye_height else np.inf
        top_px = np.where(first, top_px, -np.inf)
        low, high = bounds_px[:-1], bounds_px[1:]
        overlap = np.minimum(top_px[..., None], high) - np.maximum(foot_px[..., None], low)
        ratio = np.maximum(overlap, 0.0).mean(axis=1) / (high - low)
        is_covered = (ratio >= 0.5) & (np.arange(len(low)) < seen[:, None])
        counts = is_covered.any(axis=1)
        covered += int(np.count_nonzero(counts))
        missed += int(np.count_nonzero(counts & (ring > is_covered.argmax(axis=1))))
    return covered, missed


Size = tuple[int, int]
Method = Literal["field", "hull"]
SMALL, LARGE = (256, 220), (640, 480)
FIELD = load_field("ssl_2001")
CHUNK = 20
MIN_GOAL_PIXELS = 20
BALL_FOUND_M = 0.10
# least ratios within 5 cm/3 deg and 10 cm/5 deg, greatest median in mm; the last of "miscalibrated" is only reported
POSE_TARGETS: dict[str, tuple[float, float, float]] = {
    "nominal": (1.0, 1.0, 1.5),
    "noisy": (0.995, 1.0, 3.5),
    "warm": (0.995, 1.0, 2.0),
    "cold": (0.995, 1.0, 2.0),
    "dark": (0.995, 1.0, 3.0),
    "crowd": (0.99, 0.995, 2.0),
    "bad_day": (0.98, 0.995, 5.0),
    "miscalibrated": (0.75, 0.95, math.inf),
    "nominal 640x480": (1.0, 1.0, 0.8),
}
HULL_ROWS = ("nominal", "crowd")
NEES_MEAN, NEES_INSIDE = (1.5, 6.0), (0.90, 0.99)
MIN_RIGHT_HALF = 0.99
MIN_WITHIN_CELL, MAX_FALSE, MAX_MISSED = 0.98, 0.005, 0.001
MIN_FOUND, MAX_BALL_ERROR_M, MAX_FALSE_BALLS = 0.98, 0.015, 0.005


@dataclass(frozen=True)
class Record:
    """What one image came to."""

    row: Row
    hull: Row | None
    goal_in_view: bool
    right_half: bool
    free: Free
    has_ball: bool
    ball_error_m: float | None


@lru_cache(maxsize=4)
def vision_for(size: Size, method: Method) -> Vision:
    """One `Vision` a process, size and method."""
    return Vision(FIELD, sekimori_camera(*size), method=method)


def measure(task: tuple[str, Size, int, range]) -> list[Record]:
    """Render and judge some images of one condition."""
    name, size, seed, indices = task
    condition, vision, camera = CONDITIONS[name], vision_for(size, "field"), sekimori_camera(*size)
    true_camera = condition.true_camera(camera)
    records = []
    for drawn in sample(FIELD, camera, condition, seed, 0, indices=indices):
        vision.forget()
        view = vision.look(drawn.frame)
        truth = drawn.pose
        ball_error_m = None
        if view.ball is not None:
            ball_error_m = math.inf
            if drawn.scene.ball is not None:
                place = truth.inverse().transform([drawn.scene.ball.x_m, drawn.scene.ball.y_m])
                ball_error_m = float(np.hypot(*(place - (view.ball.x_m, view.ball.y_m))))
        hull = None
        if name in HULL_ROWS and size == SMALL:
            by_hull = vision_for(size, "hull")
            by_hull.forget()
            hull = _pose_row(drawn.index, by_hull.look(drawn.frame).pose, truth)
        records.append(
            Record(
                row=_pose_row(drawn.index, view.pose, truth),
                hull=hull,
                goal_in_view=goal_pixels(drawn.scene, truth, true_camera) >= MIN_GOAL_PIXELS,
                right_half=isinstance(view.pose, PoseEstimate) and _is_right_half(view.pose.pose, truth),
                free=judge_free_space(view.free_space, vision, drawn.scene, truth),
                has_ball=drawn.scene.ball is not None,
                ball_error_m=ball_error_m,
            )
        )
    return records


def _pose_row(index: int, estimate: PoseEstimate | NotLocated, truth: Pose2) -> Row:
    known = Truth(truth.x_m, truth.y_m, truth.theta_rad)
    if not isinstance(estimate, PoseEstimate):
        return Row(str(index), truth=known, reason=estimate.reason)
    return Row(str(index), estimate, known, pose_error(estimate, known, symmetric=True))


def _is_right_half(pose: Pose2, truth: Pose2) -> bool:
    return sum(pose.error_to(truth)) < sum(pose.half_turn().error_to(truth))


def pose_line(table: Table, label: str, rows: Sequence[Row], *, judged: bool = True) -> None:
    """Print one condition's poses."""
    got = figures(rows)
    near, fair, millimetres, degrees = (
        got.within_5cm_3deg or 0.0,
        got.within_10cm_5deg or 0.0,
        math.inf if got.median_error_m is None else 1e3 * got.median_error_m,
        math.inf if got.median_error_rad is None else math.degrees(got.median_error_rad),
    )
    min_near, min_fair, max_mm = POSE_TARGETS[label]
    ok = near >= min_near and fair >= min_fair and millimetres <= max_mm
    target = f"{100 * min_near:g}/{100 * min_fair:g}" + (f"/{max_mm:g}" if math.isfinite(max_mm) else "/report")
    table.row(
        label if judged else f"  {label}, published method",
        f"{got.located}/{got.images}",
        percent(near),
        percent(fair),
        millimetres,
        degrees,
        got.nees_mean,
        got.nees_median,
        percent(got.nees_inside_95),
        target if judged else None,
        verdict(ok) if judged else None,
        samples=got.images,
    )


def print_outliers(records: dict[str, list[Record]]) -> None:
    """Print which images, as numbered by their condition and the seed, are not located or off by 10 cm/5 deg."""
    for label, found in records.items():
        rows = [record.row for record in found]
        far = [row for row in rows if row.error is None or not row.error.within(FAIR_M, FAIR_RAD)]
        if far:
            listed = ", ".join(
                f"{row.image} ({row.reason if row.error is None else f'{row.error.position_m:.2f} m'})" for row in far
            )
            print(f"not within 10 cm/5 deg in {label}: images {listed}")


def print_consistency(records: Sequence[Record]) -> None:
    """Print what only the nominal set is held to: consistent covariances, and the right half."""
    got = figures([record.row for record in records])
    mean, inside = got.nees_mean or math.inf, got.nees_inside_95 or 0.0
    in_view = [record for record in records if record.goal_in_view]
    ratio = sum(record.right_half for record in in_view) / max(len(in_view), 1)
    single = sum(len(r.row.estimate.candidates) == 1 for r in in_view if r.row.estimate is not None)
    is_honest, is_inside = NEES_MEAN[0] <= mean <= NEES_MEAN[1], NEES_INSIDE[0] <= inside <= NEES_INSIDE[1]
    rows = (
        ("NEES, mean", Kind.ERROR, f"{mean:.3g}", f"{NEES_MEAN[0]} to {NEES_MEAN[1]}", is_honest),
        ("NEES, ratio inside 95 %", Kind.RATE, percent(inside), "90 to 99", is_inside),
        (f"right half, goal in view in {len(in_view)}", Kind.RATE, percent(ratio), ">= 99", ratio >= MIN_RIGHT_HALF),
    )
    columns = "nominal, 256 x 220                     | measured: by row | target | verdict"
    table = Table(columns, name="consistency", samples=len(in_view))
    for name, kind, measured, target, ok in rows:
        table.row(name, measured, target, verdict(ok), kind=kind)
    one = percent(single / max(len(in_view), 1))
    table.row("  of these with one candidate only", one, None, None, kind=Kind.RATE)


def print_free_space(records: dict[str, list[Record]]) -> None:
    """Print the free space of each condition."""
    columns = (
        "condition        | bearings | within 1 cell: rate | false, any: loss | false, line/shadow: loss | boxes | "
        "missed: loss | verdict"
    )
    title = f"Free space: >= {MIN_WITHIN_CELL:.0%} within 1 cell, <= {MAX_FALSE:.1%} false by lines or shadows, "
    table = Table(columns, title + f"<= {MAX_MISSED:.1%} missed; ratios in %", name="free space")
    for label, found in records.items():
        frees = [record.free for record in found]
        bearings, covered = sum(f.bearings for f in frees), sum(f.covered for f in frees)
        within = sum(f.within_a_cell for f in frees) / bearings
        blamed = sum(f.by_line_or_shadow for f in frees) / bearings
        missed = sum(f.missed for f in frees) / max(covered, 1)
        ok = within >= MIN_WITHIN_CELL and blamed <= MAX_FALSE and missed <= MAX_MISSED
        falsely = sum(f.falsely_blocked for f in frees) / bearings
        ratios = (percent(within), percent(falsely), percent(blamed), str(covered), percent(missed))
        # the bearings of one image are no independent samples
        table.row(label, str(bearings), *ratios, verdict(ok), samples=len(frees))


def print_balls(records: dict[str, list[Record]]) -> None:
    """Print the balls of each condition."""
    title = f"Ball within 1.5 m: >= {MIN_FOUND:.0%} found, median <= {1e3 * MAX_BALL_ERROR_M:g} mm, "
    columns = "condition        | with ball | found %: rate | mm: error | without | false %: loss | verdict"
    table = Table(columns, title + f"<= {MAX_FALSE_BALLS:.1%} false", name="balls")
    for label, found in records.items():
        errors = [record.ball_error_m for record in found if record.has_ball]
        near = [error for error in errors if error is not None and error <= BALL_FOUND_M]
        without = [record.ball_error_m is not None for record in found if not record.has_ball]
        ratio, false = len(near) / max(len(errors), 1), sum(without) / max(len(without), 1)
        median_m = float(np.median(near)) if near else math.inf
        ok = ratio >= MIN_FOUND and median_m <= MAX_BALL_ERROR_M and false <= MAX_FALSE_BALLS
        cells = str(len(errors)), percent(ratio), 1e3 * median_m, str(len(without)), percent(false), verdict(ok)
        table.row(label, *cells, samples=min(len(errors), len(without)))


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Render, measure and print."""
    count, large = (5, 3) if arguments.quick else (2000, 400) if arguments.full else (400, 120)
    sets = [(name, name, SMALL, count) for name in CONDITIONS] + [("nominal 640x480", "nominal", LARGE, large)]
    vision_for(SMALL, "field")  # compiles once, for the workers to load
    records: dict[str, list[Record]] = {}
    tasks = [
        (label, (name, size, arguments.seed, range(first, min(first + CHUNK, total))))
        for label, name, size, total in sets
        for first in range(0, total, CHUNK)
    ]
    measured = zip((label for label, _ in tasks), pool.map(measure, [task for _, task in tasks]), strict=True)
    columns = (
        "condition         | located: rate | 5 cm/3 deg: rate | 10 cm/5 deg: rate | mm: error | deg: error | "
        "NEES mean | median: error | inside 95 %: rate | target | verdict"
    )
    table = Table(columns, "Pose: ratios of all images in %", name="poses", samples=count)
    for label, parts in groupby(measured, key=itemgetter(0)):
        records[label] = [record for _, part in parts for record in part]
        pose_line(table, label, [record.row for record in records[label]])
        by_hull = [record.hull for record in records[label] if record.hull is not None]
        if by_hull:
            pose_line(table, label, by_hull, judged=False)
    print_outliers(records)
    print_consistency(records["nominal"])
    print_free_space(records)
    print_balls(records)
