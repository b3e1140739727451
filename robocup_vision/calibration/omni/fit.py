"""One robust least-squares fit of a mirror camera and of the robot's pose in every frame, to walls and lines seen.

Every residual is the distance in pixels, across it, of a measured point from where the field's wall or line lies in
the image: metric residuals would reward a curve that shrinks the field. It is written in homogeneous floor points
(X, Y, W), which pass through the horizon (W = 0) smoothly: a straight wall or line with normal n and distance d is
n.(X, Y) = d W, and the difference G of both sides over |dG/dpixel| is the distance in pixels.

A laboratory's lines are painted by hand, centimetres off the drawing. A camera fitted to the drawing would absorb those
centimetres into its centre and tilt, so a fit may move each line and arc by three numbers (`OnPaint`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.calibration.omni.model import CENTER, TILT, CameraModel
from robocup_vision.calibration.omni.settings import JointFitSettings
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.kernels.lines.lines import nearest_lines
from robocup_vision.kernels.walls.calibration import MirrorView, floor_points

# sideways at the start and at the end of a line; radius and centre of an arc
_NUMBERS = 3
# steps of the numerical derivatives, in the vector's own units
_STEP = 1e-4
_MIN_SLOPE = 1e-9


class LineForms(NamedTuple):
    """On which line or arc floor points lie, and their covectors."""

    which: Int64Array  #: (N,) int64: the line; arcs follow the lines
    form: FloatArray  #: (N, 3) float64: n_x, n_y, -d of the line; an arc's is that of its tangent there
    part: FloatArray  #: (N,) float64: how far along the line, 0 at its start to 1 at its end; NaN on an arc


class FieldShape:
    """A field's walls and lines, from which distances of points are measured.

    Parameters
    ----------
    settings : JointFitSettings, optional
        Says how far away a line point may be.
    """

    def __init__(self, field: Field, settings: JointFitSettings = JointFitSettings()) -> None:
        self.walls = np.ascontiguousarray(field.walls if field.is_bounded else np.empty((0, 4)))
        self.lines, self.arcs = np.ascontiguousarray(field.lines), np.ascontiguousarray(field.arcs)
        self.reach_m = settings.max_line_diagonals * float(np.hypot(*np.ptp(field.floor_polygon, axis=0)))
        self.low, self.high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
        ends = np.vstack([self.walls, self.lines])
        along = ends[:, 2:] - ends[:, :2]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(along[:, 0], along[:, 1])[:, None]
        # (S, 3): n_x, n_y, -d of every straight thing
        self.straight = np.column_stack([normal, -np.einsum("ij,ij->i", normal, ends[:, :2])])
        # walls stand where the field has them, and tell where the lines are
        self.paint_std_m = 0.0 if field.is_bounded else settings.paint_std_widths * field.line_width_m

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
        """Return the lines and arcs that floor points (N, 2), field frame, lie nearest to."""
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
    """Floor points (N, 3) as X, Y, W, robot frame: the floor point is (X, Y) / W, and W <= 0 from the horizon on."""
    u, v = camera.center_px
    q = camera.floor_range.inverse_range_per_m(np.hypot(pixels[:, 0] - u, pixels[:, 1] - v))
    point = np.empty((len(pixels), 3))
    sign = 1.0 if camera.mirrored else -1.0
    x, y, height = camera.viewpoint_m.tolist()
    view = MirrorView((float(u), float(v)), sign, float(camera.heading_rad), camera.camera_to_robot, (x, y, height))
    floor_points(pixels, q, view, point)
    return point


@dataclass(frozen=True, eq=False)
class OnPaint:
    """Which points lie on a line or arc near the field, and how its paint moves what they are compared with."""

    is_line: npt.NDArray[np.bool_]  #: (N,) bool: of all points
    which: Int64Array  #: (K,) int64: line or arc of each of those points
    #: (K, 3) float64: by how much the line lies farther out at that point, for each of its paint's numbers
    by_paint: FloatArray

    @staticmethod
    def of(is_line: npt.NDArray[np.bool_], lines: LineForms) -> OnPaint:
        """Return those of points (N,), some of which lie on these lines."""
        straight = np.isfinite(lines.part)
        by_paint = np.ones((len(lines.which), _NUMBERS))
        part = lines.part[straight]
        by_paint[straight] = np.column_stack([1 - part, part, np.zeros(len(part))])
        by_paint[~straight, 1:] = lines.form[~straight, :2]
        return OnPaint(is_line, lines.which, by_paint)

    def move(self, covector: FloatArray, paint_m: FloatArray) -> None:
        """Move the points' covectors (N, 3) in place to where paint (L, 3) lies, see `no_paint`."""
        covector[self.is_line, 2] -= np.einsum("ij,ij->i", self.by_paint, paint_m[self.which])

    def derivative(self, weight: FloatArray, paint_m: FloatArray) -> FloatArray:
        """Return the derivative (N, 3 L) of what covectors say of points with W (N,) by the numbers of paint (L, 3)."""
        by_paint = np.zeros((len(weight), paint_m.size))
        columns = _NUMBERS * self.which[:, None] + np.arange(_NUMBERS)
        by_paint[np.flatnonzero(self.is_line)[:, None], columns] = -self.by_paint * weight[self.is_line, None]
        return by_paint


