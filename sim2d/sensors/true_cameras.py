"""Draws true cameras at random: a robot's camera is never quite as its file says, and a knock moves it.

The player gets the file's camera; only the simulator knows the true one, with which the frames are drawn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.camera.floor_range import magnified


@dataclass(frozen=True, slots=True)
class CameraErrorSettings:
    """Standard deviations of a true camera's values about those in its file."""

    #: Mirror's axis in the image, along u and v.
    mirror_center_px: float = 1.5
    #: Image radius of every floor range, relative.
    mirror_curve_ratio: float = 0.02
    #: Tilt of the mirror's axis about each horizontal axis.
    mirror_tilt_rad: float = math.radians(0.3)
    #: Focal length of a pinhole camera, relative.
    focal_ratio: float = 0.01
    #: Its optical axis in the image, along u and v.
    center_px: float = 3.0
    #: Its tilt and its roll, each; its height.
    tilt_rad: float = math.radians(0.5)
    height_m: float = 0.005
    #: Its pan: error of a neck's joint, or of a fixed camera's direction. 0 by default, because in frames it cannot be
    #: distinguished from the robot's own heading, and nothing estimates it yet.
    pan_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class KnockSettings:
    """When and how much a knock moves a robot's camera."""

    #: The time is drawn between these, for each robot.
    from_s: float = 10.0
    until_s: float = 40.0
    #: Standard deviations of the change; a knock does not change the lens.
    error: CameraErrorSettings = CameraErrorSettings(mirror_curve_ratio=0.0, focal_ratio=0.0)


def draw_camera(
    camera: OmniCamera | PinholeCamera, error: CameraErrorSettings, rng: np.random.Generator
) -> OmniCamera | PinholeCamera:
    """Draw a true camera at random about a given one.

    Parameters
    ----------
    camera : OmniCamera or PinholeCamera
        The camera of the file, or the true one before a knock.
    """
    u, v, scale, first, second, up = rng.standard_normal(6).tolist()
    center_u, center_v = camera.center_px
    if isinstance(camera, OmniCamera):
        off_px, curve = error.mirror_center_px, camera.floor_range
        if error.mirror_curve_ratio:
            curve = magnified(curve, 1 + error.mirror_curve_ratio * scale)
        tilt_x, tilt_y = camera.tilt_rad
        return replace(
            camera,
            center_px=(center_u + off_px * u, center_v + off_px * v),
            floor_range=curve,
            tilt_rad=(tilt_x + error.mirror_tilt_rad * first, tilt_y + error.mirror_tilt_rad * second),
        )
    aside = float(rng.standard_normal())
    focal_u, focal_v = camera.focal_px
    factor = 1 + error.focal_ratio * scale
    return replace(
        camera,
        focal_px=(focal_u * factor, focal_v * factor),
        center_px=(center_u + error.center_px * u, center_v + error.center_px * v),
        height_m=camera.height_m + error.height_m * up,
        pan_rad=(camera.pan_rad or 0.0) + error.pan_rad * aside,
        tilt_rad=(camera.tilt_rad or 0.0) + error.tilt_rad * first,
        roll_rad=(camera.roll_rad or 0.0) + error.tilt_rad * second,
    )


def with_stated_errors(camera: PinholeCamera, error: CameraErrorSettings) -> PinholeCamera:
    """Return a camera whose stated standard deviations are at least those of the errors.

    In a frame, an error of the centre looks like one of the tilt. Errors of the focal length are left to calibration.
    """
    stated, roll_std_rad = (camera.height_std_m, camera.roll_std_rad), camera.roll_std_rad
    if roll_std_rad is not None:
        off_rad = math.hypot(error.tilt_rad, error.center_px / min(camera.focal_px))
        roll_std_rad = max(roll_std_rad, off_rad)
    height_std_m = max(camera.height_std_m, error.height_m)
    if (height_std_m, roll_std_rad) == stated:
        return camera
    return replace(camera, height_std_m=height_std_m, roll_std_rad=roll_std_rad)


class TrueCamera:
    """One robot's true camera during a match.

    Parameters
    ----------
    error : CameraErrorSettings or None
        Its deviation from the file from the start; None: it is as its file says.
    knock : KnockSettings or None
        When and how much it is moved; None: never.
    """

    def __init__(
        self,
        error: CameraErrorSettings | None,
        knock: KnockSettings | None,
        camera: OmniCamera | PinholeCamera,
        seed: Sequence[int],
    ) -> None:
        self._rng = np.random.default_rng(list(seed))
        self.camera = camera if error is None else draw_camera(camera, error, self._rng)
        self._knock = knock
        self.knock_s = math.inf if knock is None else float(self._rng.uniform(knock.from_s, knock.until_s))

    def is_knocked_by(self, t_s: float) -> bool:
        """Return whether a knock has moved the camera since the last call; then `camera` is changed."""
        if self._knock is None or t_s < self.knock_s:
            return False
        self.camera = draw_camera(self.camera, self._knock.error, self._rng)
        self._knock = None
        return True
