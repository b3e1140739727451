"""Computes the probability that a robot of uncertain position hides a point from a camera."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.disc import Disc
from robocup_vision.normal import normal_below


def clear_probability(eye_m: npt.ArrayLike, points_m: npt.ArrayLike, blockers: Sequence[Disc]) -> FloatArray:
    """Return the probability (N,) that nothing hides a point from the camera.

    Parameters
    ----------
    eye_m : (3,) float64
        The camera, field frame.
    points_m : (N, 3) float64
        The points, field frame.
    blockers : sequence of Disc
        Robots that may stand between; each independent of the others.
    """
    eye, points = np.asarray(eye_m, dtype=np.float64), np.asarray(points_m, dtype=np.float64).reshape(-1, 3)
    clear = np.ones(len(points))
    way = points[:, :2] - eye[:2]
    away = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)
    along, across = way / away[:, None], np.column_stack([-way[:, 1], way[:, 0]]) / away[:, None]
    for blocker in blockers:
        offset = np.array([blocker.x_m, blocker.y_m]) - eye[:2]
        at, aside = along @ offset, across @ offset
        sight_height = eye[2] + (points[:, 2] - eye[2]) * np.clip(at / away, 0.0, 1.0)
        between = (at > 0) & (at < away) & (sight_height < blocker.height_m)
        std = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", across, blocker.covariance, across), 1e-12))
        hidden = normal_below((blocker.radius_m - aside) / std) - normal_below((-blocker.radius_m - aside) / std)
        clear *= np.where(between, 1.0 - hidden, 1.0)
    return clear
