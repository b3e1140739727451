"""A mirror camera as the methods based on edges take it: a lens that looks straight down, with the mirror's curve.

All floor is less than 90 degrees off the axis of a mirror, so that it has slopes as in any other lens. Tilt and roll
are those of the robot's body.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import camera_rotation

# greatest angle off the axis of floor that is used: 57 times as far away as the mirror is high
_WIDEST_RAD = math.radians(89.0)
# least step within the curve's end, which numerical derivatives take
_END_RAD = 1e-4
# standard deviations of tilt and roll, and of the height as a fraction of it: wheels keep a body nearly upright, and an
# error of the mirror's centre shifts its picture as a tilt does
_LEAN_STD_RAD, _HEIGHT_STD_RATIO = 0.01, 0.005
_RADIUS_STD_RATIO = 0.01  # standard deviation of the curve's image radii, as a fraction: curves are fitted to pictures
_RADII = 1001


@dataclass(frozen=True, eq=False)
class DownwardCamera(FisheyeCamera):
    """See the module; made by `downward`.

    Parameters
    ----------
    mirror : OmniCamera
        The camera that this is.
    unit_px : float
        Pixels of the mirror's picture to a radian, on average; the curve is given in these.
    """

    mirror: OmniCamera = field(kw_only=True)
    unit_px: float = field(kw_only=True)
    _sloping_rad = _WIDEST_RAD

    @cached_property
    def mount(self) -> FloatArray:
        """See `PinholeCamera.mount`. In a mirrored picture it is a reflection, too."""
        mirror = self.mirror
        down = camera_rotation(mirror.heading_rad + math.pi / 2, -math.pi / 2, 0.0)
        if mirror.mirrored:
            down = camera_rotation(mirror.heading_rad - math.pi / 2, -math.pi / 2, 0.0) * (1.0, -1.0, 1.0)
        return read_only(mirror.camera_to_robot @ down)

    @cached_property
    def _curve(self) -> tuple[FloatArray, FloatArray]:
        return _curve(self.mirror)

    @property
    def widest_rad(self) -> float:
        """See `FisheyeCamera.widest_rad`."""
        return float(self._curve[1][-1]) - _END_RAD

    def image_radius(self, angle_rad: FloatArray) -> FloatArray:
        """See `FisheyeCamera.image_radius`. Where the curve begins later it goes straight on to the axis."""
        radius, angle = self._curve
        at = np.asarray(angle_rad, dtype=np.float64)
        q = 1.0 / (np.tan(np.maximum(at, angle[0])) * self.mirror.viewpoint_m[2])
        px = np.where(at < angle[0], radius[0] * at / angle[0], self.mirror.floor_range.radius_px(q))
        return np.asarray(px / self.unit_px)


def _curve(mirror: OmniCamera) -> tuple[FloatArray, FloatArray]:
    """Return image radii that the mirror's curve maps to the floor, px, and the angles of their rays off the axis."""
    radius = np.linspace(0.0, mirror.usable_radius_px[1], _RADII)
    q = mirror.floor_range.inverse_range_per_m(radius)
    shows_floor = np.isfinite(q) & (q > 0.0)
    return radius[shows_floor], np.arctan2(1.0, q[shows_floor] * mirror.viewpoint_m[2])


def downward(mirror: OmniCamera) -> DownwardCamera:
    """Return a mirror camera as one that looks straight down."""
    radius, angle = _curve(mirror)
    unit_px, height_m = float(radius[-1] / angle[-1]), float(mirror.viewpoint_m[2])
    return DownwardCamera(
        size_px=mirror.size_px,
        focal_px=(unit_px, unit_px),
        center_px=mirror.center_px,
        height_m=height_m,
        offset_m=mirror.offset_m,
        pan_rad=0.0,
        tilt_rad=0.0,
        roll_rad=0.0,
        height_std_m=_HEIGHT_STD_RATIO * height_m,
        focal_std_px=_RADIUS_STD_RATIO * unit_px,
        roll_std_rad=_LEAN_STD_RAD,
        usable_radius_px=mirror.usable_radius_px,
        mirror=mirror,
        unit_px=unit_px,
    )
