"""Refines a pinhole camera's pose by the end of the floor: the feet of walls and boards, taken for lines of the field.

A mirror camera sees the whole outline at once and has a fit of its own (`localization.floor`). A pinhole camera sees a
stretch of it, from a height and tilt that sway: that refines a prior, as a few lines do, but gives no pose alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.floor import radial_edges
from robocup_vision.localization.lines.pose_estimator import LinePoseEstimator
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.line_points import LinePoints


def wall_pose_estimator(field: Field, camera: PinholeCamera) -> LinePoseEstimator:
    """Make a pose estimator whose lines are the feet of the walls.

    Parameters
    ----------
    field : Field
        Its floor must be bounded by walls or boards.
    camera : PinholeCamera
        With a known tilt.

    Raises
    ------
    ArgumentError
        If nothing bounds the field's floor.
    """
    if not field.is_bounded:
        raise ArgumentError(
            f"method 'floor' needs walls or boards, but the floor of '{field.name}' is not bounded (carpet)"
        )
    return LinePoseEstimator(replace(field, lines=field.walls, arcs=np.empty((0, 5))), camera)


def wall_points(
    frame: UInt8Array,
    view: FloorView,
    columns: npt.NDArray[np.int64],
    hidden: UInt8Array,
    min_contrast: float,
) -> LinePoints:
    """Where the floor ends in a frame, to a fraction of a pixel, as points of lines.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR.
    view : FloorView
        Of the camera in its present orientation.
    columns : (K,) int64
        The outermost floor sample of each bearing, -1 where there is none.
    hidden : (H, W) uint8, or (0, 0)
        Non-zero where no bilinear sample may be taken.
    min_contrast : float
        Smallest colour difference (counts) that is an edge.
    """
    decided = np.flatnonzero(columns >= 0)
    last = view.pixels[decided, columns[decided]]
    foot = np.array(view.below_px)
    away = last - foot
    radius = np.hypot(away[:, 0], away[:, 1])
    step: FloatArray = np.ascontiguousarray((away / radius[:, None]).T)
    edge = np.empty(len(decided))
    # two more lines of sight, a pixel to either side
    rays = radial_edges.Rays(*view.below_px, step[0], step[1], radius)
    half_width = 1.0 / float(np.hypot(*(foot - view.camera.center_px)))
    radial_edges.radial_edges(
        frame, hidden, rays, radial_edges.EdgeSearch(view.step_px, half_width, min_contrast), edge
    )
    good = np.isfinite(edge)
    return LinePoints.from_pixels(view.camera, foot + edge[good, None] * step.T[good])