def no_paint(count: int) -> FloatArray:
    """Return the paint (L, 3), metres, of so many lines and arcs that lie where the field has them."""
    return np.zeros((count, _NUMBERS))


@dataclass(frozen=True, eq=False)
class Points:
    """Measured points of several frames, frame by frame."""

    pixels: FloatArray  #: (N, 2) float64: places in the image
    frame: Int64Array  #: (N,) int64: index of the frame, ascending; every frame has points
    is_line: npt.NDArray[np.bool_]  #: (N,) bool: on a painted line; else at the foot of a wall
    weight: FloatArray  #: (N,) float64: weight of each

    def take(self, chosen: npt.NDArray[np.bool_]) -> Points:
        """Return the points where this mask is true."""
        return Points(self.pixels[chosen], self.frame[chosen], self.is_line[chosen], self.weight[chosen])

    @cached_property
    def frames(self) -> int:
        """Number of frames."""
        return int(self.frame[-1]) + 1 if len(self.frame) else 0


@dataclass(frozen=True, eq=False)
class Fit:
    """A camera and poses that explain the points."""

    model: CameraModel  #: the family
    vector: FloatArray  #: (G,) float64: its member
    poses: FloatArray  #: (F, 3) float64: x, y, theta of the robot in every frame
    cost: float  #: weighted mean of r^2 / (r^2 + s^2), 0 to 1
    #: (N,) float64: signed distances; infinite where a line point shows no floor near the field
    residual_px: FloatArray
    #: (L, 3) float64: where each line and arc is painted, from where the field has it: sideways at the start and at the
    #: end of a line; radius and centre of an arc. None: just there.
    paint_m: FloatArray | None = None

    @property
    def camera(self) -> OmniCamera:
        """The camera fitted."""
        return self.model.camera(self.vector)


