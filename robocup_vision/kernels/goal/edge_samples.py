"""Samples of a goal's edges and feet, measured where they are due: a step of colour, with paint just inside."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.goal.edge_places import EdgePlaces, spread_samples
from robocup_vision.kernels.goal.edges import EdgeOffsets, EdgeStarts, measure_edges

_EDGES = 6


class DueEdges(NamedTuple):
    """Where edges are measured.

    Parameters
    ----------
    points : (12 + 2 * feet, 2) float64
        Of `goal_points`, in image pixels.
    feet : int
        How many of them are feet.
    spacing_px, max_samples : float, int
        Between samples on an edge, and their greatest number.
    reach_px : float
        Length of the search to both sides.
    """

    points: FloatArray
    feet: int
    spacing_px: float
    max_samples: int
    reach_px: float


class EdgeLook(NamedTuple):
    """What edges look like.

    Parameters
    ----------
    towards, foot_towards : (3,) float64
        Colour difference (BGR) of paint and surroundings, and of paint and carpet.
    glare, grey : float
        See `measure_edges`.
    paint : (h, w) uint8
        Non-zero on paint, perhaps of reduced size: edges count only where it is just inside. (0, 0): anywhere.
    paint_depth_px : float
        How far inside.
    """

    towards: FloatArray
    foot_towards: FloatArray
    glare: float
    grey: float
    paint: UInt8Array
    paint_depth_px: float


class FoundEdges(NamedTuple):
    """The samples found, with room for six times the greatest number and the feet.

    Parameters
    ----------
    edge : (N,) int64
        Silhouette edge of each; of a foot its number.
    uv, normals : (N, 2) float64
        Image pixels, and unit directions that point out of the object.
    sigma : (N,) float64
        Noise, pixels.
    expected : (6,) int64
        Places on each edge inside the image, less those in glare.
    """

    edge: Int64Array
    uv: FloatArray
    normals: FloatArray
    sigma: FloatArray
    expected: Int64Array


@compiled
def _is_painted(paint: UInt8Array, u: float, v: float) -> bool:
    """Whether there is paint at a pixel of the mask, or at the nearest one of its border."""
    column = min(max(int(round(u)), 0), paint.shape[1] - 1)
    row = min(max(int(round(v)), 0), paint.shape[0] - 1)
    return bool(paint[row, column] > 0)


@compiled
def sample_edges(image: UInt8Array, due: DueEdges, look: EdgeLook, found: FoundEdges) -> tuple[int, int]:
    """Measure edges and feet, and keep those that are there.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    due, look : DueEdges, EdgeLook
        Where, and what.
    found : FoundEdges
        Results: edges, then feet.

    Returns
    -------
    (int, int)
        How many edge samples and how many feet there are.
    """
    capacity = found.edge.shape[0]
    places = EdgePlaces(
        np.empty((capacity, 2)),
        np.empty((capacity, 2)),
        np.empty(capacity, np.int64),
        np.empty(capacity),
        found.expected,
    )
    size = (image.shape[1], image.shape[0])
    count = spread_samples(due.points, due.feet, size, due.spacing_px, due.max_samples, places)
    edges = count - due.feet
    starts = EdgeStarts(
        places.starts[:count],
        places.normals[:count],
        np.full(count, due.reach_px),
        places.inside[:count],
        np.empty((count, 3)),
        np.empty(count),
    )
    for n in range(count):
        copy_vector(look.towards if n < edges else look.foot_towards, starts.towards[n])
        starts.grey[n] = look.grey if n < edges else 1.0
    offsets = EdgeOffsets(np.empty(count), np.empty(count), np.empty(count))
    measure_edges(image, starts, look.glare, offsets)
    scale = look.paint.shape[1] / image.shape[1]
    seen, feet = variable(0), variable(0)
    for n in range(count):
        if n < edges and offsets.contrast[n] < 0.0:
            found.expected[places.edge[n]] -= 1
        offset = offsets.offset[n]
        if math.isnan(offset):
            continue
        u, v = starts.uv[n, 0] + starts.normals[n, 0] * offset, starts.uv[n, 1] + starts.normals[n, 1] * offset
        if look.paint.shape[0]:
            depth = min(max(starts.inside[n], 1.0), look.paint_depth_px)
            inner_u, inner_v = u - depth * starts.normals[n, 0], v - depth * starts.normals[n, 1]
            if not _is_painted(look.paint, scale * inner_u, scale * inner_v):
                continue
        at = seen + feet
        found.edge[at] = places.edge[n] if n < edges else n - edges
        found.uv[at, 0], found.uv[at, 1] = u, v
        copy_vector(starts.normals[n], found.normals[at])
        found.sigma[at] = offsets.sigma[n]
        if n < edges:
            seen += 1
        else:
            feet += 1
    return seen, feet


@compiled
def weigh_samples(
    edge: Int64Array, foot_post: Int64Array, sigma: FloatArray, errors: tuple[float, float, float], weighed: FloatArray
) -> None:
    """Let the samples' noise include what their edge as a whole may be off.

    Parameters
    ----------
    edge, foot_post : (N,), (M,) int64
        Of the samples.
    sigma : (N + M,) float64
        Noise of each alone, pixels.
    errors : (float, float, float)
        Of one sample beside its noise, of a whole edge, and of a whole foot, pixels.
    weighed : (N + M,) float64
        Result.
    """
    single, whole, foot = errors[0] ** 2, errors[1] ** 2, errors[2] ** 2
    per_edge, per_foot = np.zeros(_EDGES), np.zeros(2)
    count = edge.shape[0]
    for n in range(count):
        per_edge[edge[n]] += 1.0
    for n in range(foot_post.shape[0]):
        per_foot[foot_post[n]] += 1.0
    for n in range(count):
        weighed[n] = math.sqrt(sigma[n] ** 2 + single + whole * per_edge[edge[n]])
    for n in range(foot_post.shape[0]):
        weighed[count + n] = math.sqrt(sigma[count + n] ** 2 + single + foot * per_foot[foot_post[n]])
