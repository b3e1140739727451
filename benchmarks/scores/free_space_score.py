"""Free space of a mirror camera against the exact one, cell by cell, and how much of a goal its image shows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from field_models import Field
from robocup_vision import Vision
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.free_space import FreeSpace
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
