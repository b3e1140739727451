"""Places along the field's lines near a goal: where a camera predicts them, and where the picture shows them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.lines.marked_cameras import MarkReach, SeenMarks, choose_marks, due_marks
from robocup_vision.kernels.goal.lines.marks import MarkLimits, MarkPlaces, line_marks, measure_ridges
from robocup_vision.localization.goal.edges import EdgeSamples, from_ideal, to_ideal
from robocup_vision.localization.goal.fit import GoalModel
from robocup_vision.localization.lines.line_map import LineMap


@dataclass(frozen=True, eq=False)
class LineFit:
    """A camera fitted to goal and lines.

    Parameters
    ----------
    unknowns : (8,) float64
        In the order of goal/geometry.py.
    covariance : (8, 8) float64
        Of the unknowns.
    line_ratio : float
        Inliers among the line points.
    residual_px : (N,) float64
        Of the line points, pixels.
    """

    unknowns: FloatArray
    covariance: FloatArray
    line_ratio: float
    residual_px: FloatArray


@dataclass(frozen=True, slots=True)
class MarkSettings:
    """Which places along lines are looked at, and what counts as a line there.

    Parameters
    ----------
    spacing_px : float
        Between places on a line.
    cell_px : float
        One place at most in each cell of the picture of this size, where several lines crowd. 0: any number.
    width_px : (float, float)
        Lines that look narrower or wider are left out.
    clear_px : float
        Between the edges of two lines; where they come nearer, both are left out. Negative: lines may cross.
    along_px : float
        Stretch of line over which one place is averaged.
    min_contrast : float
        Of the median contrast: fainter ridges are no lines.
    full_width_px : float
        Lines at least as wide have their full contrast, narrower ones less in proportion. 0: all count alike.
    """

    spacing_px: float
    cell_px: float
    width_px: tuple[float, float]
    clear_px: float
    along_px: float
    min_contrast: float
    full_width_px: float


@dataclass(frozen=True, slots=True, eq=False)
class PredictedMarks:
    """Places along lines that a camera should have in view.

    Parameters
    ----------
    mark_m : (N, 2) float64
        In the field frame, metres.
    ideal_px, direction : (N, 2) float64
        In the ideal image, and unit vectors across the line there.
    width_px : (N,) float64
        How wide the line should look.
    """

    mark_m: FloatArray
    ideal_px: FloatArray
    direction: FloatArray
    width_px: FloatArray

    def __len__(self) -> int:
        return len(self.mark_m)

    def take(self, chosen: npt.NDArray[np.bool_ | np.intp]) -> PredictedMarks:
        """Return the places at these indices or where this mask is true."""
        return PredictedMarks(self.mark_m[chosen], self.ideal_px[chosen], self.direction[chosen], self.width_px[chosen])


class LineMarks:
    """Predicts and measures places along the lines of one field.

    Parameters
    ----------
    line_map : LineMap
        Of the field.
    camera : PinholeCamera
        The camera.
    settings : MarkSettings
        Which places count.
    """

    def __init__(self, line_map: LineMap, camera: PinholeCamera, settings: MarkSettings) -> None:
        self._camera, self._settings = camera, settings
        self.line_width_m = line_map.field.line_width_m
        points, directions = along_lines(line_map)
        self.points, self._directions = np.ascontiguousarray(points), np.ascontiguousarray(directions)
        self._limits = MarkLimits(
            float(self.line_width_m), float(settings.spacing_px), float(settings.width_px[0]), float(settings.clear_px)
        )

    def predict(self, model: GoalModel, p: FloatArray) -> PredictedMarks:
        """Places in view of a camera (8,)."""
        room = len(self.points)
        marks, pixels, normals, widths = np.empty((room, 2)), np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
        settings = self._settings
        places = MarkPlaces(marks, pixels, normals, widths)
        view, size_px = model.scene.camera, self._camera.size_px
        n = line_marks(self.points, self._directions, view, p, size_px, self._limits, places)
        chosen = np.flatnonzero(widths[:n] < settings.width_px[1])
        if settings.cell_px > 0:
            cell = np.floor(pixels[chosen] / settings.cell_px).astype(np.int64)
            _, first = np.unique(cell[:, 0] * 100_003 + cell[:, 1], return_index=True)
            chosen = chosen[np.sort(first)]
        return PredictedMarks(marks[:n], pixels[:n], normals[:n], widths[:n]).take(chosen)

    def look(
        self, frame: UInt8Array, model: GoalModel, cameras: FloatArray, covariances: FloatArray, how_far: MarkReach
    ) -> SeenMarks:
        """Look for lines where each of many cameras predicts them.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR.
        model : GoalModel
            Of the camera.
        cameras, covariances : (K, 8), (K, 8, 8) float64
            The cameras.
        how_far : MarkReach
            How far lines are searched.
        """
        view, size_px = model.scene.camera, self._camera.size_px
        room = len(cameras) * len(self.points)
        places = MarkPlaces(np.empty((room, 2)), np.empty((room, 2)), np.empty((room, 2)), np.empty(room))
        reach, bounds = np.empty(room), np.empty(len(cameras) + 1, np.int64)
        n = due_marks(
            self.points,
            self._directions,
            view,
            cameras,
            covariances,
            size_px,
            self._limits,
            how_far,
            places,
            reach,
            bounds,
        )
        marks, pixels, direction, width = (part[:n] for part in places)
        start = np.ascontiguousarray(from_ideal(self._camera, pixels))
        offset, contrast = self._ridges(frame, start, direction, reach[:n], width)
        uv = np.ascontiguousarray(to_ideal(self._camera, start + direction * offset[:, None]))
        return SeenMarks(bounds, marks, direction, uv, width, reach[:n], contrast)

    def measure(
        self, frame: UInt8Array, predicted: PredictedMarks, reach_px: FloatArray
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Look for the line across each place.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR.
        predicted : PredictedMarks
            Where to look.
        reach_px : (N,) float64
            How far to both sides.

        Returns
        -------
        (M, 2) float64
            Ideal pixels where lines were seen.
        (N,) bool
            At which places, M of them.
        """
        start = np.ascontiguousarray(from_ideal(self._camera, predicted.ideal_px))
        offset, contrast = self._ridges(frame, start, predicted.direction, reach_px, predicted.width_px)
        settings, seen = self._settings, np.empty(len(start), np.bool_)
        choose_marks(contrast, predicted.width_px, settings.full_width_px, settings.min_contrast, seen)
        uv = start[seen] + predicted.direction[seen] * offset[seen, None]
        return np.ascontiguousarray(to_ideal(self._camera, uv)), seen

    def _ridges(
        self, frame: UInt8Array, start: FloatArray, direction: FloatArray, reach_px: FloatArray, width_px: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Measure ridges across (N,) places, see `measure_ridges`; where none is, offset and contrast are NaN."""
        offset, contrast = np.empty(len(start)), np.empty(len(start))
        measure_ridges(frame, start, direction, reach_px, width_px, self._settings.along_px, offset, contrast)
        contrast[np.isnan(offset)] = np.nan
        return offset, contrast


def with_marks(
    samples: EdgeSamples, mark_m: FloatArray, mark_uv: FloatArray, direction: FloatArray, sigma: FloatArray
) -> EdgeSamples:
    """Add marks (L, ...) on lines, with their noise (L,), to the samples of a goal."""
    return replace(
        samples,
        mark_m=mark_m,
        mark_uv=mark_uv,
        mark_direction=direction,
        sigma=np.concatenate([samples.sigma, sigma]),
    )


@lru_cache(maxsize=4)
def along_lines(line_map: LineMap) -> tuple[FloatArray, FloatArray]:
    """Points (N, 2) every 4 cm along a field's lines, and their directions (N, 2)."""
    points, directions = [], []
    for x0, y0, x1, y1 in line_map.lines:
        length = math.hypot(x1 - x0, y1 - y0)
        at = np.arange(0.1, length - 0.1, 0.04)[:, None]
        direction = np.array([[x1 - x0, y1 - y0]]) / length
        points.append(np.array([[x0, y0]]) + at * direction)
        directions.append(np.repeat(direction, len(at), axis=0))
    for x, y, radius, start, sweep in line_map.arcs:
        angle = start + np.sign(sweep) * np.arange(0.02, abs(sweep), 0.04 / radius)
        points.append(np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)]))
        directions.append(np.column_stack([-np.sin(angle), np.cos(angle)]))
    return np.vstack(points), np.vstack(directions)
