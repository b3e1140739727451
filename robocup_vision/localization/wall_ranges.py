"""How far away a field's walls stand in each direction from a place on the floor."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.geometry import Pose2
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.polar_view import PolarView


def wall_range_m(walls: FloatArray, foot: Pose2, bearing_rad: FloatArray) -> FloatArray:
    """Return the range of the nearest wall in each direction.

    Parameters
    ----------
    walls : (W, 4) float64
        Segments x0, y0, x1, y1, field frame, metres.
    foot : Pose2
        Where ranges are taken from, and the direction of bearing 0; field frame.
    bearing_rad : (K,) float64
        Directions.

    Returns
    -------
    (K,) float64
        Metres; inf where no wall is met.
    """
    if not len(walls):
        return np.full(len(bearing_rad), np.inf)
    angle = foot.theta_rad + bearing_rad[:, None]
    dx, dy = np.cos(angle), np.sin(angle)
    x0, y0, x1, y1 = walls.T
    ax, ay, bx, by = x0 - foot.x_m, y0 - foot.y_m, x1 - x0, y1 - y0
    with np.errstate(divide="ignore", invalid="ignore"):
        across = dx * by - dy * bx
        away = (ax * by - ay * bx) / across
        along = (ax * dy - ay * dx) / across
    hit = (away > 0) & (along >= 0) & (along <= 1)
    return np.asarray(np.where(hit, away, np.inf).min(axis=1))


def wall_px(walls: FloatArray, robot: Pose2, view: PolarView | FloorView) -> FloatArray:
    """Return where a pose puts the walls, as `radius_px` of each of the view's bearings (K,); NaN where none."""
    foot = robot.compose(Pose2(*view.camera.offset_m, 0.0))
    nearest = wall_range_m(walls, foot, view.bearing_rad)
    used = view.columns_in_use
    radius = np.interp(-1.0 / nearest, -1.0 / view.range_m[:used], view.radius_px[:used])
    return read_only(np.where(np.isfinite(nearest), radius, np.nan))
