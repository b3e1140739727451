"""Compares all field lines, drawn as a camera would see them, with the picture, along the arc of a goal far away.

Far lines run into each other: a circle seen flat is two bright spots on the line through it, and no ridge of its own.
Drawn together they still look like nothing else, and pixel by pixel they determine where on its arc a camera stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.kernels.goal.fit import FitSamples
from robocup_vision.kernels.lines.drawing import MARGIN, LinePen, draw_lines, stroke_table
from robocup_vision.kernels.lines.drawn_light import AROUND, LitCarpet, compare_drawing, light_carpet
from robocup_vision.localization.goal.arc import FitsByHeading
from robocup_vision.localization.goal.fit import GoalModel
from robocup_vision.perception.goal_region import carpet_mask

_BLUR_PX = 0.75  # standard deviation of the drawn lines' blur: a small camera's optics and chip
_PIXELS_FOR_ONE = 25.0  # number of pixels that count as one measurement: errors of neighbours are correlated
# steps to either side of a heading, and how often they are halved
_STEPS = 5
_HALVINGS = 4
# common error of all drawn lines of lens, blur and paint that the drawing leaves out
_DRAWN_TO_PX = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """The camera on an arc whose drawn lines agree best with the picture."""

    likelihood: float  #: log-likelihood ratio to no lines at all
    unknowns: FloatArray
    covariance: FloatArray


class LineDrawing:
    """Compares drawn lines, see `line_pen`, with one frame (H, W, 3) uint8, BGR."""

    def __init__(self, frame: UInt8Array, pen: LinePen) -> None:
        self._pen = pen
        around = np.ones((AROUND, AROUND), np.uint8)
        carpet = np.asarray(cv2.morphologyEx(carpet_mask(frame), cv2.MORPH_CLOSE, around), np.uint8)
        rows = np.flatnonzero(carpet.any(axis=1))
        self._first_row = int(rows[0]) if len(rows) else frame.shape[0]
        height, width = frame.shape[0] - self._first_row, frame.shape[1]
        self._shows_carpet = height > MARGIN
        if not self._shows_carpet:
            return
        self._carpet = LitCarpet(*(np.empty((height, width), np.float32) for _ in range(3)))
        first = self._first_row
        self._pixels, self._light_square = light_carpet(frame[first:], carpet[first:], self._carpet)
        # working memory, zero before and after each use
        self._drawing = np.zeros((height + 2 * MARGIN, width + 2 * MARGIN), np.float32)

    def likelihood(self, model: GoalModel, unknowns: FloatArray) -> float:
        """Logarithm of how much likelier the carpet's light is with these lines than without any."""
        if not self._shows_carpet:
            return 0.0
        view, first_row = model.scene.camera, self._first_row
        own, both = compare_drawing(self._carpet, self._pen, view, unknowns, first_row, self._drawing)
        if both <= 0.0 or own <= 0.0:
            return 0.0
        unexplained = max(1.0 - both * both / (own * self._light_square), 1e-9)
        return -0.5 * self._pixels / _PIXELS_FOR_ONE * math.log(unexplained)

    def settle(self, model: GoalModel, samples: FitSamples, start: FloatArray, reach_rad: float) -> Drawn | None:
        """Find the heading within `reach_rad` at which the drawn lines agree best, all else by the samples.

        `start` (8,) is the samples' best fit. None where the samples determine no camera, or no lines are visible.
        """
        if not self._shows_carpet:
            return None
        fits, steps = FitsByHeading(model, samples, start), _STEPS

        def value(turn: float) -> float:
            found = fits.at(turn)
            return -math.inf if found is None else self.likelihood(model, found[0]) - found[1] / 2

        step = reach_rad / steps
        likelihood, turn = max((value(k * step), k * step) for k in range(-steps, steps + 1))
        for _ in range(_HALVINGS):
            step /= 2
            likelihood, turn = max((likelihood, turn), *((value(at), at) for at in (turn - step, turn + step)))
        near = [fits.at(turn + offset) for offset in (-2 * step, 0.0, 2 * step)]
        before, best, after = near
        if likelihood <= 0.0 or before is None or best is None or after is None:
            return None
        along = (after[0] - before[0]) / (4 * step)
        motion = self._motion_px2(model, before[0], after[0]) / (4 * step) ** 2
        # a faint drawing is located as well as noise allows, a plain one as well as the model describes the picture
        off_px2 = _DRAWN_TO_PX**2 + _BLUR_PX**2 / likelihood
        covariance = best[2] + np.outer(along, along) * off_px2 / max(motion, 1e-9 * off_px2)
        return Drawn(likelihood, best[0], covariance)

    def _motion_px2(self, model: GoalModel, before: FloatArray, after: FloatArray) -> float:
        """Mean square of how far lines move across themselves between two cameras (8,)."""
        drawn = np.zeros((2, *self._drawing.shape), np.float32)
        for p, picture in zip((before, after), drawn, strict=True):
            draw_lines(self._pen, model.scene.camera, p, self._first_row, picture)
        drawn = drawn[:, MARGIN:-MARGIN, MARGIN:-MARGIN]
        steepness = sum(float((np.diff(drawn[0], axis=axis) ** 2).sum()) for axis in (0, 1))
        return float(((drawn[1] - drawn[0]) ** 2).sum()) / max(steepness, 1e-12)


def line_pen(points: FloatArray, starts: Int64Array, line_width_m: float) -> LinePen:
    """Return lines to draw by points (N, 2) along them, field frame, metres, and each line's first point, then N."""
    return LinePen(points, starts, float(line_width_m), stroke_table(_BLUR_PX))
