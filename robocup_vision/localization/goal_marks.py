"""Field lines around a goal of a hue: seen near where the goal's own fit predicts them, they make its pose exact.

From afar a goal hardly tells how obliquely it is seen. A line's middle is measured to a fraction of a pixel even where
it looks thinner than one, in brightness, which no camera stores coarsely; each place on a line is one more sample of
the goal's own fit.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import FloatArray
from robocup_vision.kernels.goal_edges import measure_ridges
from robocup_vision.kernels.goal_marks import line_marks, mark_stds
from robocup_vision.localization.goal_edges import EdgeSamples, from_ideal, to_ideal
from robocup_vision.localization.goal_fit import INLIER_PX, GoalFit, GoalModel, are_mostly_within, fit, residuals
from robocup_vision.localization.goal_geometry import LOG_FOCAL
from robocup_vision.localization.goal_lines import LineFit, along_lines
from robocup_vision.localization.line_map import LineMap

_SPACING_PX = 6.0
_LEAST_WIDTH_PX = 0.15
_REACHES_PX = (8.0, 4.0, 2.5)
_SCALES_PX = (3.0, 1.5, 1.0)
_FLOOR_PX = 1.5
_SAMPLE_ERROR_PX = 0.45
_SHARP_WIDTH_PX = 0.5  # thinner lines are fainter
_LINE_ERROR_PX = 0.045  # of all places together
_PAINTED_TO_M = 0.003
_LEAST_MARKS = 10
# of what lines in view are worth; more where the goal leaves the place open: among many tried, one agrees by chance
_LEAST_SHARE, _LEAST_OPEN_SHARE = 0.45, 0.6
# a second place as far off as this that is nearly as good leaves the choice open
_SAME_M, _RIVAL = 0.2, 0.92
_INLIER_PX = 1.0
_LEAST_CONTRAST = 0.4  # of the median, for its width
_FULL_WIDTH_PX = 1.5  # wider paint looks no brighter
# other starts, where the goal leaves more than this open: how far, and how far apart, along what it tells least
_SURE_M, _SWING_STDS, _FARTHEST_M, _SWING_M = 0.06, 2.5, 1.6, 0.15
_ITERATIONS = 4


class GoalMarks:
    """Looks for the lines of one field around its goals.

    Parameters
    ----------
    lines : LineMap
        Of the field.
    camera : PinholeCamera
        The camera.
    """

    def __init__(self, lines: LineMap, camera: PinholeCamera) -> None:
        self._camera = camera
        self._width_m = lines.field.line_width_m
        points, directions = along_lines(lines)
        self._points, self._directions = np.ascontiguousarray(points), np.ascontiguousarray(directions)

    def join(self, frame: npt.NDArray[np.uint8], model: GoalModel, found: GoalFit) -> LineFit | None:
        """Fit goal and lines together; None where the lines that should be in view are not.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR.
        model : GoalModel
            What the goal was fitted with.
        found : GoalFit
            The goal.
        """
        covariance = np.asarray(np.linalg.inv(found.information), np.float64)
        tried = [self._from(frame, model, found, found.unknowns, covariance)]
        # what the goal tells least: the camera's place along one direction, and all that goes with it
        variance, direction = np.linalg.eigh(covariance[:2, :2])
        std = math.sqrt(max(float(variance[-1]), 0.0))
        if std > _SURE_M:
            swing = covariance[:, :2] @ direction[:, -1] / std
            farthest = min(_SWING_STDS * std, _FARTHEST_M)
            steps = math.ceil(farthest / _SWING_M)
            tried += [
                self._from(frame, model, found, found.unknowns + k / steps * farthest / std * swing, covariance / 4)
                for k in range(-steps, steps + 1)
                if k
            ]
        fits = sorted((t for t in tried if t is not None), key=lambda t: -t.line_share)
        if not fits or fits[0].line_share < (_LEAST_SHARE if std <= _SURE_M else _LEAST_OPEN_SHARE):
            return None
        best = fits[0]
        for other in fits[1:]:
            apart = math.dist(other.unknowns[:2], best.unknowns[:2])
            if apart > _SAME_M and other.line_share > _RIVAL * best.line_share:
                return None
        return best if are_mostly_within(residuals(model, found.samples, best.unknowns), INLIER_PX) else None

    def _from(
        self,
        frame: npt.NDArray[np.uint8],
        model: GoalModel,
        found: GoalFit,
        start: FloatArray,
        covariance: FloatArray,
    ) -> LineFit | None:
        p, samples, worth, expected = start, found.samples, np.empty(0), 1.0
        is_near = False  # nothing was looked for farther away than the next round would
        for reach, scale in zip(_REACHES_PX, _SCALES_PX, strict=True):
            if is_near and reach > _REACHES_PX[-1]:
                continue
            marked = self._marked(frame, model, found.samples, p, covariance, reach)
            if marked is None:
                return None
            samples, worth, expected, reached = marked
            is_near = reached <= _REACHES_PX[1]
            p, cost, information = fit(model, samples, p, np.full(_ITERATIONS, scale))
            if not math.isfinite(cost):
                return None
            covariance = np.asarray(np.linalg.inv(information), np.float64)
        residual = residuals(model, samples, p)[-len(worth) :]
        # near is better than within reach: lines that a wrong camera meets by chance lie anywhere there
        agreed = worth * np.maximum(0.0, 1.0 - (residual / _INLIER_PX) ** 2)
        return LineFit(p, covariance, float(agreed.sum()) / expected, residual)

    def _marked(
        self,
        frame: npt.NDArray[np.uint8],
        model: GoalModel,
        samples: EdgeSamples,
        p: FloatArray,
        covariance: FloatArray,
        most_px: float,
    ) -> tuple[EdgeSamples, FloatArray, float, float] | None:
        """Return samples with marks, the worth of each, that of all places looked at, and the farthest reach."""
        room = len(self._points)
        marks, pixels, normals, widths = np.empty((room, 2)), np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
        n = line_marks(
            self._points,
            self._directions,
            model.view_array,
            p,
            self._camera.size_px,
            self._width_m,
            _SPACING_PX,
            _LEAST_WIDTH_PX,
            marks,
            pixels,
            normals,
            widths,
        )
        marks, pixels, normals, widths = marks[:n], pixels[:n], normals[:n], widths[:n]
        if n < _LEAST_MARKS:
            return None
        std = np.empty(n)
        mark_stds(marks, pixels, normals, model.view_array, p, LOG_FOCAL + 1, covariance, std)
        start = np.ascontiguousarray(from_ideal(self._camera, pixels))
        offset, contrast = np.empty(n), np.empty(n)
        reach = np.minimum(3 * std + _FLOOR_PX, most_px)
        measure_ridges(frame, start, normals, reach, widths, offset, contrast)
        seen = np.isfinite(offset)
        # paint of half the width makes half the contrast
        contrast /= np.minimum(widths, _FULL_WIDTH_PX)
        if seen.any():
            seen &= contrast > _LEAST_CONTRAST * np.median(contrast[seen])
        count = int(seen.sum())
        if count < _LEAST_MARKS:
            return None
        paint = _PAINTED_TO_M / self._width_m * widths[seen]
        sigma = np.sqrt(
            (_SAMPLE_ERROR_PX * np.maximum(1.0, _SHARP_WIDTH_PX / widths[seen])) ** 2
            + paint**2
            + _LINE_ERROR_PX**2 * count
        )
        worth = np.minimum(1.0, widths / _SHARP_WIDTH_PX) ** 2
        joined = replace(
            samples,
            mark_m=marks[seen],
            mark_uv=np.ascontiguousarray(to_ideal(self._camera, start[seen] + normals[seen] * offset[seen, None])),
            mark_direction=normals[seen],
            sigma=np.concatenate([samples.sigma, sigma]),
        )
        return joined, worth[seen], float(worth.sum()), float(reach.max())
