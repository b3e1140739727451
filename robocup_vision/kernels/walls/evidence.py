"""Compiled likelihood ratio of a pose from the floor's edge at the predicted feet of walls."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled

# states of a bearing; the order of the columns of `log_p`
CLOSE, AGREES, OFF, HIDDEN, BEYOND, NO_FLOOR = range(6)
# bounds between them, in units from the predicted foot, positive outwards
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
    """Count the bearings in each state, and compare a right pose with a wrong one.

    Parameters
    ----------
    residual, predicted : (K,) float64
        Residuals and predicted feet of a fit, pixels: distance of the floor's edge from the wall's foot, NaN without an
        edge or a wall, and the foot's image radius, NaN without a wall.
    outermost : (K,) int64
        Outermost floor sample of each bearing; -1 if there is none.
    is_shown : (K,) uint8
        0 for bearings under the mask, which are not counted.
    radius_px : (M,) float64
        Image radius of the samples.
    unit_px : float
        A pixel of the paper's image.
    log_p : (2 N, 6) float64
        Logarithm of each state's probability under N conditions of a right pose, then N of a wrong one.
    counts : (6,) int64
        Filled with the number of bearings in each state.

    Returns
    -------
    float
        Log-likelihood ratio of the most likely right condition to the most likely wrong one.
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
