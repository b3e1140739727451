"""How well all field lines, drawn as a camera would see them, agree with the picture: along the arc of a goal far off.

Far lines run into each other: a circle seen flat is two bright spots on the line through it, and no ridge of its own.
Drawn together they still look like nothing else, and pixel by pixel they tell where along its arc a camera stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from robocup_vision.geometry import FloatArray
from robocup_vision.kernels.line_drawing import draw_lines
from robocup_vision.localization.goal_edges import EdgeSamples
from robocup_vision.localization.goal_fit import GoalModel, covariance_of, fit
from robocup_vision.localization.goal_geometry import HEADING, X, Y
from robocup_vision.perception.goal_region import carpet_mask

Float32Array = npt.NDArray[np.float32]

_BLUR_PX = 0.75
_APART_M = 0.07  # points of one line lie nearer together
_AROUND_PX = 9  # what is compared is the light over that around it
_MOST_LEVELS = 40.0  # of grey, above which nothing says more
_BORDER_PX = 5  # of the carpet, where something else begins
# neighbouring pixels err together: so many count for one
_PIXELS_FOR_ONE = 4.0
# along the arc: how far, and in what steps, standard deviations; and how often these are halved
_REACH_STDS, _STEP_STDS, _HALVINGS = 2.5, 0.5, 4
_SCALES = np.full(3, 0.5)
# what drawn lines are off as a whole: by lens, blur and paint that the drawing does not know of
_DRAWN_TO_PX = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """The camera on an arc whose drawn lines agree best with the picture.

    Parameters
    ----------
    likelihood : float
        Logarithm, over that of no lines at all.
    unknowns, covariance : (8,), (8, 8) float64
        Of the camera.
    """

    likelihood: float
    unknowns: FloatArray
    covariance: FloatArray


class LineDrawing:
    """Compares drawn lines with one frame.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR.
    points : (N, 2) float64
        Along the field's lines, field frame, metres.
    line_width_m : float
        Of the paint.
    """

    def __init__(self, frame: npt.NDArray[np.uint8], points: FloatArray, line_width_m: float) -> None:
        carpet = cv2.morphologyEx(carpet_mask(frame), cv2.MORPH_CLOSE, np.ones((_AROUND_PX, _AROUND_PX), np.uint8))
        carpet = cv2.erode(carpet, np.ones((_BORDER_PX, _BORDER_PX), np.uint8))
        rows = np.flatnonzero(carpet.any(axis=1))
        self._points, self._width_m = points, line_width_m
        self._first_row = int(rows[0]) if len(rows) else frame.shape[0]
        below = frame[self._first_row :]
        self._on_carpet = (carpet[self._first_row :] > 0).astype(np.float32)
        self._drawing = np.empty(self._on_carpet.shape, np.float32)
        if len(rows):
            size = (_AROUND_PX, _AROUND_PX)
            self._nearby = np.maximum(cv2.blur(self._on_carpet, size), np.float32(1e-3))
            paint = self._over_nearby(np.asarray(cv2.min(below[..., 0], below[..., 2]), np.float32))
            self._light = np.clip(paint, -_MOST_LEVELS, _MOST_LEVELS)

    def _over_nearby(self, light: Float32Array) -> Float32Array:
        mean = np.asarray(cv2.blur(light * self._on_carpet, (_AROUND_PX, _AROUND_PX)), np.float32) / self._nearby
        return np.asarray((light - mean) * self._on_carpet, np.float32)

    def likelihood(self, model: GoalModel, unknowns: FloatArray) -> float:
        """Logarithm of how much likelier the carpet's light is with these lines than without any."""
        if not len(self._drawing):
            return 0.0
        drawn = self._over_nearby(self._drawn(model, unknowns))
        both = float(np.vdot(drawn, self._light))
        own, light = float(np.vdot(drawn, drawn)), float(np.vdot(self._light, self._light))
        if both <= 0.0 or own <= 0.0:
            return 0.0
        pixels = np.count_nonzero(self._on_carpet) / _PIXELS_FOR_ONE
        return -0.5 * pixels * math.log(max(1.0 - both * both / (own * light), 1e-9))

    def _drawn(self, model: GoalModel, unknowns: FloatArray) -> Float32Array:
        draw_lines(
            self._points,
            _APART_M,
            model.view_array,
            unknowns,
            self._width_m,
            _BLUR_PX,
            self._first_row,
            self._drawing,
        )
        return self._drawing

    def settle(self, model: GoalModel, samples: EdgeSamples, start: FloatArray, covariance: FloatArray) -> Drawn:
        """Find the heading at which the lines drawn agree best, all else as the samples have it there.

        Parameters
        ----------
        model : GoalModel
            Camera, goal and priors.
        samples : EdgeSamples
            Of the goal, and marks on lines.
        start, covariance : (8,), (8, 8) float64
            What they give.
        """
        weight = model.weight.copy()
        weight[HEADING] = np.inf
        held = replace(model, weight=weight)
        line = model.shape.line_x_m
        seen: dict[float, tuple[float, FloatArray, FloatArray]] = {}

        def look(turn: float) -> float:
            if turn not in seen:
                c, s = math.cos(turn), math.sin(turn)
                dx, dy = start[X] - line, start[Y]
                p = start.copy()
                p[X], p[Y], p[HEADING] = line + c * dx - s * dy, s * dx + c * dy, start[HEADING] + turn
                p, cost, information = fit(held, samples, p, _SCALES)
                told = self.likelihood(model, p) - cost / 2 if math.isfinite(cost) else -math.inf
                seen[turn] = (told, p, information)
            return seen[turn][0]

        step = _STEP_STDS * math.sqrt(covariance[HEADING, HEADING])
        steps = round(_REACH_STDS / _STEP_STDS)
        best = max((k * step for k in range(-steps, steps + 1)), key=look)
        for _ in range(_HALVINGS):
            step /= 2
            best = max((best - step, best, best + step), key=look)
        below, at, above = look(best - step), look(best), look(best + step)
        bend = max(2 * at - below - above, 1e-9) / step**2
        along = seen[best + step][1] - seen[best - step][1]
        slope = along / (2 * step)
        likelihood, p, information = seen[best]
        p = p + slope * min(max((above - below) / (2 * bend * step), -0.5), 0.5) * step
        moves_px = self._motion(model, seen[best - step][1], seen[best + step][1]) / (2 * step)
        variance = 1.0 / bend + (_DRAWN_TO_PX / max(moves_px, 1e-9)) ** 2
        return Drawn(likelihood, p, covariance_of(held, information) + np.outer(slope, slope) * variance)

    def _motion(self, model: GoalModel, one: FloatArray, other: FloatArray) -> float:
        """How far lines move across themselves from one camera to the other, root mean square, pixels."""
        before = self._drawn(model, one).copy()
        after = self._drawn(model, other)
        middle = 0.5 * (before + after)
        steepness = np.sum(np.diff(middle, axis=0) ** 2) + np.sum(np.diff(middle, axis=1) ** 2)
        return math.sqrt(float(np.sum((after - before) ** 2)) / max(float(steepness), 1e-12))
