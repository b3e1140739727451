"""Whether the ground nearest to a robot looks like the carpet of a field: asked where no picture can be located.

Poses say nothing then: the field file, the camera file or the pictures may be the wrong ones. A field's carpet is
green; under lamps that take most of its colour away it is grey with a trace of green.
"""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.view import View

# darker ground has the colour of the sensor's noise
_MIN_COUNTS = 16


def shows_carpet(view: View, frame: UInt8Array) -> bool | None:
    """Whether most of the ground nearest to the robot is green rather than red or blue; None if it is too dark to tell.

    Parameters
    ----------
    view : View
        Of the frame; where it has no floor samples (a camera of unknown tilt), the lower third of the frame is taken.
    frame : (H, W, 3) uint8
        BGR.
    """
    polar = view.polar
    if polar is None:
        near = frame[-(frame.shape[0] // 3) :].reshape(-1, 3)
    else:
        columns = slice(0, polar.valid.shape[1] // 3)
        places = polar.pixels[:, columns][polar.valid[:, columns] > 0]
        u, v = np.rint(places).astype(int).T
        near = frame[v, u]
    blue, green, red = np.median(near, axis=0).tolist() if len(near) else (0.0, 0.0, 0.0)
    return None if max(blue, green, red) < _MIN_COUNTS else bool(green > max(blue, red))
