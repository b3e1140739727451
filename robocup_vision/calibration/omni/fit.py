"""Robust least-squares fit of a mirror camera and of the robot's pose in every frame to measured walls and lines.

A residual is the perpendicular distance in pixels of a measured point from the projected wall or line: metric residuals
would reward a curve that shrinks the field. It is computed with homogeneous floor points (X, Y, W), which are smooth
across the horizon (W = 0): a straight wall or line with normal n and distance d is n.(X, Y) = d W, and the difference G
of both sides over |dG/dpixel| is the distance in pixels.

Hand-painted lines may deviate from the field file by centimetres. A camera fitted to the file would absorb the
deviation in its centre and tilt, so a fit may move each line and arc by three parameters (`OnPaint`).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.calibration import least_squares
from robocup_vision.calibration.least_squares import (
    POSE_PRECISION,
    FrameEquations,
    Noise,
    Residuals,
    frame_equations,
    sandwich,
    solve,
)
from robocup_vision.calibration.omni.model import CENTER, TILT, CameraModel
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.kernels.lines.lines import nearest_lines
from robocup_vision.localization.line_map import LineMap

# number of parameters of a line's or arc's deviation, see `Fit.paint_m`
_PAINT_PARAMETERS = 3
# step of the numerical derivatives, in each parameter's unit
_STEP = 1e-4
_MIN_SLOPE = 1e-9
# bounds of one iteration's step, within which the linearisation holds: centre, tilt, logarithms of the curve, poses
# (metres and radians)
_MAX_CENTER_STEP_PX, _MAX_TILT_STEP_RAD, _MAX_LOG_STEP, _MAX_POSE_STEP = 4.0, 0.02, 0.08, 0.15
# greatest range of a line point, in diagonals of the field; farther points are outside the field
_MAX_LINE_DIAGONALS = 1.5
# number of neighbouring points that count as one measurement, because their errors are correlated
_POINTS_PER_MEASUREMENT = 3.0
# least noise of a point: that of edge detection
_MIN_NOISE_PX = 0.15
# sectors of the image, whose points form a group with correlated errors in the covariance
_SECTORS = 16
# standard deviation of the painted place of a line's ends, in line widths, for lines painted by hand
_PAINT_STD_WIDTHS = 0.3


class LineForms(NamedTuple):
    """Lines or arcs of floor points, with their covectors."""

    which: Int64Array  #: (N,) int64: index of the line; arcs follow the lines
    form: FloatArray  #: (N, 3) float64: n_x, n_y, -d of the line, or of an arc's tangent at the point
    part: FloatArray  #: (N,) float64: position along the line, from 0 to 1; NaN on an arc


class FieldShape:
    """A field's walls and lines, for residuals of points."""

    def __init__(self, field: Field) -> None:
        self.field = field
        self.walls = np.ascontiguousarray(field.walls if field.is_bounded else np.empty((0, 4)))
        self.lines, self.arcs = np.ascontiguousarray(field.lines), np.ascontiguousarray(field.arcs)
        self.reach_m = _MAX_LINE_DIAGONALS * float(np.hypot(*np.ptp(field.floor_polygon, axis=0)))
        self.low, self.high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
        ends = np.vstack([self.walls, self.lines])
        along = ends[:, 2:] - ends[:, :2]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(along[:, 0], along[:, 1])[:, None]
        # (S, 3): n_x, n_y, -d of all straight walls and lines
        self.straight = np.column_stack([normal, -np.einsum("ij,ij->i", normal, ends[:, :2])])
        # walls are where the field file says, and fix the pose without the lines
        self.paint_std_m = 0.0 if field.is_bounded else _PAINT_STD_WIDTHS * field.line_width_m

    @cached_property
    def line_map(self) -> LineMap:
        """Distances to the lines, for poses by lines alone."""
        return LineMap(self.field)

    def visible_wall(self, eye_m: FloatArray, direction: FloatArray) -> Int64Array:
        """Index (N,) of the wall first met from eyes (N, 2) along directions (N, 2), field frame; -1 if none."""
        a, edge = self.walls[:, :2], self.walls[:, 2:] - self.walls[:, :2]
        to_a = a[None] - eye_m[:, None]
        across = direction[:, None, 0] * edge[None, :, 1] - direction[:, None, 1] * edge[None, :, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (to_a[..., 0] * edge[:, 1] - to_a[..., 1] * edge[:, 0]) / across
            s = (to_a[..., 0] * direction[:, None, 1] - to_a[..., 1] * direction[:, None, 0]) / across
        t = np.where((t > 0) & (s >= -1e-9) & (s <= 1 + 1e-9), t, np.inf)
        wall = np.argmin(t, axis=1)
        return np.where(np.isfinite(t[np.arange(len(t)), wall]), wall, -1)

    def nearest(self, field_m: FloatArray) -> LineForms:
        """Return the lines and arcs nearest to floor points (N, 2), field frame."""
        _, _, which = nearest_lines(np.ascontiguousarray(field_m), self.lines, self.arcs)
        count = len(self.lines)
        form = np.empty((len(which), 3))
        part = np.full(len(which), np.nan)
        straight = which < count
        form[straight] = self.straight[len(self.walls) + which[straight]]
        arc = self.arcs[which[~straight] - count]
        radial = field_m[~straight] - arc[:, :2]
        radial /= np.maximum(np.hypot(radial[:, 0], radial[:, 1]), 1e-9)[:, None]
        form[~straight] = np.column_stack([radial, -np.einsum("ij,ij->i", radial, arc[:, :2]) - arc[:, 2]])
        start, end = self.lines[which[straight], :2], self.lines[which[straight], 2:]
        along = np.einsum("ij,ij->i", field_m[straight] - start, end - start)
        part[straight] = np.clip(along / np.einsum("ij,ij->i", end - start, end - start), 0.0, 1.0)
        return LineForms(which, form, part)


def homogeneous(camera: OmniCamera, pixels: FloatArray) -> FloatArray:
    """Return floor points (N, 3) as X, Y, W, robot frame: the place is (X, Y) / W; W <= 0 on and above the horizon."""
    ray, (x_m, y_m, height_m) = camera.pixel_to_ray(pixels), camera.viewpoint_m
    weight = -ray[:, 2] / height_m
    point = np.column_stack([ray[:, 0] + weight * x_m, ray[:, 1] + weight * y_m, weight])
    # the curve is undefined there
    point[np.isnan(weight)] = -1.0
    return point


@dataclass(frozen=True, eq=False)
class OnPaint:
    """Points on lines or arcs, and the effect of painted deviations on their covectors."""

    is_line: npt.NDArray[np.bool_]  #: (N,) bool: whether each point is on a line or arc
    which: Int64Array  #: (K,) int64: line or arc of each of those points
    #: (K, 3) float64: derivatives of the line's outward shift at the point by the paint's parameters
    by_paint: FloatArray

    @staticmethod
    def of(is_line: npt.NDArray[np.bool_], lines: LineForms) -> OnPaint:
        """Compute them for the points that a mask (N,) selects, and their lines in the same order."""
        straight = np.isfinite(lines.part)
        by_paint = np.ones((len(lines.which), _PAINT_PARAMETERS))
        part = lines.part[straight]
        by_paint[straight] = np.column_stack([1 - part, part, np.zeros(len(part))])
        by_paint[~straight, 1:] = lines.form[~straight, :2]
        return OnPaint(is_line, lines.which, by_paint)

    def move(self, covector: FloatArray, paint_m: FloatArray) -> None:
        """Shift the points' covectors (N, 3) in place by the paint (L, 3), see `Fit`."""
        covector[self.is_line, 2] -= np.einsum("ij,ij->i", self.by_paint, paint_m[self.which])

    def derivative(self, weight: FloatArray, paint_m: FloatArray) -> FloatArray:
        """Return derivatives (N, 3 L) of covector times point, with W (N,), by the parameters of paint (L, 3)."""
        by_paint = np.zeros((len(weight), paint_m.size))
        columns = _PAINT_PARAMETERS * self.which[:, None] + np.arange(_PAINT_PARAMETERS)
        by_paint[np.flatnonzero(self.is_line)[:, None], columns] = -self.by_paint * weight[self.is_line, None]
        return by_paint


@dataclass(frozen=True, eq=False)
class Points:
    """Measured points of several frames, ordered by frame."""

    pixels: FloatArray  #: (N, 2) float64: image points
    frame: Int64Array  #: (N,) int64: index of the frame, ascending; every frame has points
    is_line: npt.NDArray[np.bool_]  #: (N,) bool: whether it is on a painted line; else it is at the foot of a wall
    weight: FloatArray  #: (N,) float64: weights

    def take(self, chosen: npt.NDArray[np.bool_]) -> Points:
        """Return the points selected by a mask."""
        return Points(self.pixels[chosen], self.frame[chosen], self.is_line[chosen], self.weight[chosen])

    @property
    def frames(self) -> int:
        """Number of frames."""
        return int(self.frame[-1]) + 1 if len(self.frame) else 0


@dataclass(frozen=True, eq=False)
class Fit:
    """A camera and poses fitted to points."""

    model: CameraModel  #: family of the camera
    vector: FloatArray  #: (G,) float64: parameters of the camera
    poses: FloatArray  #: (F, 3) float64: x, y, theta of the robot in every frame
    cost: float  #: weighted mean of r^2 / (r^2 + s^2), 0 to 1
    #: (N,) float64: signed residuals; infinite for a line point without floor near the field
    residual_px: FloatArray
    #: (L, 3) float64: deviation of each line and arc from the field file: sideways at the start and at the end of a
    #: line; radius and centre of an arc. None: no deviation.
    paint_m: FloatArray | None = None

    @property
    def camera(self) -> OmniCamera:
        """The fitted camera."""
        return self.model.camera(self.vector)


class _State(NamedTuple):
    """The linearised points for a camera at poses."""

    place: FloatArray  # (N, 3), see `homogeneous`
    # (N, 3), (N, 3, 3): linear forms that vanish on each point's wall or line, and their derivatives by the pose
    covector: FloatArray
    by_pose: FloatArray
    # (N, 2), (N,): the forms' derivatives by the pixel, and their norms
    by_pixel: FloatArray
    slope: FloatArray
    residual_px: FloatArray
    known: npt.NDArray[np.bool_]
    on: OnPaint


class JointFit:
    """Fits cameras of any family to the same points.

    Parameters
    ----------
    painted : bool
        Whether the deviations of painted lines from the field file are fitted under their prior.
    """

    def __init__(self, shape: FieldShape, points: Points, *, painted: bool = False) -> None:
        self.shape, self.points = shape, points
        self._painted = painted and shape.paint_std_m > 0
        self._first = np.searchsorted(points.frame, np.arange(points.frames))
        self._total = float(points.weight.sum())

    def solve(
        self,
        model: CameraModel,
        vector: FloatArray,
        poses: FloatArray,
        scales_px: tuple[float, ...],
        prior: FloatArray,
        bounds: tuple[FloatArray, FloatArray],
        free: npt.NDArray[np.bool_] | None = None,
        *,
        repeats: int = 3,
        most: int = 15,
    ) -> Fit:
        """Fit a camera and poses from a start.

        Parameters
        ----------
        scales_px : tuple of float
            Scales of the redescending weights, decreasing.
        prior : (G,) float64
            Mean of the vector's prior; the model provides its standard deviations.
        free : (G,) bool, optional
            Whether each parameter is fitted or fixed; all are fitted by default.
        repeats : int
            Iterations at each scale but the last.
        most : int
            Greatest number of iterations at the last scale, where convergence ends them.
        """
        vector, poses = vector.copy(), poses.copy()
        free = np.ones(len(vector), dtype=bool) if free is None else free
        paint = np.zeros((len(self.shape.lines) + len(self.shape.arcs), _PAINT_PARAMETERS)) if self._painted else None
        for index, scale in enumerate(scales_px):
            is_last = index == len(scales_px) - 1
            for _ in range(most if is_last else repeats):
                moved = self._step(model, vector, poses, paint, scale, prior, bounds, free)
                if is_last and moved < 1e-4:
                    break
        residual = self.residuals(model.camera(vector), poses, paint)
        return Fit(model, vector, poses, self.cost(residual, scales_px[-1]), residual, paint)

    def cost(self, residual_px: FloatArray, scale_px: float) -> float:
        """Return the weighted mean (0 to 1) of the truncated squares of residuals (N,) at a scale."""
        return float(self.points.weight @ truncated(residual_px, scale_px)) / self._total

    def residuals(self, camera: OmniCamera, poses: FloatArray, paint_m: FloatArray | None = None) -> FloatArray:
        """Return signed residuals (N,) in pixels of the points from the walls and lines at poses (F, 3).

        See `Fit` for `paint_m`.
        """
        state = self._state(camera, poses, paint_m)
        return np.where(state.known, state.residual_px, np.inf)

    def _state(self, camera: OmniCamera, poses: FloatArray, paint_m: FloatArray | None) -> _State:
        points = self.points
        place = homogeneous(camera, points.pixels)
        covector, by_pose, known, on = self._covectors(camera, place, poses)
        if paint_m is not None:
            on.move(covector, paint_m)
        steps = np.array([[_STEP, 0.0], [0.0, _STEP]])
        moved = [homogeneous(camera, points.pixels + step) - place for step in steps]
        by_pixel = np.stack([np.einsum("ij,ij->i", covector, by) for by in moved], axis=1) / _STEP
        slope = np.maximum(np.hypot(*by_pixel.T), _MIN_SLOPE)
        residual = np.einsum("ij,ij->i", covector, place) / slope
        return _State(place, covector, by_pose, by_pixel, slope, residual, known, on)

    def _covectors(
        self, camera: OmniCamera, place: FloatArray, poses: FloatArray
    ) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_], OnPaint]:
        """Return linear forms (N, 3) of each point's wall or line, derivatives (N, 3, 3), known (N,), and the lines.

        The middle index of the derivatives is x, y, theta of the pose. An arc's form is that of its tangent.
        """
        points, shape = self.points, self.shape
        pose = poses[points.frame]
        c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        # (N, 3) in the field frame, homogeneous
        x = c * place[:, 0] - s * place[:, 1] + pose[:, 0] * place[:, 2]
        y = s * place[:, 0] + c * place[:, 1] + pose[:, 1] * place[:, 2]
        form = np.zeros((len(x), 3))
        known = np.zeros(len(x), dtype=bool)
        wall = ~points.is_line
        if wall.any() and len(shape.walls):
            eye = pose[:, :2] + np.column_stack(
                [c * camera.offset_m[0] - s * camera.offset_m[1], s * camera.offset_m[0] + c * camera.offset_m[1]]
            )
            direction = np.column_stack([x, y]) - eye * place[:, 2:]
            index = shape.visible_wall(eye[wall], direction[wall])
            hit = shape.straight[index]
            # outward normal: positive for floor beyond the wall, negative for what hides its foot
            side = np.where(np.einsum("ij,ij->i", hit[:, :2], eye[wall]) + hit[:, 2] > 0, -1.0, 1.0)
            form[wall] = hit * side[:, None]
            known[wall] = index >= 0
        near = points.is_line & (place[:, 2] > 1.0 / shape.reach_m * np.hypot(place[:, 0], place[:, 1]))
        field_m = np.column_stack([x[near], y[near]]) / place[near, 2:]
        lines = shape.nearest(field_m)
        form[near], known[near] = lines.form, True
        on = OnPaint.of(near, lines)
        n_x, n_y, off = form.T
        covector = np.column_stack([c * n_x + s * n_y, -s * n_x + c * n_y, n_x * pose[:, 0] + n_y * pose[:, 1] + off])
        by_pose = np.zeros((len(x), 3, 3))
        by_pose[:, 0, 2], by_pose[:, 1, 2] = n_x, n_y
        by_pose[:, 2, 0], by_pose[:, 2, 1] = covector[:, 1], -covector[:, 0]
        return covector, by_pose, known, on

    def linearise(
        self,
        model: CameraModel,
        vector: FloatArray,
        poses: FloatArray,
        free: npt.NDArray[np.bool_],
        paint_m: FloatArray | None = None,
    ) -> Residuals:
        """Linearise the points by the vector (G,) and the poses, with image sectors as groups.

        The residual of points without a wall or line is infinite. The 3 L parameters of `paint_m` (L, 3), see `Fit`,
        follow the vector.
        """
        pixels = self.points.pixels
        state = self._state(model.camera(vector), poses, paint_m)
        by_paint = np.zeros((len(pixels), 0))
        if paint_m is not None:
            by_paint = state.on.derivative(state.place[:, 2], paint_m)
        by_vector = np.zeros((len(pixels), len(vector)))
        # the camera depends on pixels relative to the centre
        by_vector[:, CENTER] = -state.by_pixel
        for g in np.flatnonzero(free):
            if g < TILT.start:
                continue
            ahead = vector.copy()
            ahead[g] += _STEP
            moved = homogeneous(model.camera(ahead), pixels)
            by_vector[:, g] = np.einsum("ij,ij->i", state.covector, moved - state.place) / _STEP
        by_own = np.einsum("ipj,ij->ip", state.by_pose, state.place)
        turn = np.arctan2(*(pixels - vector[CENTER]).T[::-1]) / math.tau + 0.5
        return Residuals(
            np.where(state.known, state.residual_px, np.inf),
            np.hstack([by_vector, by_paint]) / state.slope[:, None],
            by_own / state.slope[:, None],
            np.floor(turn * _SECTORS).astype(np.int64),
        )

    def _frames(
        self, points: Residuals, scale_px: float, noise_px: float
    ) -> list[tuple[Residuals, FloatArray, Noise, FrameEquations]]:
        """Return points, weights at a scale of the loss, noise and equations of each frame."""
        noise, own = Noise(noise_px, 0.0), np.full(3, POSE_PRECISION)
        weight = self.points.weight * (1.0 - truncated(points.residual_px, scale_px)) ** 2
        frames = []
        for first, end in itertools.pairwise([*self._first.tolist(), len(weight)]):
            rows, one = points.take(np.s_[first:end]), weight[first:end]
            frames.append((rows, one, noise, frame_equations(rows, one, noise, own, np.zeros(3))))
        return frames

    def _prior(self, model: CameraModel, paint_m: FloatArray | None) -> FloatArray:
        """Prior precision of the parameters of vector and paint."""
        paint = np.full(0 if paint_m is None else paint_m.size, max(self.shape.paint_std_m, 1e-9))
        return np.asarray(np.concatenate([model.prior_std(), paint]) ** -2.0)

    def _step(
        self,
        model: CameraModel,
        vector: FloatArray,
        poses: FloatArray,
        paint_m: FloatArray | None,
        scale: float,
        prior: FloatArray,
        bounds: tuple[FloatArray, FloatArray],
        free: npt.NDArray[np.bool_],
    ) -> float:
        """Do one Gauss-Newton step in place; return its size, to test for convergence.

        The size is the vector's largest step relative to its bound, plus the poses' largest step in metres or radians.
        """
        count = len(vector)
        points = self.linearise(model, vector, poses, free, paint_m)
        # invisible lines are fixed
        seen = np.flatnonzero(points.by_camera[:, count:].any(axis=0))
        moves = np.concatenate([np.flatnonzero(free), count + seen])
        points = replace(points, by_camera=points.by_camera[:, moves])
        noise_px = math.sqrt(_POINTS_PER_MEASUREMENT) * max(scale / 2, _MIN_NOISE_PX)
        frames = [frame for _, _, _, frame in self._frames(points, scale, noise_px)]
        numbers = np.concatenate([vector - prior, np.zeros(0) if paint_m is None else paint_m.ravel()])
        precision = self._prior(model, paint_m)[moves]
        total, pull = np.diag(precision), -precision * numbers[moves]
        for information, gradient in (frame.reduced() for frame in frames):
            total += information
            pull += gradient
        step = solve(total, pull)
        most = np.full(count + len(numbers), _MAX_LOG_STEP)
        most[CENTER], most[TILT] = _MAX_CENTER_STEP_PX, _MAX_TILT_STEP_RAD
        most = most[moves]
        step *= min(1.0, float(np.min(most / np.maximum(np.abs(step), 1e-12))))
        pose_step = np.array([frame.own_step(step) for frame in frames])
        pose_step *= np.minimum(1.0, _MAX_POSE_STEP / np.maximum(np.abs(pose_step).max(axis=1), 1e-12))[:, None]
        before, of_vector = vector.copy(), len(moves) - len(seen)
        vector[free] += step[:of_vector]
        np.clip(vector, *bounds, out=vector)
        if paint_m is not None:
            paint_m.ravel()[seen] += step[of_vector:]
        poses += pose_step
        np.clip(poses[:, :2], self.shape.low + 0.01, self.shape.high - 0.01, out=poses[:, :2])
        moved = np.abs(vector - before)[free] / most[:of_vector]
        return float(moved.max(initial=0.0) + np.abs(pose_step).max())

    def covariance(self, fit: Fit) -> FloatArray:
        """Covariance (G, G) of a fit's vector, marginalised over poses and paint.

        Points of one frame and one sector of the image form a group with correlated errors. All parameters count as
        free, also those that were fixed in the fit.
        """
        points = self.linearise(fit.model, fit.vector, fit.poses, np.ones(fit.model.size, dtype=bool), fit.paint_m)
        spread = spread_px(points.residual_px)
        frames = self._frames(points, 3 * spread, spread)
        information = np.diag(self._prior(fit.model, fit.paint_m))
        information += sum(frame.reduced()[0] for *_, frame in frames)
        scores = np.vstack([frame.scores(rows, weight, noise) for rows, weight, noise, frame in frames])
        count = len(fit.vector)
        return sandwich(information, scores)[:count, :count]


def truncated(residual_px: FloatArray, scale_px: float) -> FloatArray:
    """Return the loss (N,) of residuals, 0 to 1: softly truncated squares at a scale."""
    return np.asarray(1.0 - 1.0 / (1.0 + np.square(residual_px / scale_px)))


def spread_px(residual_px: FloatArray) -> float:
    """Robust standard deviation of residuals (N,) after rejection of outliers."""
    within = 3.0
    for _ in range(5):
        good = residual_px[np.abs(residual_px) <= within]
        if not len(good):
            break
        within = 3 * least_squares.spread_px(good, _MIN_NOISE_PX)
    return within / 3
