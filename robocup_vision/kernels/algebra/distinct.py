"""Compiled choice of poses that are far enough apart to be different candidates."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled


@compiled
def pick_distinct(poses: FloatArray, apart_m: float, apart_rad: float, twins: bool, picked: Int64Array) -> int:
    """Pick poses that are not neighbours of a pose picked before.

    poses : (N, 3) x, y, theta in metres and radians, the best first.
    apart_m, apart_rad : two poses are neighbours if they are closer than both.
    twins : whether the neighbours of a pose's half turn about the origin count as its neighbours, too.
    picked : (M,); written: the indices of up to M poses.

    Returns the number of poses picked.
    """
    count = 0
    for n in range(poses.shape[0]):
        if count == picked.shape[0]:
            break
        x, y, theta = poses[n, 0], poses[n, 1], poses[n, 2]
        is_new = True
        for k in range(count):
            other = picked[k]
            turn = theta - poses[other, 2]
            turn = abs(turn - math.tau * np.rint(turn / math.tau))
            if turn < apart_rad and math.hypot(x - poses[other, 0], y - poses[other, 1]) < apart_m:
                is_new = False
            if twins and math.pi - turn < apart_rad and math.hypot(x + poses[other, 0], y + poses[other, 1]) < apart_m:
                is_new = False
            if not is_new:
                break
        if is_new:
            picked[count] = n
            count += 1
    return count
