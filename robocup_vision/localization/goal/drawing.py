"""Compares all field lines, drawn as a camera would see them, with the picture, along the arc of a goal far away.

Far lines run into each other: a circle seen flat is two bright spots on the line through it, and no ridge of its own.
Drawn together they still look like nothing else, and pixel by pixel they determine where on its arc a camera stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.kernels.goal.fit import FitSamples
from robocup_vision.kernels.goal.lines.settle import DrawnPicture, drawn_likelihood, settle_drawing
from robocup_vision.kernels.lines.drawing import MARGIN, LinePen, move_drawings, stroke_table
from robocup_vision.kernels.lines.drawn_light import AROUND, LitCarpet, compare_each_line, light_carpet
from robocup_vision.localization.goal.arc import ConstrainedArc
from robocup_vision.localization.goal.fit import GoalModel
from robocup_vision.perception.goal_region import carpet_mask


@dataclass(frozen=True, slots=True)
class DrawingSettings:
    """How lines are drawn and compared with the picture."""

    blur_px: float = 0.75  #: standard deviation of the drawn lines' blur: a small camera's optics and chip
    max_gap_m: float = 0.07  #: greatest distance between neighbouring points of one line
    max_levels: float = (
        40.0  #: grey levels over the mean at which light is cut off: brighter paint, or a ball, weighs no more
    )
    border_px: int = 5  #: width of the carpet's border that is left out: other things mix into it
    pixels_for_one: float = 25.0  #: number of pixels that count as one measurement: errors of neighbours are correlated
    #: steps to either side of a heading, and how often they are halved
    steps: int = 5
    halvings: int = 4
    loose_step: float = 0.5  #: first step in the directions that the samples determine least, standard deviations
    #: common error of all drawn lines for each direction searched: of lens, blur and paint that the drawing leaves out
    drawn_to_px: float = 0.15
    #: greatest mean squared difference, weighted by the drawing, between the light along single lines and along all:
    #: paint is the same everywhere. A sixth of the drawing on bare carpet, at a wrong place, makes a fifth.
    max_spread: float = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """The camera on an arc whose drawn lines agree best with the picture."""

    likelihood: float  #: log-likelihood ratio to no lines at all
    unknowns: FloatArray
    covariance: FloatArray
    #: fraction of the drawing, by its pixels' weight, along lines that are at least half as bright as the rest
    shown_ratio: float


class LineDrawing:
    """Compares drawn lines, see `line_pen`, with one frame (H, W, 3) uint8, BGR."""

    def __init__(
        self,
        frame: npt.NDArray[np.uint8],
        pen: LinePen,
        settings: DrawingSettings = DrawingSettings(),
    ) -> None:
        self._settings = settings
        window = (AROUND, AROUND)
        self._picture: DrawnPicture | None = None
        closed = cv2.morphologyEx(carpet_mask(frame), cv2.MORPH_CLOSE, np.ones(window, np.uint8))
        border = np.ones((settings.border_px, settings.border_px), np.uint8)
        carpet = np.asarray(cv2.erode(closed, border), np.uint8)
        rows = np.flatnonzero(carpet.any(axis=1))
        first_row = int(rows[0]) if len(rows) else frame.shape[0]
        height, width = frame.shape[0] - first_row, frame.shape[1]
        if height <= MARGIN:
            return
        lit = LitCarpet(*(np.empty((height, width), np.float32) for _ in range(3)))
        pixels, light_square = light_carpet(frame[first_row:], carpet[first_row:], settings.max_levels, lit)
        self._picture = DrawnPicture(
            lit,
            pen,
            first_row,
            np.zeros((height + 2 * MARGIN, width + 2 * MARGIN), np.float32),
            light_square,
            pixels / settings.pixels_for_one,
        )

    def likelihood(self, model: GoalModel, unknowns: FloatArray) -> float:
        """Logarithm of how much likelier the carpet's light is with these lines than without any."""
        if self._picture is None:
            return 0.0
        return float(drawn_likelihood(self._picture, model.scene.camera, unknowns))

    def _single_lines(self, picture: DrawnPicture, model: GoalModel, unknowns: FloatArray) -> tuple[float, float]:
        """Mean square by which the light along single lines differs from that along all; ratio of the lines shown."""
        sums, pen = np.empty((2, len(picture.pen.starts) - 1)), picture.pen
        compare_each_line(picture.carpet, pen, model.scene.camera, unknowns, picture.first_row, picture.drawing, sums)
        weight, light = sums
        shown = weight > 0.0
        if not shown.any() or light.sum() <= 0.0:
            return math.inf, 0.0
        bright = light[shown] / weight[shown] * (weight.sum() / light.sum())
        weight = weight[shown] / weight.sum()
        return float(weight @ (bright - 1.0) ** 2), float(weight[bright >= 0.5].sum())

    def settle(
        self, model: GoalModel, samples: FitSamples, start: FloatArray, reach_rad: float, loose: int = 0
    ) -> Drawn | None:
        """Find the heading within `reach_rad` at which the drawn lines agree best, all else by the samples.

        Parameters
        ----------
        start : (8,) float64
            The samples' best fit.
        loose : int
            Number of further directions that are searched: those that the samples determine least at one heading.

        Returns
        -------
        Drawn or None
            None where the samples determine no camera, or some of the lines are not visible.
        """
        picture = self._picture
        if picture is None:
            return None
        arc = ConstrainedArc(model, samples, start)
        axes, place = np.zeros(3), np.empty(3)
        axes[0], axes[1 : 1 + loose] = reach_rad / self._settings.steps, self._settings.loose_step
        likelihood = settle_drawing(picture, arc.for_search, axes, self._settings.steps, self._settings.halvings, place)
        if likelihood <= 0.0:
            return None
        at, last = place[: 1 + loose], np.diag(axes[: 1 + loose]) / 2**self._settings.halvings
        covariance = self._covariance(picture, model, arc, at, 2 * last, likelihood)
        best = arc.camera(at)
        if best is None or covariance is None:
            return None
        spread, shown = self._single_lines(picture, model, best[0])
        return Drawn(likelihood, best[0], covariance, shown) if spread <= self._settings.max_spread else None

    def _covariance(
        self,
        picture: DrawnPicture,
        model: GoalModel,
        arc: ConstrainedArc,
        at: FloatArray,
        axes: FloatArray,
        likelihood: float,
    ) -> FloatArray | None:
        """Covariance (8, 8) at a place on an arc, by how far the drawing moves with the camera; axes (K, K) to try."""
        neighbours = [arc.camera(place) for axis in axes for place in (at - axis, at + axis)]
        cameras = np.array([found[0] for found in neighbours if found is not None])
        if len(cameras) < len(neighbours):
            return None
        length = 2 * np.diag(axes)
        along = (cameras[1::2] - cameras[::2]).T / length
        motion = self._motion(picture, model, cameras) / np.outer(length, length)
        # a faint drawing is located as well as noise allows, a plain one as well as the model describes the picture
        off_px2 = (len(axes) * self._settings.drawn_to_px) ** 2 + self._settings.blur_px**2 / likelihood
        spread = np.linalg.inv(motion / off_px2 + np.diag([1e-9] + (len(axes) - 1) * [1.0]))
        return np.asarray(arc.rest(at) + along @ spread @ along.T, np.float64)

    def _motion(self, picture: DrawnPicture, model: GoalModel, cameras: FloatArray) -> FloatArray:
        """How far lines move across themselves between two cameras each, (2K, 8): mean products (K, K), px^2."""
        drawn = np.zeros((len(cameras), *picture.drawing.shape), np.float32)
        products = np.empty((len(cameras) // 2, len(cameras) // 2))
        steepness = move_drawings(picture.pen, model.scene.camera, cameras, picture.first_row, drawn, products)
        return products / max(steepness, 1e-12)


def line_pen(points: FloatArray, line_width_m: float, settings: DrawingSettings = DrawingSettings()) -> LinePen:
    """Return lines to draw by points (N, 2) along them, one line after the other, field frame, metres."""
    apart_m = np.linalg.norm(np.diff(points, axis=0), axis=1)
    starts = np.array([0, *(np.flatnonzero(apart_m > settings.max_gap_m) + 1), len(points)])
    return LinePen(points, starts, float(line_width_m), stroke_table(settings.blur_px))
