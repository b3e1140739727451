"""Compiled count of what a picture shows at the wall's feet that a pose predicts."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled

# states of a bearing; the order of the columns of `log_p`
CLOSE, AGREES, OFF, HIDDEN, BEYOND, NO_FLOOR = range(6)
# bounds between them, in units from the predicted foot, outwards positive
_CLOSE, _AGREES, _INWARDS, _OUTWARDS, _RIM = 0.3, 1.0, -6.0, 3.0, 2.5


@compiled(error_model="numpy")
def weigh_outline(
    residual: FloatArray,
    predicted: FloatArray,
    outermost: Int64Array,
    is_shown: UInt8Array,
    radius_px: FloatArray,
    unit_px: float,
    log_p: FloatArray,
    counts: Int64Array,
) -> float:
    """Count the bearings by what they show of a pose, and weigh a right pose against any other reason for it.

    Parameters
    ----------
    residual, predicted : (K,) float64
        As a fit gives them, pixels: distance of the floor's edge from the wall's foot, NaN where no edge or no wall,
        and the foot's image radius, NaN where no wall.
    outermost : (K,) int64
        Each bearing's outermost floor sample; -1 where none.
    is_shown : (K,) uint8
        0 where the bearing lies under the mask: it says nothing.
    radius_px : (M,) float64
        Image radius of the samples.
    unit_px : float
        A pixel of the paper's image.
    log_p : (2 N, 6) float64
        Logarithm of each state's probability by N conditions of a right pose, then by N of a wrong one.
    counts : (6,) int64
        Filled with the number of bearings in each state.

    Returns
    -------
    float
        Log-likelihood ratio of the likeliest right condition against the likeliest wrong one.
    """
    per_unit, half_step = 1.0 / unit_px, 0.5 * (radius_px[1] - radius_px[0])
    for state in range(counts.shape[0]):
        counts[state] = 0
    for k in range(residual.shape[0]):
        if is_shown[k] == 0:
            continue
        foot, column = predicted[k], outermost[k]
        has_edge = residual[k] == residual[k]
        if column < 0:
            state = NO_FLOOR
        elif not foot > 0.0:
            state = BEYOND
        else:
            rim = radius_px[column] + half_step - foot
            off = per_unit * (residual[k] if has_edge else rim)
            if off > _OUTWARDS:
                state = BEYOND
            elif off < _INWARDS or (not has_edge and abs(off) <= _RIM):
                state = HIDDEN
            elif not has_edge or abs(off) > _AGREES:
                state = OFF
            else:
                state = CLOSE if abs(off) <= _CLOSE else AGREES
        counts[state] += 1
    conditions = log_p.shape[0] // 2
    right, wrong = -np.inf, -np.inf
    for row in range(log_p.shape[0]):
        total = 0.0
        for state in range(counts.shape[0]):
            total += counts[state] * log_p[row, state]
        if row < conditions:
            right = max(right, total)
        else:
            wrong = max(wrong, total)
    return right - wrong
