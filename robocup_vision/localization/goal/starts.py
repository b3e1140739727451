"""Starts of a fit from posts found as strips: rough samples, cameras of all obliquenesses, rows of the bar."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.paint.strips import mean_along
from robocup_vision.localization.goal.edges import FOOT_OFFSETS, EdgeSamples
from robocup_vision.localization.goal.fit import GoalModel
from robocup_vision.localization.goal.geometry import BAR_TOP, EDGES, HEADING, HEIGHT, TILT, X, Y, project
from robocup_vision.perception.goal_region import Strip


def strip_samples(camera: PinholeCamera, posts: Sequence[tuple[int, Strip]]) -> EdgeSamples:
    """Take rough samples of posts' edges and feet from the strips they were found as (0 the left post, 1 the right)."""
    edge, uv, feet = [], [], []
    for post, strip in posts:
        for v in np.linspace(strip.top + 0.3 * (strip.bottom - strip.top), strip.bottom, 5):
            edge += [2 * post, 2 * post + 1]
            uv += [(u, v) for u in strip.edges_at(v)]
        if math.isfinite(strip.foot):
            feet.append((post, strip.axis_at(strip.foot), strip.foot))
    return EdgeSamples(
        np.array(edge),
        camera.ideal_pixels(np.array(uv, dtype=np.float64)),
        np.array([foot[0] for foot in feet], dtype=np.int64),
        np.full(len(feet), len(FOOT_OFFSETS) // 2, dtype=np.int64),
        camera.ideal_pixels(np.array([foot[1:] for foot in feet], dtype=np.float64).reshape(-1, 2)),
        np.tile([0.0, 1.0], (len(feet), 1)),
        np.array([1.0] * len(edge) + [1.5] * len(feet)),
        np.full(EDGES, 5),
    )


def start_by_posts(model: GoalModel, left: Strip, right: Strip) -> FloatArray:
    """Return a camera (8,) that sees both posts where they are: placed by the posts' own widths."""
    fu, fv = model.view.focal_px
    cu, cv = model.view.center_px
    low_left, low_right = (s.foot if math.isfinite(s.foot) else s.bottom for s in (left, right))
    a, b = left.axis_at(low_left), right.axis_at(low_right)
    half, line = model.shape.width_m / 2, model.shape.line_x_m
    near_left = 2 * model.shape.radius_m * fu / max(left.width_at(left.bottom), 1.0)
    near_right = 2 * model.shape.radius_m * fu / max(right.width_at(right.bottom), 1.0)
    y = float(np.clip((near_right**2 - near_left**2) / (4 * half), -near_left - half, near_left + half))
    ahead = math.sqrt(max(near_left**2 - (half - y) ** 2, 0.04))
    p = model.prior.copy()
    p[X], p[Y] = line - ahead, y
    # the heading is the mean of those by both posts' bearings
    bearings = math.atan2(half - y, ahead) + math.atan2(-half - y, ahead)
    p[HEADING] = (bearings + math.atan((a - cu) / fu) + math.atan((b - cu) / fu)) / 2
    p[TILT] = -math.atan(p[HEIGHT] / math.hypot(ahead, y)) + math.atan(((low_left + low_right) / 2 - cv) / fv)
    return p


def with_bar(samples: EdgeSamples, bar_px: FloatArray) -> EdgeSamples:
    """Rough samples with points (K, 2) on the bar's upper edge, ideal pixels, added."""
    n, k = len(samples.edge), len(bar_px)
    return replace(
        samples,
        edge=np.append(samples.edge, np.full(k, BAR_TOP)),
        uv=np.vstack([samples.uv, bar_px]),
        sigma=np.insert(samples.sigma, n, np.ones(k)),
    )


def bar_rows(
    paint: npt.NDArray[np.uint8], scale: float, model: GoalModel, p: FloatArray, most: int
) -> list[FloatArray]:
    """Propose the bar's upper edge, best first: points (5, 2), ideal pixels, on the line between the posts.

    Parameters
    ----------
    paint : (h, w) uint8
        Bright where paint is; `scale` frame pixels a pixel.
    p : (8,) float64
        Unknowns from the posts alone.
    most : int
        Greatest number of results.
    """
    foot_left, top_left, top_right, foot_right = project(model.view, p, model.shape.corners)
    up_left, up_right = top_left - foot_left, top_right - foot_right
    height = min(float(np.hypot(*up_left)), float(np.hypot(*up_right)))
    if not (math.isfinite(height) and height > 4):
        return []
    thick = height * 2 * model.shape.radius_m / model.shape.height_m
    step = min(0.25 * thick, 1.0) / height
    rise = np.arange(0.6, 1.45, step)
    start = foot_left + rise[:, None] * up_left
    end = foot_right + rise[:, None] * up_right
    mean = np.empty(len(rise))
    mean_along(paint, (start + 0.5) / scale - 0.5, (end + 0.5) / scale - 0.5, mean)
    half = max(1, round(0.5 * thick / height / step))
    # brighter than what is above it; below it the net's bar may follow
    sums = np.concatenate([[0.0], np.cumsum(mean)])
    response = np.full(len(mean), -np.inf)
    at = np.arange(half, len(mean) - 3 * half)
    if len(at) == 0:
        return []
    response[at] = (sums[at + half] - sums[at - half]) / (2 * half) - (sums[at + 3 * half] - sums[at + half]) / (
        2 * half
    )
    found = []
    for _ in range(most):
        best = int(np.argmax(response))
        if not response[best] > 6.0:
            break
        k = min(best + half, len(rise) - 1)
        found.append(start[k] + (end[k] - start[k]) * np.linspace(0.05, 0.95, 5)[:, None])
        response[max(0, best - half) : best + half + 1] = -np.inf
    return found
