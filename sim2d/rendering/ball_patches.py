"""The dark patches of a football of twelve pentagons and twenty hexagons, turned as it has rolled."""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import Float32Array, FloatArray

# a pentagon as a disc of the same area: the twelve cover 28 % of a ball whose edges are all of one length
_COS_PATCH = 1 - 2 * 0.284 / 12


def _middles() -> FloatArray:
    """(12, 3) float64: unit vectors to the middles of the pentagons, the corners of an icosahedron."""
    golden = (1 + math.sqrt(5)) / 2
    corners = []
    for a, b in itertools.product((-1.0, 1.0), (-golden, golden)):
        corners += [(0.0, a, b), (a, b, 0.0), (b, 0.0, a)]
    return np.array(corners) / math.hypot(1.0, golden)


_MIDDLES = _middles()


def is_patch(
    normals: tuple[Float32Array, Float32Array, Float32Array], turn_rad: tuple[float, float, float]
) -> npt.NDArray[np.bool_]:
    """Return which places of a ball show a dark patch.

    Parameters
    ----------
    normals : three (N,) float32
        x, y and z of the unit normals.
    turn_rad : (float, float, float)
        Turns about x, y and z, one after the other.
    """
    turned = _MIDDLES
    for axis, angle in enumerate(turn_rad):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        c, s = math.cos(angle), math.sin(angle)
        turn = np.eye(3)
        turn[first, first] = turn[second, second] = c
        turn[first, second], turn[second, first] = -s, s
        turned = turned @ turn.T
    dark = np.zeros(normals[0].shape, dtype=bool)
    for x, y, z in turned.astype(np.float32):
        dark |= normals[0] * x + normals[1] * y + normals[2] * z > np.float32(_COS_PATCH)
    return dark
