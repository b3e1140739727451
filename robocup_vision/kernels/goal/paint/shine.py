"""What lamps wash white on goal paint: bright pixels that the paint encloses along a row or a column."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.compiling.loops import compiled


@compiled
def fill_shine(mask: UInt8Array, image: UInt8Array, least: int, longest: int, upright: bool) -> bool:
    """Set pixels that are bright in all channels and lie between two of the mask, not too far apart.

    Parameters
    ----------
    mask : (H, W) uint8
        255 on paint; changed in place.
    image : (H, W, 3) uint8
        The picture.
    least : int
        From which value on a channel is bright.
    longest : int
        Most pixels between two of the mask.
    upright : bool
        Between pixels of one column, else of one row.

    Returns
    -------
    bool
        Whether anything was set.
    """
    height, width = mask.shape
    last = np.full(width if upright else height, -1, np.int64)
    changed = False
    for row in range(height):
        for column in range(width):
            if mask[row, column] == 0:
                continue
            line, at = (column, row) if upright else (row, column)
            first, last[line] = last[line] + 1, at
            if first == 0 or at == first or at - first > longest:
                continue
            for k in range(first, at):
                v, u = (k, column) if upright else (row, k)
                if min(image[v, u, 0], image[v, u, 1], image[v, u, 2]) >= least:
                    mask[v, u] = 255
                    changed = True
    return changed
