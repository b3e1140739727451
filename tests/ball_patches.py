"""The dark patches of a football of twelve pentagons and twenty hexagons, for tests that paint balls."""

import itertools
import math

import numpy as np
from scipy.spatial.transform import Rotation

GOLDEN = (1 + math.sqrt(5)) / 2
# the corners of an icosahedron; a pentagon is a disc of the same area: the twelve cover 28 % of the ball
CORNERS = [np.roll((0.0, a, b), k) for a, b in itertools.product((-1, 1), (-GOLDEN, GOLDEN)) for k in range(3)]
MIDDLES = np.array(CORNERS) / math.hypot(1.0, GOLDEN)
COS_PATCH = 1 - 2 * 0.284 / 12


def is_patch(normals, turn_rad):
    """Return which places of a ball, by x, y, z of their normals, show a patch once it is turned about x, y and z."""
    turned = Rotation.from_euler("xyz", turn_rad).apply(MIDDLES)
    return (np.stack(normals, axis=-1) @ turned.T).max(axis=-1) > COS_PATCH
