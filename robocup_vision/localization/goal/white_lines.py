"""Fits field lines around a white goal: the goal gives a rough pose of the camera, the lines an exact one.

From afar a goal alone hardly fixes the angle to it, and its distance stands and falls with focal length
and bar height. The lines around the camera do not, but fit in several places. Together tilt, roll, height and focal
length are unknowns under priors, and what is left is centimetres.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera, camera_rotation
from robocup_vision.kernels.algebra.pinhole import slopes_to_floor
from robocup_vision.kernels.goal.fit import FitLoss
from robocup_vision.kernels.goal.lines.fit import AssociatedMarks, LinePlaces, associate_points, fit_to_points
from robocup_vision.localization.goal.edges import EdgeSamples, no_samples, to_ideal
from robocup_vision.localization.goal.fit import GoalModel, covariance_of, residuals, system_at
from robocup_vision.localization.goal.geometry import (
    EDGES,
    HEADING,
    HEIGHT,
    LOG_FOCAL,
    ROLL,
    TILT,
    X,
    Y,
)
from robocup_vision.localization.goal.line_marks import LineFit, LineMarks, MarkSettings, with_marks
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.line_points import LineFinder, LinePoints, LineSettings, cell_middles

_MARKS = MarkSettings(
    spacing_px=0.0,
    cell_px=8.0,
    width_px=(0.7, 40.0),
    clear_px=-math.inf,
    along_px=0.0,
    min_contrast=0.25,
    full_width_px=0.0,
)


@dataclass(frozen=True, slots=True)
class WhiteLineSettings:
    """Settings of the fit of a white goal and the lines around it.

    Parameters
    ----------
    marks : MarkSettings
        Places along lines. Clutter around a white goal is bright: only lines of a pixel's width and more count.
    reaches_px : tuple of float
        How far from its predicted place a line is searched for, round by round.
    min_ratio : float
        Of the places predicted in view, so many must show a line in the end: a wrong camera predicts lines on bare
        carpet.
    inlier_px : float
        A line point nearer to a line than this agrees with it.
    line_error_px : float
        Noise of a line point: paint, grass and lens.
    goal_error_m : float
        What goals are built, and stand on their line, to.
    worth : float
        Points along a stretch of line err together: they have this fraction of the information of independent ones.
    patch_m : float
        One point counts for each patch of floor of this size, for the same reason.
    max_points, min_points : int
        Patches grow until no more points than this are left; fewer than the minimum fix no camera.
    rough_scale_px, rough_iterations : float, int
        Scale of the loss from which points found anywhere on the floor are fitted, and how many steps that takes.
    clear_ratio : float
        Of the points on lines from the first start: from here on hardly any are left for another start to win.
    iterations : int
        Steps of each round near the predicted places.
    narrowing, min_scale_px : float, float
        The scale shrinks by this factor a step, down to this.
    goal_scale, min_goal_scale_px : float, float
        Scale of the goal's edges as a fraction of that, and its minimum.
    height_std_m, log_focal_std : float
        Lines calibrate height and focal length better than most camera files: priors are no tighter than this.
    cells_across : int
        In how many cells across the picture it is worked out how wide a line looks.
    """

    marks: MarkSettings = _MARKS
    reaches_px: tuple[float, ...] = (12.0, 6.0, 4.0)
    min_ratio: float = 0.75
    inlier_px: float = 3.0
    line_error_px: float = 1.0
    goal_error_m: float = 0.01
    worth: float = 0.3
    patch_m: float = 0.15
    max_points: int = 400
    min_points: int = 20
    rough_scale_px: float = 12.0
    rough_iterations: int = 14
    clear_ratio: float = 0.95
    iterations: int = 6
    narrowing: float = 0.7
    min_scale_px: float = 2.0
    goal_scale: float = 0.25
    min_goal_scale_px: float = 1.5
    height_std_m: float = 0.02
    log_focal_std: float = 0.02
    cells_across: int = 320


def loosened(model: GoalModel, settings: WhiteLineSettings = WhiteLineSettings()) -> GoalModel:
    """Limit the priors on height and focal length to what they are worth beside lines."""
    weight = model.weight.copy()
    weight[HEIGHT] = min(weight[HEIGHT], settings.height_std_m**-2)
    weight[LOG_FOCAL] = min(weight[LOG_FOCAL], settings.log_focal_std**-2)
    return replace(model, weight=weight)


class _Fitted(NamedTuple):
    """A fit as in `LineFit`, what it was fitted to, and the last scale of its loss."""

    unknowns: FloatArray
    line_ratio: float
    residual_px: FloatArray
    samples: EdgeSamples
    scale_px: float


class WhiteGoalLines:
    """Fits white goals and lines of one field together.

    Parameters
    ----------
    line_map : LineMap
        Of the field.
    camera : PinholeCamera
        The camera.
    settings : WhiteLineSettings, optional
        How lines are found and fitted.
    """

    def __init__(
        self, line_map: LineMap, camera: PinholeCamera, settings: WhiteLineSettings = WhiteLineSettings()
    ) -> None:
        self._line_map, self._camera, self._settings = line_map, camera, settings
        self._level = replace(camera, pan_rad=0.0, offset_m=(0.0, 0.0))
        self._marks = LineMarks(line_map, camera, settings.marks)
        bits = max(0, (camera.size_px[0] // settings.cells_across).bit_length() - 1)
        self._finder_settings = LineSettings(cell_bits=bits)

    @cached_property
    def _slopes(self) -> FloatArray:
        """(R, C, 2) float64: how far right and down for each unit ahead cells' middles are seen."""
        ray = self._camera.pixel_to_camera_ray(cell_middles(self._camera.size_px, self._finder_settings.cell_bits))
        return np.ascontiguousarray(-ray[..., 1:] / ray[..., :1])

    def points(self, frame: UInt8Array, p: FloatArray) -> LinePoints:
        """White line points of a frame, through a camera of the tilt, roll and height of (8,) unknowns."""
        camera = self._level.as_fitted(float(p[TILT]), float(p[ROLL]), float(p[HEIGHT]), self._camera.focal_px)
        floor_m = np.empty(self._slopes.shape)
        turn, offset_m = camera.camera_to_robot, (0.0, 0.0)
        slopes_to_floor(self._slopes.reshape(-1, 2), turn, camera.height_m, offset_m, floor_m.reshape(-1, 2))
        finder = LineFinder(camera, self._marks.line_width_m, settings=self._finder_settings, floor_m=floor_m)
        return finder.find(frame, marks_bare=False)

    def expected(self, model: GoalModel, p: FloatArray) -> int:
        """How many places along lines a camera should have in view."""
        return len(self._marks.predict(model, p))

    def fit_points(
        self,
        model: GoalModel,
        start: FloatArray,
        samples: EdgeSamples | None,
        points: LinePoints,
        others: Iterable[FloatArray] = (),
    ) -> LineFit | None:
        """Fit goal and line points together; None where too few points show the floor in view.

        Parameters
        ----------
        model : GoalModel
            With priors as `loosened` gives them.
        start : (8,) float64
            For the goal at +x.
        samples : EdgeSamples or None
            The goal's edges; None: lines and priors alone.
        points : LinePoints
            Of the same frame.
        others : iterable of (8,) float64, optional
            Starts of the same tilt, roll and height, tried unless nearly all points come to lie on lines from the
            first one. The fit with most points on lines is returned.
        """
        settings = self._settings
        seen = self._on_patches(model, start, to_ideal(self._camera, points.pixels), points.weight)
        if seen is None:
            return None
        best: _Fitted | None = None
        for one in itertools.chain([start], others):
            fitted = self._fit(model, one, samples, seen, settings.rough_scale_px, settings.rough_iterations)
            if fitted is not None and (best is None or fitted.line_ratio > best.line_ratio):
                best = fitted
            if one is start and best is not None and best.line_ratio >= settings.clear_ratio:
                break
        return None if best is None else self._with_covariance(model, best)

    def fit_predicted(
        self, frame: UInt8Array, model: GoalModel, start: FloatArray, samples: EdgeSamples | None
    ) -> LineFit | None:
        """Look for the lines ever closer to where they are predicted; None unless most of them are seen.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR.
        model, start, samples
            See `fit_points`.
        """
        settings, p = self._settings, start
        found: _Fitted | None = None
        for reach in settings.reaches_px:
            uv, _ = self._seen(frame, model, p, reach)
            seen = self._on_patches(model, p, uv, np.ones(len(uv)))
            found = None if seen is None else self._fit(model, p, samples, seen, reach / 2, settings.iterations)
            if found is None:
                return None
            p = found.unknowns
        assert found is not None
        # what is seen within reach of where the final camera puts it decides
        uv, predicted = self._seen(frame, model, p, settings.inlier_px)
        ratio = len(uv) / max(predicted, 1)
        return self._with_covariance(model, found._replace(line_ratio=ratio)) if ratio >= settings.min_ratio else None

    def _seen(self, frame: UInt8Array, model: GoalModel, p: FloatArray, reach_px: float) -> tuple[FloatArray, int]:
        """Ideal pixels (N, 2) of lines near where a camera predicts them, and how many places it predicts."""
        predicted = self._marks.predict(model, p)
        uv, _ = self._marks.measure(frame, predicted, np.full(len(predicted), reach_px))
        return uv, len(predicted)

    def _on_patches(
        self, model: GoalModel, p: FloatArray, pixels: FloatArray, weight: FloatArray
    ) -> tuple[FloatArray, FloatArray] | None:
        """Of ideal pixels (N, 2) and weights (N,), those of one point a patch of the floor; None: they are too few."""
        from_camera = p.copy()
        from_camera[[X, Y, HEADING, LOG_FOCAL]] = 0.0
        floor = _on_floor(model, from_camera, pixels)
        index = np.flatnonzero(np.isfinite(floor).all(axis=1))
        index = index[self._thinned(floor[index])]
        if len(index) < self._settings.min_points:
            return None
        return np.ascontiguousarray(pixels[index]), weight[index]

    def _fit(
        self,
        model: GoalModel,
        start: FloatArray,
        samples: EdgeSamples | None,
        seen: tuple[FloatArray, FloatArray],
        first_scale_px: float,
        iterations: int,
    ) -> _Fitted | None:
        """Fit to what `_on_patches` gives, each point associated with its nearest line anew at every step."""
        settings = self._settings
        pixels, weight = seen
        sigma = settings.line_error_px / np.sqrt(weight)
        places = LinePlaces(pixels, sigma, self._line_map.lines, self._line_map.arcs)
        goal = no_samples() if samples is None else self._as_built(model, samples, start)
        scales = np.maximum(first_scale_px * settings.narrowing ** np.arange(iterations), settings.min_scale_px)
        p, marks = start.copy(), _room(len(sigma))
        if not math.isfinite(
            fit_to_points(model.scene, goal.for_fit, places, model.priors, self._loss(scales), marks, p)
        ):
            return None
        count = associate_points(places, model.scene.camera, p, marks)
        near = marks.point[:count]
        joined = with_marks(
            goal, marks.mark_m[:count], marks.mark_uv[:count], marks.mark_direction[:count], sigma[near]
        )
        residual = residuals(model, joined, p)[len(goal.sigma) :]
        good = np.abs(residual) < settings.inlier_px
        ratio = float(weight[near[good]].sum() / weight.sum())
        return _Fitted(p, ratio, residual[good], joined, float(scales[-1]))

    def _with_covariance(self, model: GoalModel, fitted: _Fitted) -> LineFit:
        sigma = fitted.samples.sigma.copy()
        sigma[len(sigma) - len(fitted.samples.mark_m) :] /= math.sqrt(self._settings.worth)
        shared = replace(fitted.samples, sigma=sigma)
        information, _ = system_at(model, shared, fitted.unknowns, self._loss(np.array([fitted.scale_px])))
        return LineFit(fitted.unknowns, covariance_of(model, information), fitted.line_ratio, fitted.residual_px)

    def _loss(self, scales_px: FloatArray) -> FitLoss:
        goal_px = np.maximum(self._settings.min_goal_scale_px, self._settings.goal_scale * scales_px)
        return FitLoss(goal_px, scales_px, True)

    def _thinned(self, floor_m: FloatArray) -> npt.NDArray[np.intp]:
        """Choose at most `max_points` floor points (N, 2), one a patch; patches grow until they are few enough."""
        patch = self._settings.patch_m
        while True:
            cell = np.floor(floor_m / patch).astype(np.int64)
            _, first = np.unique(cell[:, 0] * 100_003 + cell[:, 1], return_index=True)
            if len(first) <= self._settings.max_points:
                return np.sort(first)
            patch *= 1.3

    def _as_built(self, model: GoalModel, samples: EdgeSamples, p: FloatArray) -> EdgeSamples:
        """Let the samples' noise include how exactly goals are built and placed."""
        distance = math.hypot(model.shape.line_x_m - p[X], p[Y])
        shared = self._settings.goal_error_m * model.view.focal_px[0] / distance
        count = np.concatenate(
            [
                np.bincount(samples.edge, minlength=EDGES)[samples.edge],
                np.bincount(samples.foot_post, minlength=2)[samples.foot_post],
            ]
        )
        return replace(samples, sigma=np.sqrt(samples.sigma**2 + shared**2 * count))

    def starts(self, model: GoalModel, p: FloatArray, points: LinePoints, max_starts: int = 3) -> Iterator[FloatArray]:
        """Yield cameras that see the goal nearly alike and put the line points best on lines.

        What a far goal leaves open is how obliquely it is seen: the camera may rotate about the goal's middle, and come
        nearer or go farther a little.
        """
        points = points.take(self._thinned(points.floor_m))
        turn, stretch = np.meshgrid(np.radians(np.arange(-40.0, 41.0, 4.0)), (0.94, 1.0, 1.06), indexing="ij")
        turn, stretch = turn.ravel(), stretch.ravel()
        dx, dy = p[X] - model.shape.line_x_m, p[Y]
        c, s = np.cos(turn), np.sin(turn)
        starts = np.tile(p, (len(turn), 1))
        starts[:, X] = model.shape.line_x_m + stretch * (c * dx - s * dy)
        starts[:, Y] = stretch * (s * dx + c * dy)
        starts[:, HEADING] += turn
        c, s = np.cos(starts[:, HEADING, None]), np.sin(starts[:, HEADING, None])
        x, y = points.floor_m[:, 0] * stretch[:, None], points.floor_m[:, 1] * stretch[:, None]
        field = np.stack([starts[:, X, None] + c * x - s * y, starts[:, Y, None] + s * x + c * y], axis=-1)
        cost = (np.minimum(self._line_map.rough_distance_m(field), 0.25) * points.weight).mean(axis=1)
        chosen: list[int] = []
        for k in np.argsort(cost, kind="stable"):
            if all(abs(turn[k] - turn[j]) > math.radians(6.0) for j in chosen):
                chosen.append(int(k))
            if len(chosen) == max_starts:
                break
        yield from starts[chosen]


def _room(count: int) -> AssociatedMarks:
    return AssociatedMarks(np.empty(count, np.int64), *(np.empty((count, 2)) for _ in range(3)))


def _on_floor(model: GoalModel, p: FloatArray, pixels: FloatArray) -> FloatArray:
    """Field points (N, 2) seen at ideal pixels (N, 2); NaN from the horizon on."""
    slopes = (pixels - np.array(model.view.center_px)) / np.array(model.view.focal_px) / math.exp(p[LOG_FOCAL])
    ray = np.column_stack([np.ones(len(slopes)), -slopes]) @ camera_rotation(p[HEADING], p[TILT], p[ROLL]).T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(ray[:, 2] < -1e-3, -p[HEIGHT] / ray[:, 2], np.nan)
    return np.asarray(p[[X, Y]] + ray[:, :2] * reach[:, None])
