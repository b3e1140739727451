"""Starts for the fit of a mirror camera: the points of each frame, and curves of several horizons and scales.

Only the points of a frame are kept, so that memory does not grow with the size of the images. Several starts are
needed: with a curve that is wrong by a fifth, poses are wrong and the fit converges to a wrong solution.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.omni.fit import FieldShape, Fit, JointFit, Points
from robocup_vision.calibration.omni.model import HORIZON, SCALE, TILT, CameraModel
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera.downward import downward
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.geometry import Pose2
from robocup_vision.localization.floor import OutlineFitter
from robocup_vision.localization.model_edges.field_edges import lines_only
from robocup_vision.localization.model_edges.finder import EdgeFinder
from robocup_vision.localization.model_edges.follower import EdgeFollower
from robocup_vision.perception.line_points import LineFinder
from robocup_vision.perception.polar_view import PolarView
from robocup_vision.vision import Vision

# least number of points of either kind in a frame; fewer do not determine its pose
_MIN_BOUNDARY_POINTS, _MIN_LINE_POINTS = 25, 40
# greatest number of line points of a frame; more are thinned out, as neighbours are redundant
_MAX_LINE_POINTS = 500
# the usable image begins at the radius at which floor fills this ratio of its maximum over all radii; the robot's body
# is closer
_MIN_FLOOR_RATIO = 0.9
# usable image radius at which one "unit" of a residual is a pixel: that of the 256 x 220 image of Sekimori et al.
# (2001); a unit grows in proportion to the usable radius, and is at least a pixel
_REFERENCE_RADIUS_PX = 86.0
# tested horizons, as factors of the start's; the same if the start's own table is stretched, whose kinks determine the
# image's size; and without a start, of the outer usable radius
_HORIZONS, _OWN_HORIZONS = (0.78, 0.88, 1.0, 1.13, 1.28), (0.93, 1.0, 1.07)
_UNKNOWN_HORIZONS = (0.75, 0.88, 1.02, 1.2, 1.45, 1.8)
# tested scales, as factors of the start's or a guess
_SCALES = (0.8, 1.0, 1.25)
# number of frames by which starts are compared, and the number of them used first
_FRAMES, _FIRST_FRAMES = 6, 2
# residual scales of the robust loss in the short and in the long fits, in units, decreasing to the points' noise
_SHORT_SCALES, _LONG_SCALES = (12.0, 6.0, 3.0), (8.0, 4.0, 2.0, 1.0)
# number of points of a frame in a short fit
_SHORT_POINTS = 120
# number of curves kept after the first frames, and kept for the long fit
_CURVES_KEPT, _KEPT = 8, 4


@dataclass(frozen=True, eq=False)
class Sighting:
    """The points of one frame."""

    index: int  #: index of the frame
    #: (K,) float64: image radius of the floor's edge at each bearing about the observer's centre; NaN where none
    radius_px: FloatArray
    boundary_px: FloatArray  #: (B, 2) float64: the same edge as pixels, without gaps
    line_px: FloatArray  #: (L, 2) float64: points on painted lines
    line_weight: FloatArray  #: (L,) float64: 1 for floor on both sides, else less
    pose: Pose2 | None  #: the robot's pose from this frame with the observer's camera

    @property
    def is_enough(self) -> bool:
        """Whether the points of either kind determine a pose."""
        return len(self.boundary_px) >= _MIN_BOUNDARY_POINTS or len(self.line_px) >= _MIN_LINE_POINTS


class Observer:
    """Finds points in frames with a camera that may be inaccurate.

    Parameters
    ----------
    camera : OmniCamera
        Its centre and usable radii are used, and its curve for the expected width of lines.
    mask : (H, W) uint8, optional
        Non-zero pixels are ignored.
    locate : bool
        Whether to estimate poses, which needs a nearly correct camera.
    """

    def __init__(self, field: Field, camera: OmniCamera, mask: UInt8Array | None, *, locate: bool) -> None:
        prepare("mirror_field")
        self.field, self._locate = field, locate
        by_outline = field.is_bounded and not locate
        self._vision = Vision(field, camera, method="floor" if by_outline else "field", mask=mask)
        self._finder = LineFinder(camera, field.line_width_m, mask)
        self.polar = PolarView(camera, mask=mask)
        self.floor_ratio = np.zeros(len(self.polar.radius_px))

    def look(self, index: int, frame: UInt8Array) -> Sighting:
        """Find a frame's points.

        Raises
        ------
        FrameError
            If the frame's size or type differs from the camera's.
        """
        self._vision.forget()
        view = self._vision.look(frame)
        self.floor_ratio += (view.marks > 0).mean(axis=0)
        lines = self._finder.find(frame)
        stride = -(-len(lines) // _MAX_LINE_POINTS)
        chosen = np.arange(0, len(lines), max(stride, 1))
        boundary = view.boundary_px if self.field.is_bounded else np.empty((0, 2))
        seen = np.isfinite(boundary).all(axis=1)
        pose = view.pose.pose if self._locate and view.pose else None
        # a writable copy: a read-only array would be another type to the compiled kernels, and cause a recompilation
        radius_px = np.array(view.boundary_radius_px)
        return Sighting(index, radius_px, boundary[seen], lines.pixels[chosen], lines.weight[chosen], pose)

    @property
    def inner_radius_px(self) -> float:
        """Image radius beyond which floor surrounds the robot, in the frames so far."""
        least = _MIN_FLOOR_RATIO * self.floor_ratio.max()
        return float(self.polar.radius_px[int(np.argmax(self.floor_ratio >= least))])


def points_of(sightings: Sequence[Sighting]) -> Points:
    """Return the points of several sightings for a fit."""
    pixels, frame, is_line, weight = [], [], [], []
    for index, sighting in enumerate(sightings):
        boundary, lines = len(sighting.boundary_px), len(sighting.line_px)
        pixels += [sighting.boundary_px, sighting.line_px]
        frame.append(np.full(boundary + lines, index))
        is_line += [np.zeros(boundary, dtype=bool), np.ones(lines, dtype=bool)]
        weight += [np.ones(boundary), sighting.line_weight]
    return Points(np.vstack(pixels), np.concatenate(frame), np.concatenate(is_line), np.concatenate(weight))


@dataclass(frozen=True, eq=False)
class Search:
    """Finds starts of a fit: a curve and a pose for each frame."""

    shape: FieldShape
    model: CameraModel  #: the family of curves
    start: FloatArray  #: (G,) float64: mean of the prior, from a camera file or a guess
    bounds: tuple[FloatArray, FloatArray]  #: ((G,), (G,)) float64: lower and upper bound of the vector
    is_guess: bool  #: whether the start's curve is a guess, whose horizon is ignored

    @property
    def unit_px(self) -> float:
        """Size in pixels of one "unit" of residuals."""
        inner, outer = self.model.frame.usable_radius_px
        return max(1.0, (outer - inner) / _REFERENCE_RADIUS_PX)

    def best(self, sightings: Sequence[Sighting], polar: PolarView, trials: StartTrials) -> list[Fit]:
        """Return distinct long fits to the frames with most points, best first.

        Parameters
        ----------
        polar : PolarView
            The view in which the floor's edges were measured.
        """
        most = sorted(sightings, key=lambda s: -(len(s.boundary_px) + len(s.line_px)))[:_FRAMES]
        vectors = self._curves()
        if len(most) > _FIRST_FRAMES:
            first = self._short_fits(vectors, most[:_FIRST_FRAMES], polar, trials, "starts")
            vectors = [fit.vector for fit in first[:_CURVES_KEPT]]
        kept = self._short_fits(vectors, most, polar, trials, "better starts")[:_KEPT]
        fits = trials.results(_LongFit(self, most), kept, "best starts")
        return sorted(fits, key=lambda fit: fit.cost)

    def _short_fits(
        self,
        vectors: list[FloatArray],
        sightings: Sequence[Sighting],
        polar: PolarView,
        trials: StartTrials,
        label: str,
    ) -> list[Fit]:
        """Return short fits of untilted cameras from several starts, for ranking, best first."""
        tried = trials.results(_ShortFit(self, sightings, polar), vectors, label)
        return sorted((fit for fit in tried if fit is not None), key=lambda fit: fit.cost)

    def _curves(self) -> list[FloatArray]:
        if self.is_guess:
            outer = self.model.frame.usable_radius_px[1]
            horizons = [math.log(outer * f) for f in _UNKNOWN_HORIZONS]
        else:
            tried = _OWN_HORIZONS if self.model.curve == "own" else _HORIZONS
            horizons = [float(self.start[HORIZON]) + math.log(f) for f in tried]
        curves = []
        for horizon in horizons:
            for factor in _SCALES:
                vector = self.start.copy()
                vector[HORIZON] = horizon
                vector[SCALE] += math.log(factor)
                curves.append(np.clip(vector, *self.bounds))
        return curves

    def by_lines(self, camera: OmniCamera) -> EdgeFinder:
        """Return a finder of poses by points on lines for a camera; the field must have lines."""
        return EdgeFinder(EdgeFollower(lines_only(self.shape.field), downward(camera)))

    def poses(self, camera: OmniCamera, sightings: Sequence[Sighting], polar: PolarView) -> FloatArray | None:
        """Return the robot's pose (F, 3) in every frame for a camera; None if one of them is not found."""
        fitter: OutlineFitter | None = None
        by_lines: EdgeFinder | None = None
        if self.shape.field.is_bounded:
            seen_from = dataclasses.replace(camera, center_px=polar.camera.center_px, tilt_rad=(0.0, 0.0))
            fitter = OutlineFitter(self.shape.field, seen_from, polar)
        poses = []
        for sighting in sightings:
            pose = None if fitter is None else fitter.likeliest(sighting.radius_px)
            if pose is None and self.shape.field.has_lines:
                by_lines = by_lines or self.by_lines(camera)
                pose = by_lines.likeliest_by_points(sighting.line_px)
            if pose is None:
                return None
            poses.append(pose.array)
        return np.array(poses)


