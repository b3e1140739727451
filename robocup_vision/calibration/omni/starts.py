"""Starts for the fit of a mirror camera: the points of each frame, and curves of several horizons and scales.

Of a frame only its points are kept, the floor's edge and white lines, so that a folder of a thousand images needs no
more memory than one of them. One start is not enough: a curve that is a fifth off puts robots in the wrong place, and
the fit then settles there.
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
from robocup_vision.calibration.omni.settings import REFERENCE_RADIUS_PX, FramePointSettings, OmniCalibrationSettings
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.geometry import Pose2
from robocup_vision.localization.floor import OutlineFitter
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.search import search_by_lines
from robocup_vision.perception.line_points import LineFinder, LinePoints
from robocup_vision.perception.polar_view import PolarView
from robocup_vision.vision import Vision


@dataclass(frozen=True, eq=False)
class Sighting:
    """The points of one frame."""

    index: int  #: number of the frame
    #: (K,) float64: image radius of the floor's edge at each bearing about the observer's centre; NaN where none
    radius_px: FloatArray
    boundary_px: FloatArray  #: (B, 2) float64: the same as pixels, without gaps
    line_px: FloatArray  #: (L, 2) float64: points on painted lines
    line_weight: FloatArray  #: (L,) float64: 1 with floor on both sides, less otherwise
    pose: Pose2 | None  #: the robot's pose by this frame and the observer's camera


class Observer:
    """Finds points in frames by a camera that may be wrong.

    Parameters
    ----------
    camera : OmniCamera
        Its centre and usable radii are used, and its curve for the width of lines.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    locate : bool
        Whether poses are estimated, too: they need a camera that is nearly right.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        mask: UInt8Array | None,
        *,
        locate: bool,
        settings: FramePointSettings = FramePointSettings(),
    ) -> None:
        self.field, self._settings = field, settings
        prepare("mirror_field")
        self._locate = locate
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
            If the frame has another size or type than the camera says.
        """
        self._vision.forget()
        view = self._vision.look(frame)
        self.floor_ratio += (view.marks > 0).mean(axis=0)
        lines = self._finder.find(frame)
        stride = -(-len(lines) // self._settings.max_line_points)
        chosen = np.arange(0, len(lines), max(stride, 1))
        boundary = view.boundary_px if self.field.is_bounded else np.empty((0, 2))
        seen = np.isfinite(boundary).all(axis=1)
        pose = view.pose.pose if self._locate and view.pose else None
        # a copy that may be written to, as a view hands it to its loops: for another type they would be compiled anew
        radius_px = np.array(view.boundary_radius_px)
        return Sighting(index, radius_px, boundary[seen], lines.pixels[chosen], lines.weight[chosen], pose)

    @property
    def inner_radius_px(self) -> float:
        """Image radius beyond which floor surrounds the robot in the frames so far."""
        least = self._settings.min_floor_ratio * self.floor_ratio.max()
        return float(self.polar.radius_px[int(np.argmax(self.floor_ratio >= least))])


def points_of(sightings: Sequence[Sighting]) -> Points:
    """Return all points of some sightings for a fit."""
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
    """Finds starts of a fit: curves, with a pose for each frame."""

    field: Field
    shape: FieldShape
    line_map: LineMap
    model: CameraModel  #: the family of curves
    start: FloatArray  #: (G,) float64: mean of the prior: a camera file's vector, or a guess
    bounds: tuple[FloatArray, FloatArray]  #: ((G,), (G,)) float64: lower and upper bound of the vector
    is_guess: bool  #: whether the start's curve is a guess; its horizon is then not used
    settings: OmniCalibrationSettings = OmniCalibrationSettings()  #: its `starts` and `fit` are used

    @property
    def unit_px(self) -> float:
        """Pixels of one "unit" of the settings, see `REFERENCE_RADIUS_PX`."""
        inner, outer = self.model.frame.usable_radius_px
        return max(1.0, (outer - inner) / REFERENCE_RADIUS_PX)

    def best(self, sightings: Sequence[Sighting], polar: PolarView, trials: StartTrials) -> list[Fit]:
        """Return the best distinct long fits to the frames that show most, best first.

        Parameters
        ----------
        polar : PolarView
            The view in which the floor's edges were found.
        """
        settings = self.settings.starts
        most = sorted(sightings, key=lambda s: -(len(s.boundary_px) + len(s.line_px)))[: settings.frames]
        vectors = self._curves()
        if len(most) > settings.first_frames:
            first = self._short_fits(vectors, most[: settings.first_frames], polar, trials, "starts")
            vectors = [fit.vector for fit in first[: settings.curves_kept]]
        kept = self._short_fits(vectors, most, polar, trials, "better starts")[: settings.kept]
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
        """Fits of level cameras from several starts, best first, just long enough to rank them."""
        tried = trials.results(_ShortFit(self, sightings, polar), vectors, label)
        return sorted((fit for fit in tried if fit is not None), key=lambda fit: fit.cost)

    def _curves(self) -> list[FloatArray]:
        low, high = self.bounds
        settings = self.settings.starts
        curves = []
        outer = self.model.frame.usable_radius_px[1]
        horizons = [math.log(outer * f) for f in settings.unknown_horizons]
        if not self.is_guess:
            tried = settings.own_horizons if self.model.curve == "own" else settings.horizons
            horizons = [float(self.start[HORIZON]) + math.log(f) for f in tried]
        for horizon in horizons:
            for factor in settings.scales:
                vector = self.start.copy()
                vector[HORIZON] = horizon
                vector[SCALE] += math.log(factor)
                curves.append(np.clip(vector, low, high))
        return curves

    def pose_by_lines(self, camera: OmniCamera, sighting: Sighting) -> Pose2 | None:
        """Return the likeliest pose by a frame's lines alone; None where they are too few."""
        points = LinePoints.from_pixels(camera, sighting.line_px, sighting.line_weight)
        found = search_by_lines(points, self.line_map, 1)
        return found[0].pose if found else None

    def poses(self, camera: OmniCamera, sightings: Sequence[Sighting], polar: PolarView) -> FloatArray | None:
        """Return the robot's pose (F, 3) in every frame by a camera; None where one is not found."""
        fitter = None
        if self.field.is_bounded:
            seen_from = dataclasses.replace(camera, center_px=polar.camera.center_px, tilt_rad=(0.0, 0.0))
            fitter = OutlineFitter(self.field, seen_from, polar)
        poses = []
        for sighting in sightings:
            pose = None
            if fitter is not None:
                pose = fitter.likeliest(sighting.radius_px)
            if pose is None:
                pose = self.pose_by_lines(camera, sighting)
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
        search, settings = self.search, self.search.settings.starts
        points = points_of(self.sightings)
        stride = -(-len(points.pixels) // (settings.short_points * len(self.sightings)))
        joint = JointFit(search.shape, points.take(np.arange(len(points.pixels)) % stride == 0), search.settings.fit)
        level = np.ones(search.model.size, dtype=bool)
        level[TILT] = False
        scales = tuple(scale * search.unit_px for scale in settings.short_scales)

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
        joint = JointFit(search.shape, points_of(self.sightings), search.settings.fit)
        scales = (*(scale * search.unit_px for scale in search.settings.starts.long_scales), 1.0)
        return lambda fit: joint.solve(search.model, fit.vector, fit.poses, scales, search.start, search.bounds)