class JointFit:
    """Fits families of cameras to the same points.

    Parameters
    ----------
    painted : bool
        Whether lines are painted somewhat beside where the field has them: each one's offset is fitted, too, within
        what a painter errs.
    """

    def __init__(
        self,
        shape: FieldShape,
        points: Points,
        settings: JointFitSettings = JointFitSettings(),
        *,
        painted: bool = False,
    ) -> None:
        self.shape = shape
        self._painted = painted and shape.paint_std_m > 0
        self.points = points
        self.settings = settings
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
        """Fit from a start.

        Parameters
        ----------
        scales_px : tuple of float
            Widths of the redescending weights, the widest first.
        prior : (G,) float64
            Mean of the vector's prior; its standard deviations are the model's.
        free : (G,) bool, optional
            Which numbers are fitted; all unless given. The others are fixed.
        repeats : int
            Iterations at each width.
        most : int
            Iterations at the last one; fewer if nothing moves any more.
        """
        vector, poses = vector.copy(), poses.copy()
        free = np.ones(len(vector), dtype=bool) if free is None else free
        paint = self._no_paint()
        for place, scale in enumerate(scales_px):
            last = place == len(scales_px) - 1
            for _ in range(most if last else repeats):
                moved = self._step(model, vector, poses, paint, scale, prior, bounds, free)
                if last and moved < 1e-4:
                    break
        residual = self.residuals(model.camera(vector), poses, paint)
        return Fit(model, vector, poses, self.cost(residual, scales_px[-1]), residual, paint)

    def _no_paint(self) -> FloatArray | None:
        return no_paint(len(self.shape.lines) + len(self.shape.arcs)) if self._painted else None

    def cost(self, residual_px: FloatArray, scale_px: float) -> float:
        """Weighted mean (0 to 1) of the truncated squares of residuals (N,) at a width."""
        with np.errstate(invalid="ignore"):
            loss = np.where(
                np.isfinite(residual_px), 1 / (1 + (scale_px / np.maximum(np.abs(residual_px), 1e-9)) ** 2), 1.0
            )
        return float(self.points.weight @ loss) / self._total

    def residuals(self, camera: OmniCamera, poses: FloatArray, paint_m: FloatArray | None = None) -> FloatArray:
        """Signed distances (N,) in pixels of the points from the walls and lines of poses (F, 3).

        See `Fit` for `paint_m`.
        """
        place = homogeneous(camera, self.points.pixels)
        covector, _, known, on = self._covectors(camera, place, poses)
        if paint_m is not None:
            on.move(covector, paint_m)
        slope = np.maximum(np.hypot(*self._by_pixel(camera, place, covector).T), _MIN_SLOPE)
        return np.where(known, np.einsum("ij,ij->i", covector, place) / slope, np.inf)

    def _by_pixel(self, camera: OmniCamera, place: FloatArray, covector: FloatArray) -> FloatArray:
        """Differentiate the covectors' values by u and v: (N, 2)."""
        steps = np.array([[_STEP, 0.0], [0.0, _STEP]])
        moved = [homogeneous(camera, self.points.pixels + step) - place for step in steps]
        return np.stack([np.einsum("ij,ij->i", covector, by) for by in moved], axis=1) / _STEP

    def _covectors(
        self, camera: OmniCamera, place: FloatArray, poses: FloatArray
    ) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_], OnPaint]:
        """Linear forms (N, 3) that vanish on what each point belongs to; by the pose (N, 3, 3); known (N,); the lines.

        The second array's middle index is x, y, theta. An arc's form is that of its tangent there.
        """
        points, shape = self.points, self.shape
        pose = poses[points.frame]
        c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        # (N, 3) in the field frame, still homogeneous
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
            # outwards, so that floor seen beyond the wall is positive and what hides its foot negative
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
    ) -> tuple[FloatArray, FloatArray, FloatArray, npt.NDArray[np.bool_]]:
        """Residuals (N,), their derivatives by the vector (N, G) and the own pose (N, 3), and which are known (N,).

        With `paint_m` (L, 3), see `Fit`, its 3 L numbers follow those of the vector.
        """
        pixels = self.points.pixels
        camera = model.camera(vector)
        place = homogeneous(camera, pixels)
        covector, by_pose, known, on = self._covectors(camera, place, poses)
        by_paint = np.zeros((len(pixels), 0))
        if paint_m is not None:
            on.move(covector, paint_m)
            by_paint = on.derivative(place[:, 2], paint_m)
        by_pixel = self._by_pixel(camera, place, covector)
        slope = np.maximum(np.hypot(by_pixel[:, 0], by_pixel[:, 1]), _MIN_SLOPE)
        residual = np.where(known, np.einsum("ij,ij->i", covector, place) / slope, 0.0)
        by_vector = np.zeros((len(pixels), len(vector)))
        # only a pixel's place relative to the centre counts
        by_vector[:, CENTER] = -by_pixel / slope[:, None]
        for g in np.flatnonzero(free):
            if g < TILT.start:
                continue
            ahead = vector.copy()
            ahead[g] += _STEP
            moved = homogeneous(model.camera(ahead), pixels)
            by_vector[:, g] = np.einsum("ij,ij->i", covector, moved - place) / (_STEP * slope)
        by_own = np.einsum("ipj,ij->ip", by_pose, place) / slope[:, None]
        return residual, np.hstack([by_vector, by_paint / slope[:, None]]), by_own, known

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
        """Do one Gauss-Newton step in place; return its length, relative to the bounds of a step, for a stop test."""
        residual, by_vector, by_own, known = self.linearise(model, vector, poses, free, paint_m)
        weight = np.where(known, self.points.weight / (1 + (residual / scale) ** 2) ** 2, 0.0)
        settings = self.settings
        weight /= settings.points_per_measurement * max(scale / 2, settings.min_noise_px) ** 2
        count = len(vector)
        # lines out of view stay where they are
        seen = np.flatnonzero(by_vector[:, count:].any(axis=0))
        by_vector = by_vector[:, np.concatenate([np.arange(count), count + seen])]
        h_gg, h_gp, h_pp, g_g, g_p = self._normal(residual, by_vector, by_own, weight)
        std = model.prior_std()
        h_gg[:count, :count] += np.diag(1 / std**2)
        g_g[:count] += (vector - prior) / std**2
        if paint_m is not None:
            h_gg[count:, count:] += np.eye(len(seen)) / self.shape.paint_std_m**2
            g_g[count:] += paint_m.ravel()[seen] / self.shape.paint_std_m**2
        # damping of about a decimetre: the pose of a frame that shows one wall only does not run away
        h_pp += np.diag([1e-3, 1e-3, 1e-3]) * np.trace(h_pp, axis1=1, axis2=2)[:, None, None] / 3 + 1e-6 * np.eye(3)
        back = np.linalg.solve(h_pp, np.concatenate([h_gp.transpose(0, 2, 1), g_p[:, :, None]], axis=2))
        schur = h_gg - np.einsum("fgp,fph->gh", h_gp, back[:, :, :-1])
        right = g_g - np.einsum("fgp,fp->g", h_gp, back[:, :, -1])
        fixed = np.flatnonzero(~free)
        schur[fixed] = 0.0
        schur[:, fixed] = 0.0
        schur[fixed, fixed] = 1.0
        right[fixed] = 0.0
        step = -np.linalg.solve(schur, right)
        most = np.full(len(step), settings.max_log_step)
        most[CENTER], most[TILT] = settings.max_center_step_px, settings.max_tilt_step_rad
        step *= min(1.0, float(np.min(most / np.maximum(np.abs(step), 1e-12))))
        pose_step = -(back[:, :, -1] + np.einsum("fpg,g->fp", back[:, :, :-1], step))
        pose_step *= np.minimum(1.0, settings.max_pose_step / np.maximum(np.abs(pose_step).max(axis=1), 1e-12))[:, None]
        before = vector.copy()
        vector += step[:count]
        np.clip(vector, *bounds, out=vector)
        if paint_m is not None:
            paint_m.ravel()[seen] += step[count:]
        poses += pose_step
        np.clip(poses[:, :2], self.shape.low + 0.01, self.shape.high - 0.01, out=poses[:, :2])
        return float(np.abs((vector - before) / most[:count]).max() + np.abs(pose_step).max())

    def _normal(
        self, residual: FloatArray, by_vector: FloatArray, by_own: FloatArray, weight: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        weighted = by_vector * weight[:, None]
        h_gg = by_vector.T @ weighted
        h_gp = np.add.reduceat(weighted[:, :, None] * by_own[:, None, :], self._first, axis=0)
        own = by_own * weight[:, None]
        h_pp = np.add.reduceat(own[:, :, None] * by_own[:, None, :], self._first, axis=0)
        g_p = np.add.reduceat(own * residual[:, None], self._first, axis=0)
        return h_gg, h_gp, h_pp, weighted.T @ residual, g_p

    def covariance(self, fit: Fit) -> FloatArray:
        """Covariance (G, G) of a fit's vector, with unknown poses and paint. Points that err together count once.

        Points of one frame and one sector of the image are one group (a cluster-robust "sandwich"). Every number
        counts as unknown, even if it was fixed in the fit.
        """
        residual, by_vector, by_own, known = self.linearise(
            fit.model, fit.vector, fit.poses, np.ones(fit.model.size, dtype=bool), fit.paint_m
        )
        spread = spread_px(residual[known], self.settings)
        weight = np.where(known, self.points.weight / (1 + (residual / (3 * spread)) ** 2) ** 2 / spread**2, 0.0)
        _, h_gp, h_pp, _, _ = self._normal(residual, by_vector, by_own, weight)
        h_pp += 1e-6 * np.eye(3)
        eliminated = np.linalg.solve(h_pp, h_gp.transpose(0, 2, 1))
        reduced = by_vector - np.einsum("np,npg->ng", by_own, eliminated[self.points.frame])
        offset = self.points.pixels - fit.vector[CENTER]
        sectors = self.settings.sectors
        sector = np.floor((np.arctan2(offset[:, 1], offset[:, 0]) / (2 * np.pi) + 0.5) * sectors).astype(np.int64)
        _, member = np.unique(self.points.frame * (sectors + 1) + sector, return_inverse=True)
        count = len(fit.vector)
        scores = np.zeros((int(member.max()) + 1, by_vector.shape[1]))
        np.add.at(scores, member.ravel(), reduced * (weight * residual)[:, None])
        fisher = (reduced.T * weight) @ reduced
        prior = np.full(len(fisher), 1 / max(self.shape.paint_std_m, 1e-9) ** 2)
        prior[:count] = 1 / fit.model.prior_std() ** 2
        bread = np.linalg.inv(fisher + np.diag(prior))
        covariance = bread @ (fisher + scores.T @ scores + np.diag(prior)) @ bread
        return np.asarray(covariance[:count, :count])


def spread_px(residual_px: FloatArray, settings: JointFitSettings = JointFitSettings()) -> float:
    """Robust standard deviation of residuals (N,), from those that agree with one another."""
    size = np.abs(residual_px[np.isfinite(residual_px)])
    within = 3.0
    for _ in range(5):
        good = size[size <= within]
        if not len(good):
            break
        # half of the points that agree lie within 0.67 standard deviations
        within = max(3 * 1.48 * float(np.median(good)), 3 * settings.min_noise_px)
    return within / 3