@dataclass(frozen=True, eq=False)
class _ShortFit:
    search: Search
    sightings: Sequence[Sighting]
    polar: PolarView

    def __call__(self) -> Callable[[FloatArray], Fit | None]:
        search, points = self.search, points_of(self.sightings)
        stride = -(-len(points.pixels) // (_SHORT_POINTS * len(self.sightings)))
        joint = JointFit(search.shape, points.take(np.arange(len(points.pixels)) % stride == 0))
        level = np.ones(search.model.size, dtype=bool)
        level[TILT] = False
        scales = tuple(scale * search.unit_px for scale in _SHORT_SCALES)

        def fit(vector: FloatArray) -> Fit | None:
            poses = search.poses(search.model.camera(vector), self.sightings, self.polar)
            if poses is None:
                return None
            return joint.solve(search.model, vector, poses, scales, vector, search.bounds, level, repeats=2, most=4)

        return fit


@dataclass(frozen=True, eq=False)
class _LongFit:
    search: Search
    sightings: Sequence[Sighting]

    def __call__(self) -> Callable[[Fit], Fit]:
        search = self.search
        joint = JointFit(search.shape, points_of(self.sightings))
        scales = (*(scale * search.unit_px for scale in _LONG_SCALES), 1.0)
        return lambda fit: joint.solve(search.model, fit.vector, fit.poses, scales, search.start, search.bounds)
