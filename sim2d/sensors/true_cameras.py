"""True cameras drawn about their file: no robot's camera is quite what its file says, and a knock moves it.

The player gets the file's camera. What the frames are drawn with is the simulator's alone.
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
    """Standard deviations of a true camera about its file."""

    #: Of the mirror's axis in the image, each way.
    mirror_center_px: float = 1.5
    #: Of the image radius of every floor range, relative.
    mirror_curve_ratio: float = 0.02
    #: Of the mirror's axis about either horizontal axis.
    mirror_tilt_rad: float = math.radians(0.3)
    #: Of a pinhole camera's focal length, relative.
    focal_ratio: float = 0.01
    #: Of its optical axis in the image, each way.
    center_px: float = 3.0
    #: Of its tilt and of its roll; of its height.
    tilt_rad: float = math.radians(0.5)
    height_m: float = 0.005
    #: Of its pan: a neck's joint, or a camera on board that looks a little aside. None by default: frames do not tell
    #: it from the robot's own heading, and nothing estimates it yet.
    pan_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class KnockSettings:
    """When a knock moves a robot's camera once more, by as much as `CameraErrorSettings` say."""

    #: At a moment between these, drawn for each robot.
    from_s: float = 10.0
    until_s: float = 40.0
    #: By how much; a knock changes no lens.
    error: CameraErrorSettings = CameraErrorSettings(mirror_curve_ratio=0.0, focal_ratio=0.0)


def draw_camera(
    camera: OmniCamera | PinholeCamera, error: CameraErrorSettings, rng: np.random.Generator
) -> OmniCamera | PinholeCamera:
    """Draw a true camera about one.

    Parameters
    ----------
    camera : OmniCamera or PinholeCamera
        As its file says, or as it truly was before a knock.
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
    """Return a camera whose standard deviations are at least the errors of its file.

    A centre that is off looks like a tilt, to a frame. A focal length that is off is left to what calibrates.
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
        How far it is off its file from the start; None: it is what its file says.
    knock : KnockSettings or None
        When it is moved; None: never.
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
        """Return whether a knock has moved the camera since the call before; it is another one then."""
        if self._knock is None or t_s < self.knock_s:
            return False
        self.camera = draw_camera(self.camera, self._knock.error, self._rng)
        self._knock = None
        return True
