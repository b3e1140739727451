"""Sub-pixel silhouette edges of posts, bar and feet, measured where a pose says they should be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import FloatArray
from robocup_vision.kernels.goal_edges import measure_edges
from robocup_vision.localization.goal_geometry import (
    BAR_BOTTOM,
    BAR_TOP,
    EDGES,
    HEADING,
    HEIGHT,
    LEFT_INNER,
    LEFT_OUTER,
    ROLL,
    TILT,
    GoalShape,
    IdealView,
    X,
    Y,
    camera_rotation,
    foot_points,
    silhouette_normals,
)

FOOT_OFFSETS = np.array([-0.7, -0.35, 0.0, 0.35, 0.7])
# the floor in front of a foot is told by its greenness: brightness steps at sun patches and lines as well
_FOOT_TOWARDS = np.array([0.5, -1.0, 0.5])
_SPACING_PX = 2.0
_MOST_SAMPLES = 40


@dataclass(frozen=True, slots=True)
class Look:
    """What paint looks like beside what surrounds it.

    Parameters
    ----------
    towards : (3,) float64
        Colour difference (BGR) paint - surroundings that every edge agrees with in sign.
    glare : float
        Samples whose paint is brighter than this in all channels are dropped.
    grey : float
        How much of the difference in brightness counts, see `kernels.goal_edges.measure_edges`.
    """

    towards: FloatArray
    glare: float
    grey: float


@dataclass(frozen=True, slots=True)
class EdgeSamples:
    """What was measured, in ideal pixels (distortion taken out), ready for `kernels.goal_fit.fit_goal`.

    Parameters
    ----------
    edge : (N,) int64
        Which silhouette edge each sample belongs to (order of goal_geometry).
    uv : (N, 2) float64
        Where it was found.
    foot_post, foot_at : (M,) int64
        Post (0 left, 1 right) of each foot sample, and its index into `FOOT_OFFSETS`.
    foot_uv, foot_direction : (M, 2) float64
        Where the paint ends, and along which direction that was measured.
    sigma : (N + M,) float64
        Noise of both, pixels.
    expected : (6,) int64
        How many samples each edge has inside the image, found or not, less those in glare.
    """

    edge: npt.NDArray[np.int64]
    uv: FloatArray
    foot_post: npt.NDArray[np.int64]
    foot_at: npt.NDArray[np.int64]
    foot_uv: FloatArray
    foot_direction: FloatArray
    sigma: FloatArray
    expected: npt.NDArray[np.int64]


def to_ideal(camera: PinholeCamera, pixels: FloatArray) -> FloatArray:
    """Pixels (..., 2) as a lens without distortion would show them."""
    if not any(camera.distortion):
        return pixels
    ray = camera.pixel_to_camera_ray(pixels)
    return np.asarray(np.array(camera.center_px) - np.array(camera.focal_px) * ray[..., 1:] / ray[..., :1])


def from_ideal(camera: PinholeCamera, ideal: FloatArray) -> FloatArray:
    """Image pixels (..., 2) of ideal ones."""
    if not any(camera.distortion):
        return ideal
    slopes = (ideal - np.array(camera.center_px)) / np.array(camera.focal_px)
    return camera.camera_ray_to_pixel(np.concatenate([np.ones((*slopes.shape[:-1], 1)), -slopes], axis=-1))


def edge_segments(shape: GoalShape, unknowns: FloatArray) -> FloatArray:
    """End points (6, 2, 3), field frame, of the stretches on which each silhouette edge stands free.

    Posts from a radius above the floor to a radius below the bar, the bar's top over its whole length and its lower
    edge between the posts.
    """
    normals = silhouette_normals(shape, unknowns)
    r, left, right = shape.radius_m, *shape.post_y_m
    ends = np.empty((EDGES, 2, 3))
    for e in range(EDGES):
        if e < BAR_TOP:
            y = left if e in (LEFT_OUTER, LEFT_INNER) else right
            top = shape.height_m + (-2 * r if e % 3 else 0.5 * r)  # the outer edges go on over the bar's end
            ends[e] = [[shape.line_x_m, y, 0.7 * r], [shape.line_x_m, y, top]]
        else:
            trim = 2 * r if e == BAR_BOTTOM else 0.0
            ends[e] = [[shape.line_x_m, left - trim, shape.height_m], [shape.line_x_m, right + trim, shape.height_m]]
        ends[e] += r * normals[e]
    return ends


def measure(
    image: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    view: IdealView,
    shape: GoalShape,
    unknowns: FloatArray,
    reach_px: float,
    look: Look,
) -> EdgeSamples | None:
    """Measure all silhouette edges and feet within `reach_px` of where `unknowns` put them.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    camera, view : PinholeCamera, IdealView
        The camera, and the same without distortion.
    shape : GoalShape
        The goal.
    unknowns : (8,) float64
        Where to look, see goal_geometry.
    reach_px : float
        How far to both sides.
    look : Look
        Of the paint.

    Returns
    -------
    EdgeSamples or None
        None where the goal is not in front of the camera.
    """
    rotation = camera_rotation(unknowns[HEADING], unknowns[TILT], unknowns[ROLL])
    eye = np.array([unknowns[X], unknowns[Y], unknowns[HEIGHT]])
    feet = foot_points(shape, unknowns, FOOT_OFFSETS).reshape(-1, 3)
    above = feet + np.array([0.0, 0.0, 0.5 * shape.radius_m])
    points = np.concatenate([edge_segments(shape, unknowns).reshape(-1, 3), feet, above])
    ray = (points - eye) @ rotation
    if not (ray[:, 0] > 0.05).all():
        return None
    ideal = np.array(view.center_px) - np.array(view.focal_px) * ray[:, 1:] / ray[:, :1]
    pixels = from_ideal(camera, ideal)
    ends = pixels[: 2 * EDGES].reshape(EDGES, 2, 2)
    width, height = camera.size_px
    starts, normals, edges, expected = [], [], [], np.zeros(EDGES, np.int64)
    thickness = np.empty(EDGES)
    for e in range(EDGES):
        a, b = ends[e]
        length = float(np.hypot(*(b - a)))
        if not 1.0 < length < 1e4:
            continue
        count = int(np.clip(length / _SPACING_PX, 4, _MOST_SAMPLES))
        at = a + (b - a) * ((np.arange(count) + 0.5) / count)[:, None]
        direction = (b - a) / length
        normal = np.array([direction[1], -direction[0]])
        partner = ends[e ^ 1].mean(axis=0)
        if normal @ (partner - a) > 0:
            normal = -normal
        thickness[e] = abs(normal @ (partner - a))
        inside = (at[:, 0] > 3) & (at[:, 0] < width - 4) & (at[:, 1] > 3) & (at[:, 1] < height - 4)
        at = at[inside]
        starts.append(at)
        normals.append(np.broadcast_to(normal, at.shape))
        edges.append(np.full(len(at), e))
        expected[e] = len(at)
    foot_pixels = pixels[2 * EDGES : 2 * EDGES + 2 * len(FOOT_OFFSETS)]
    down = foot_pixels - pixels[2 * EDGES + 2 * len(FOOT_OFFSETS) :]
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    starts.append(foot_pixels)
    normals.append(down)
    edge = np.concatenate(edges) if edges else np.empty(0, np.int64)
    start = np.ascontiguousarray(np.concatenate(starts))
    normal_all = np.ascontiguousarray(np.concatenate(normals))
    n = len(edge)
    inside_px = np.full(len(start), 4.0)
    inside_px[:n] = 0.5 * thickness[edge]
    along = np.empty((len(start), 3))
    along[:n], along[n:] = look.towards, _FOOT_TOWARDS
    keep = np.ones(len(start))
    keep[:n] = look.grey
    offset, contrast, sigma = np.empty(len(start)), np.empty(len(start)), np.empty(len(start))
    measure_edges(
        image,
        start,
        normal_all,
        np.full(len(start), reach_px),
        inside_px,
        along,
        look.glare,
        keep,
        offset,
        contrast,
        sigma,
    )
    found = np.isfinite(offset)
    expected -= np.bincount(edge[contrast[:n] < 0], minlength=EDGES)
    where = to_ideal(camera, start[found] + normal_all[found] * offset[found, None])
    is_edge = np.arange(len(start)) < n
    edge_found, foot_found = found[:n], found[n:]
    return EdgeSamples(
        edge[edge_found].astype(np.int64),
        np.ascontiguousarray(where[is_edge[found]]),
        np.repeat([0, 1], len(FOOT_OFFSETS))[foot_found],
        np.tile(np.arange(len(FOOT_OFFSETS)), 2)[foot_found],
        np.ascontiguousarray(where[~is_edge[found]]),
        np.ascontiguousarray(normal_all[n:][foot_found]),
        sigma[found],
        expected,
    )
