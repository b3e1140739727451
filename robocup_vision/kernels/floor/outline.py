"""All steps from a frame to the floor's outline and marks in one compiled call.

Separate calls would unpack the arguments and release Python's lock each time, which costs as much as a step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int8Array, Int32Array, Int64Array, UInt8Array, UInt16Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.floor.free_floor import passable
from robocup_vision.kernels.floor.free_ranges import sum_near
from robocup_vision.kernels.floor.polar import classify, outer_boundary
from robocup_vision.kernels.floor.radial_edges import EdgeSearch, Rays, radial_edges
from robocup_vision.kernels.floor.unrolled import unroll


class OutlineRules(NamedTuple):
    """Sample places and bounds, the same for all frames of a camera.

    Parameters
    ----------
    valid, hidden : (K, M), (H, W) or (0, 0) uint8
        As in `outer_boundary` and `radial_edges`.
    center_u, center_v, step_u, step_v
        As in `Rays`.
    radius_px : (M,) float64
        Image radius of each column.
    column_step_px, half_width : float
        As in `EdgeSearch`.
    certain, gap, min_strip : int
        As in `outer_boundary`.
    line_columns, line_rows, columns_in_use
        As in `passable`.
    """

    valid: UInt8Array
    hidden: UInt8Array
    center_u: float
    center_v: float
    step_u: FloatArray
    step_v: FloatArray
    radius_px: FloatArray
    column_step_px: float
    half_width: float
    certain: int
    gap: int
    min_strip: int
    line_columns: Int32Array
    line_rows: Int32Array
    columns_in_use: int


@compiled
def read_floor(
    frame: UInt8Array,
    places: Int32Array,
    packing: UInt16Array,
    floor_llr: Int8Array,
    rules: OutlineRules,
    min_contrast: float,
    samples: UInt8Array,
    llr: Int8Array,
    outermost: Int64Array,
    edge_px: FloatArray,
    marks: UInt8Array,
) -> tuple[float, int]:
    """Unroll a frame, find the outermost floor of each bearing and its edge, and mark what can be driven over.

    Parameters
    ----------
    frame, places
        As in `unroll`.
    packing, floor_llr
        As in `classify`.
    rules : OutlineRules
        Rules of the camera; may be a plain tuple.
    min_contrast : float
        Smallest colour difference (counts) that is an edge.
    samples, llr : (K, M, 3) uint8, (K, M) int8
        Filled by `unroll` and `classify`.
    outermost, edge_px, marks : (K,) int64, (K,) float64, (K, M) uint8
        Filled by `outer_boundary`, `radial_edges` and `passable`.

    Returns
    -------
    (float, int)
        Result of `classify`, and the sum of the likelihood ratios in the nearest third of the columns.
    """
    rules = OutlineRules(*rules)
    unroll(frame, places, samples)
    ring = classify(samples, packing, floor_llr, rules.valid, llr)
    outer_boundary(llr, rules.valid, rules.certain, rules.gap, rules.min_strip, outermost)
    start_px = np.full(outermost.shape[0], np.nan)
    for k in range(outermost.shape[0]):
        if outermost[k] >= 0:
            start_px[k] = rules.radius_px[outermost[k]]
    rays = Rays(rules.center_u, rules.center_v, rules.step_u, rules.step_v, start_px)
    search = EdgeSearch(rules.column_step_px, rules.half_width, min_contrast)
    radial_edges(frame, rules.hidden, rays, search, edge_px)
    is_ring = variable(1) > 0
    widest = rules.line_columns, rules.line_rows
    passable(samples, llr, rules.valid, widest[0], widest[1], rules.columns_in_use, is_ring, outermost, marks)
    return ring, sum_near(llr, llr.shape[1] // 3)
