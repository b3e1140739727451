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
from robocup_vision.localization.goal_geometry import HEADING, UNKNOWNS, X, Y
from robocup_vision.perception.goal_region import carpet_mask

Float32Array = npt.NDArray[np.float32]

_BLUR_PX = 0.75
_APART_M = 0.07  # points of one line lie nearer together
_AROUND_PX = 9  # what is compared is the light over that around it
_MOST_LEVELS = 40.0  # of grey, above which nothing says more
_BORDER_PX = 5  # of the carpet, where something else begins
# neighbouring pixels err together: so many count for one
_PIXELS_FOR_ONE = 25.0
# steps to either side of a heading, and how often they are halved
_STEPS, _HALVINGS = 5, 4
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
            In how many directions, of those that the samples tell least at one heading, the camera is searched as well.

        Returns
        -------
        Drawn or None
            None where the samples do not hold a camera.
        """
        arc = _Arc(model, samples, start)
        at = np.zeros(1 + loose)
        step = np.array([reach_rad / _STEPS] + loose * [0.5])

        def told(place: tuple[float, ...]) -> float:
            p = arc.camera(place)
            return -math.inf if p is None else self.likelihood(model, p[0]) - p[1] / 2

        seen: dict[tuple[float, ...], float] = {}

        def look(place: FloatArray) -> float:
            key = tuple(place.tolist())
            if key not in seen:
                seen[key] = told(key)
            return seen[key]

        axes = np.diag(step)
        ways = range(-_STEPS, _STEPS + 1)
        at = max((at + k * axes[0] + m * axes[-1] for k in ways for m in (ways[1::2] if loose else (0,))), key=look)
        for _ in range(_HALVINGS):
            axes = axes / 2
            for axis in (*axes, *axes[:1]) if loose else axes:
                at = max((at - axis, at, at + axis), key=look)
        likelihood = look(at)
        best = arc.camera(tuple(at.tolist()))
        if best is None or likelihood <= 0.0:
            return None
        ends = [(arc.camera(tuple((at - a).tolist())), arc.camera(tuple((at + a).tolist()))) for a in 2 * axes]
        if any(one is None or other is None for one, other in ends):
            return None
        between = np.array([other[0] - one[0] for one, other in ends if one is not None and other is not None])
        pairs = [(one[0], other[0]) for one, other in ends if one is not None and other is not None]
        along = between.T / (4 * np.diag(axes))
        motion = self._motion(model, best[0], pairs) / np.outer(4 * np.diag(axes), 4 * np.diag(axes))
        off_px2 = _DRAWN_TO_PX**2 + _BLUR_PX**2 / likelihood
        spread = np.linalg.inv(motion / off_px2 + np.diag([1e-9] + loose * [1.0]))
        return Drawn(likelihood, best[0], arc.rest(best[2], loose) + along @ spread @ along.T)

    def _motion(self, model: GoalModel, at: FloatArray, pairs: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
        """How far lines move across themselves from one camera to the other of each pair: mean products (K, K), px^2."""
        drawn = self._drawn(model, at).astype(np.float64)
        steepness = float(np.sum(np.gradient(drawn, axis=0) ** 2) + np.sum(np.gradient(drawn, axis=1) ** 2))
        changes = []
        for one, other in pairs:
            before = self._drawn(model, one).copy()
            changes.append((self._drawn(model, other) - before).ravel().astype(np.float64))
        return np.asarray(np.array(changes) @ np.array(changes).T / max(steepness, 1e-12))


class _Arc:
    """Cameras at headings near one, all else as samples have it there, and what they tell least."""

    def __init__(self, model: GoalModel, samples: EdgeSamples, start: FloatArray) -> None:
        weight = model.weight.copy()
        weight[HEADING] = np.inf
        self._held = replace(model, weight=weight)
        self._samples, self._start = samples, start
        self._fits: dict[float, tuple[FloatArray, float, FloatArray] | None] = {}
        first = self._fit(0.0)
        self._covariance = np.zeros((UNKNOWNS, UNKNOWNS)) if first is None else covariance_of(self._held, first[2])
        # metres and radians: in what they move, everything counts alike over a few metres
        variance, vectors = np.linalg.eigh(self._covariance)
        self._loosest = (vectors * np.sqrt(np.maximum(variance, 0.0))).T[::-1]

    def loosest(self, count: int) -> FloatArray:
        """Directions (count, 8), one standard deviation each."""
        return self._loosest[:count][::-1]

    def rest(self, information: FloatArray, count: int) -> FloatArray:
        """Covariance (8, 8) at one heading less what lies in the loosest directions."""
        if count == 0:
            return covariance_of(self._held, information)
        loosest = self.loosest(count)
        return np.asarray(self._covariance - loosest.T @ loosest)

    def camera(self, place: tuple[float, ...]) -> tuple[FloatArray, float, FloatArray] | None:
        """Camera at a turn of the heading and so many standard deviations off in the loosest directions; its cost."""
        at_heading = self._fit(place[0])
        if at_heading is None:
            return None
        p, cost, information = at_heading
        off = np.array(place[1:])
        return p + off @ self.loosest(len(off)), cost + float(off @ off), information

    def _fit(self, turn: float) -> tuple[FloatArray, float, FloatArray] | None:
        if turn not in self._fits:
            line = self._held.shape.line_x_m
            c, s = math.cos(turn), math.sin(turn)
            dx, dy = self._start[X] - line, self._start[Y]
            p = self._start.copy()
            p[X], p[Y], p[HEADING] = line + c * dx - s * dy, s * dx + c * dy, self._start[HEADING] + turn
            p, cost, information = fit(self._held, self._samples, p, _SCALES)
            self._fits[turn] = (p, cost, information) if math.isfinite(cost) else None
        return self._fits[turn]
