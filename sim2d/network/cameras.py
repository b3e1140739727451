"""Overhead cameras that look straight down: the part of the field that each covers, and where a ray meets the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models import Field
from robocup_vision.ssl.values.geometry import CameraCalibration

HEIGHT_M = 5.0
SIZE_PX = (1280, 1024)


@dataclass(frozen=True, slots=True)
class OverheadCamera:
    """One camera.

    Parameters
    ----------
    camera_id : int
        Its number.
    x_m, y_m, z_m : float
        Where it hangs, field frame.
    half_x_m, half_y_m : float
        Distance from there to which it covers the floor.
    """

    camera_id: int
    x_m: float
    y_m: float
    z_m: float
    half_x_m: float
    half_y_m: float

    @property
    def focal_length_px(self) -> float:
        """All that it shall see fits into its image."""
        return self.z_m * min(SIZE_PX[0] / 2 / self.half_x_m, SIZE_PX[1] / 2 / self.half_y_m)

    def covers(self, x_m: float, y_m: float) -> bool:
        """Return whether a point of the floor is in its part of the field."""
        return abs(x_m - self.x_m) <= self.half_x_m and abs(y_m - self.y_m) <= self.half_y_m

    def pixel(self, x_m: float, y_m: float, z_m: float = 0.0) -> tuple[float, float]:
        """Return where in its image a point is: x to the right, y down."""
        scale = self.focal_length_px / (self.z_m - z_m)
        return SIZE_PX[0] / 2 + (x_m - self.x_m) * scale, SIZE_PX[1] / 2 - (y_m - self.y_m) * scale

    def on_floor(self, x_m: float, y_m: float, z_m: float) -> tuple[float, float]:
        """Return where the ray through a point above the floor meets it."""
        stretch = self.z_m / (self.z_m - min(z_m, 0.9 * self.z_m))
        return self.x_m + (x_m - self.x_m) * stretch, self.y_m + (y_m - self.y_m) * stretch

    @property
    def calibration(self) -> CameraCalibration:
        """The calibration that a vision system publishes: turned by pi about x, so that it looks down."""
        return CameraCalibration(
            camera_id=self.camera_id,
            focal_length_px=self.focal_length_px,
            principal_x_px=SIZE_PX[0] / 2,
            principal_y_px=SIZE_PX[1] / 2,
            distortion=0.0,
            q_x=1.0,
            q_y=0.0,
            q_z=0.0,
            q_w=0.0,
            t_x_m=-self.x_m,
            t_y_m=self.y_m,
            t_z_m=self.z_m,
            camera_x_m=self.x_m,
            camera_y_m=self.y_m,
            camera_z_m=self.z_m,
            width_px=SIZE_PX[0],
            height_px=SIZE_PX[1],
        )


def camera_rig(field: Field, columns: int, rows: int, overlap_m: float) -> tuple[OverheadCamera, ...]:
    """Return cameras over equal parts of a field and its boundary, row by row from the corner at -x and -y.

    Parameters
    ----------
    columns, rows : int
        How many along x and along y.
    overlap_m : float
        How wide a strip between two neighbours both see.
    """
    reach_x_m, reach_y_m = abs(field.floor_polygon).max(axis=0).tolist()
    step_x_m, step_y_m = 2 * reach_x_m / columns, 2 * reach_y_m / rows
    # high enough that nobody needs a wide lens
    height_m = max(HEIGHT_M, math.hypot(step_x_m, step_y_m) / 2)
    return tuple(
        OverheadCamera(
            row * columns + column,
            -reach_x_m + (column + 0.5) * step_x_m,
            -reach_y_m + (row + 0.5) * step_y_m,
            height_m,
            (step_x_m + overlap_m) / 2,
            (step_y_m + overlap_m) / 2,
        )
        for row in range(rows)
        for column in range(columns)
    )
