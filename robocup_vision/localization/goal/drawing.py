"""How well all field lines, drawn as a camera would see them, agree with the picture: along the arc of a goal far off.

Far lines run into each other: a circle seen flat is two bright spots on the line through it, and no ridge of its own.
Drawn together they still look like nothing else, and pixel by pixel they determine where on its arc a camera stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.kernels.lines.drawing import draw_lines
from robocup_vision.localization.goal.arc import ConstrainedArc
from robocup_vision.localization.goal.edges import EdgeSamples
from robocup_vision.localization.goal.fit import GoalModel
from robocup_vision.perception.goal_region import carpet_mask


@dataclass(frozen=True, slots=True)
class DrawingSettings:
    """How lines are drawn and compared with the picture.

    Parameters
    ----------
    blur_px : float
        Of the drawn lines: a small camera's optics and chip, one standard deviation.
    max_gap_m : float
        Points of one line lie nearer together; two farther apart are of two lines.
    around_px : int
        Side of the square whose mean light is taken off: shadows and lamps are wider, lines narrower.
    max_levels : float
        Grey levels over the mean that count: brighter paint, or a ball, weighs no more.
    border_px : int
        Of the carpet that is left out, where something else begins.
    pixels_for_one : float
        Neighbouring pixels err together: so many count for one measurement.
    steps, halvings : int
        Steps to either side of a heading, and how often they are halved.
    loose_step : float
        First step in the directions that the samples determine least, standard deviations.
    max_spread : float
        Mean square by which the light along single lines, weighed by their drawing, may differ from that along all:
        paint is the same everywhere. A sixth of the drawing on bare carpet, at a wrong place, makes a fifth.
    drawn_to_px : float
        What drawn lines are off as a whole for each direction searched: by lens, blur and paint that the drawing leaves
        out.
    """

    blur_px: float = 0.75
    max_gap_m: float = 0.07
    around_px: int = 9
    max_levels: float = 40.0
    border_px: int = 5
    pixels_for_one: float = 25.0
    steps: int = 5
    halvings: int = 4
    loose_step: float = 0.5
    drawn_to_px: float = 0.15
    max_spread: float = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """The camera on an arc whose drawn lines agree best with the picture.

    Parameters
    ----------
    likelihood : float
        Logarithm, over that of no lines at all.
    unknowns, covariance : (8,), (8, 8) float64
        Of the camera.
    shown_ratio : float
        Of the drawing, by what its pixels tell, the part along lines that are at least half as bright as the rest.
    """

    likelihood: float
    unknowns: FloatArray
    covariance: FloatArray
    shown_ratio: float


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
    settings : DrawingSettings, optional
        How lines are drawn and compared.
    """

    def __init__(
        self,
        frame: npt.NDArray[np.uint8],
        points: FloatArray,
        line_width_m: float,
        settings: DrawingSettings = DrawingSettings(),
    ) -> None:
        self._settings = settings
        self._around = (settings.around_px, settings.around_px)
        carpet = cv2.morphologyEx(carpet_mask(frame), cv2.MORPH_CLOSE, np.ones(self._around, np.uint8))
        carpet = cv2.erode(carpet, np.ones((settings.border_px, settings.border_px), np.uint8))
        rows = np.flatnonzero(carpet.any(axis=1))
        self._points, self._width_m = points, line_width_m
        apart_m = np.linalg.norm(np.diff(points, axis=0), axis=1)
        self._each_line = np.split(points, np.flatnonzero(apart_m > settings.max_gap_m) + 1)
        self._first_row = int(rows[0]) if len(rows) else frame.shape[0]
        below = frame[self._first_row :]
        self._on_carpet = (carpet[self._first_row :] > 0).astype(np.float32)
        if len(rows):
            self._nearby = np.maximum(cv2.blur(self._on_carpet, self._around), np.float32(1e-3))
            paint = self._over_nearby(np.asarray(cv2.min(below[..., 0], below[..., 2]), np.float32))
            self._light = np.clip(paint, -settings.max_levels, settings.max_levels)
            self._light_square = float(np.vdot(self._light, self._light))
        self._pixels = np.count_nonzero(self._on_carpet) / settings.pixels_for_one

    def _over_nearby(self, light: Float32Array) -> Float32Array:
        mean = np.asarray(cv2.blur(light * self._on_carpet, self._around), np.float32) / self._nearby
        return np.asarray((light - mean) * self._on_carpet, np.float32)

    def likelihood(self, model: GoalModel, unknowns: FloatArray) -> float:
        """Logarithm of how much likelier the carpet's light is with these lines than without any."""
        if not len(self._on_carpet):
            return 0.0
        drawn = self._over_nearby(self._drawn(model, unknowns))
        both = float(np.vdot(drawn, self._light))
        own = float(np.vdot(drawn, drawn))
        if both <= 0.0 or own <= 0.0:
            return 0.0
        return -0.5 * self._pixels * math.log(max(1.0 - both * both / (own * self._light_square), 1e-9))

    def _single_lines(self, model: GoalModel, unknowns: FloatArray) -> tuple[float, float]:
        """Mean square by which the light along single lines differs from that along all; ratio of the lines shown."""
        drawn = self._drawn(model, unknowns)
        levels = self._over_nearby(drawn)
        own, both = levels * levels, levels * self._light
        lines = [np.asarray(self._drawn(model, unknowns, line) > 0.5 * drawn, np.float32) for line in self._each_line]
        weight = np.array([float(np.vdot(own, line)) for line in lines])
        light = np.array([float(np.vdot(both, line)) for line in lines])
        shown = weight > 0.0
        if not shown.any() or light.sum() <= 0.0:
            return math.inf, 0.0
        bright = light[shown] / weight[shown] * (weight.sum() / light.sum())
        weight = weight[shown] / weight.sum()
        return float(weight @ (bright - 1.0) ** 2), float(weight[bright >= 0.5].sum())

    def _drawn(self, model: GoalModel, unknowns: FloatArray, points: FloatArray | None = None) -> Float32Array:
        drawing = np.empty(self._on_carpet.shape, np.float32)
        draw_lines(
            self._points if points is None else points,
            self._settings.max_gap_m,
            model.scene.camera,
            unknowns,
            self._width_m,
            self._settings.blur_px,
            self._first_row,
            drawing,
        )
        return drawing

    def settle(
        self, model: GoalModel, samples: EdgeSamples, start: FloatArray, reach_rad: float, loose: int = 0
    ) -> Drawn | None:
        """Find the heading at which the lines drawn agree best, all else as the samples have it there.

        Parameters
        ----------
        model : GoalModel
            Camera, goal and priors.
        samples : EdgeSamples
            Of the goal, and any marks on lines.
        start : (8,) float64
            What they give.
        reach_rad : float
            How far off its heading may be.
        loose : int
            In how many directions the camera is searched as well: those that the samples determine least at one
            heading.

        Returns
        -------
        Drawn or None
            None where the samples determine no camera, or some of the lines are not there.
        """
        arc = ConstrainedArc(model, samples, start)
        seen: dict[tuple[float, ...], float] = {}

        def value(place: FloatArray) -> float:
            key = tuple(place.tolist())
            if key not in seen:
                found = arc.camera(place)
                seen[key] = -math.inf if found is None else self.likelihood(model, found[0]) - found[1] / 2
            return seen[key]

        steps = self._settings.steps
        axes = np.diag([reach_rad / steps] + loose * [self._settings.loose_step])
        ways = range(-steps, steps + 1)
        others = ways[1::2] if loose else (0,)
        at = max((k * axes[0] + m * axes[-1] for k in ways for m in others), key=value)
        for _ in range(self._settings.halvings):
            axes = axes / 2
            for axis in (*axes, *axes[:1]) if loose else axes:
                at = max((at - axis, at, at + axis), key=value)
        covariance = self._covariance(model, arc, at, 2 * axes, value(at)) if value(at) > 0.0 else None
        best = arc.camera(at)
        if best is None or covariance is None:
            return None
        spread, shown = self._single_lines(model, best[0])
        return Drawn(value(at), best[0], covariance, shown) if spread <= self._settings.max_spread else None

    def _covariance(
        self, model: GoalModel, arc: ConstrainedArc, at: FloatArray, axes: FloatArray, likelihood: float
    ) -> FloatArray | None:
        """Covariance (8, 8) at a place on an arc, by how far the drawing moves with the camera; axes (K, K) to try."""
        around = [arc.camera(place) for axis in axes for place in (at - axis, at + axis)]
        cameras = np.array([found[0] for found in around if found is not None])
        if len(cameras) < len(around):
            return None
        length = 2 * np.diag(axes)
        along = (cameras[1::2] - cameras[::2]).T / length
        motion = self._motion(model, cameras) / np.outer(length, length)
        # a faint drawing is located as well as noise allows, a plain one as well as the model describes the picture
        off_px2 = (len(axes) * self._settings.drawn_to_px) ** 2 + self._settings.blur_px**2 / likelihood
        spread = np.linalg.inv(motion / off_px2 + np.diag([1e-9] + (len(axes) - 1) * [1.0]))
        return np.asarray(arc.rest(at) + along @ spread @ along.T, np.float64)

    def _motion(self, model: GoalModel, cameras: FloatArray) -> FloatArray:
        """How far lines move across themselves between two cameras each, (2K, 8): mean products (K, K), px^2."""
        drawn = [self._drawn(model, camera) for camera in cameras]
        first = drawn[0]
        slopes = ((first[1:] - first[:-1]).ravel(), (first[:, 1:] - first[:, :-1]).ravel())
        steepness = sum(float(np.vdot(slope, slope)) for slope in slopes)
        moved = [(after - before).ravel() for before, after in zip(drawn[::2], drawn[1::2], strict=True)]
        products = [[float(np.vdot(one, other)) for other in moved] for one in moved]
        return np.array(products) / max(steepness, 1e-12)
