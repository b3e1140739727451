"""Draws a landmark map from above: landmarks with error ellipses, the mapping run, and a second trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from field_models.errors import ArgumentError, FileError
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.landmarks.landmark_map import LandmarkMap

# factor on the ellipses of one standard deviation, so that they are visible
ENLARGED = 3.0
_ELLIPSE_POINTS = 24
_MARGIN_M = 0.5


def draw_map(landmarks: LandmarkMap, path: str | Path, located: Sequence[Pose2] = ()) -> None:
    """Draw a map seen from above.

    Parameters
    ----------
    landmarks : LandmarkMap
        Landmarks with a high detection rate are dark.
    path : str or Path
        Picture to write (.png, .svg, .pdf).
    located : sequence of Pose2
        A second trajectory, in another colour.

    Raises
    ------
    ArgumentError
        If Matplotlib is not installed.
    FileError
        If the picture cannot be written.
    """
    try:
        from matplotlib.collections import PolyCollection
        from matplotlib.figure import Figure
    except ImportError:
        raise ArgumentError("drawing needs Matplotlib (pip install 'robocup-vision[report]')") from None
    figure = Figure(figsize=(9, 7), dpi=130, layout="constrained")
    axes = figure.subplots()
    outlines = list(ellipses(landmarks))
    shade = 0.25 + 0.6 * landmarks.success
    axes.add_collection(
        PolyCollection(outlines, facecolors="none", edgecolors=[(0.2, 0.25, 0.35, a) for a in shade], lw=0.6)
    )
    run = landmarks.trajectory
    if len(run):
        axes.plot(run[:, 0], run[:, 1], "-", color="#1f6feb", label=f"mapping run, {len(run)} moments")
        axes.plot(run[0, 0], run[0, 1], "o", color="#1f6feb")
    if located:
        places = np.array([pose.array for pose in located])
        axes.plot(places[:, 0], places[:, 1], ".-", color="#d1242f", label=f"located, {len(located)} frames")
    everything = np.concatenate([landmarks.positions_m[:, :2], run[:, :2]])
    low, high = np.percentile(everything, [1, 99], axis=0)
    axes.set_xlim(low[0] - _MARGIN_M, high[0] + _MARGIN_M)
    axes.set_ylim(low[1] - _MARGIN_M, high[1] + _MARGIN_M)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_title(f"{len(landmarks)} landmarks; ellipses: {ENLARGED:g} standard deviations")
    if len(run) or located:
        axes.legend(loc="upper right")
    try:
        figure.savefig(path)
    except (OSError, ValueError) as error:
        raise FileError(path, f"cannot be written ({error})") from None


def ellipses(landmarks: LandmarkMap) -> FloatArray:
    """Return outlines (L, 24, 2) of the landmarks' error ellipses on the floor plan, metres, enlarged."""
    values, axes = np.linalg.eigh(landmarks.covariances[:, :2, :2])
    angle = np.linspace(0, 2 * np.pi, _ELLIPSE_POINTS, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    stretched = circle[None] * (ENLARGED * np.sqrt(np.maximum(values, 0.0)))[:, None, :]
    return np.asarray(landmarks.positions_m[:, None, :2] + stretched @ axes.transpose(0, 2, 1))
