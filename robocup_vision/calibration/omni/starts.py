"""Where a fit of a mirror camera may start from: curves of several horizons and scales, with a pose for every frame.

One start is not enough: a curve that is a fifth off puts robots in the wrong place, and the fit then settles there.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.omni.fit import FieldShape, Fit, JointFit
from robocup_vision.calibration.omni.model import HORIZON, SCALE, TILT, CameraModel
from robocup_vision.calibration.omni.sightings import Sighting, points_of
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.kernels.floor.hull import hull_radius
from robocup_vision.localization.floor import OutlineFitter
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.search import search_by_lines
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.polar_view import PolarView

# horizons tried, as factors of the start's, or, without a start, of the outer usable radius
_HORIZONS = (0.78, 0.88, 1.0, 1.13, 1.28)
_UNKNOWN_HORIZONS = (0.75, 0.88, 1.02, 1.2, 1.45, 1.8)
# scales tried, as factors of the one that gives the floor its area; without walls, of
# the start's, or of a guess, of which there are several
_SCALES_BY_AREA = (0.93, 1.0, 1.07)
_SCALES = (0.62, 0.79, 1.0, 1.27, 1.61)
_GUESSED_SCALES = (0.8, 1.0, 1.25)
# frames that starts are judged by
_FRAMES = 6
# widths of the weights in the short fits and in the long ones, in units of 1/86 of the usable radius
_SHORT_SCALES = (12.0, 6.0, 3.0)
LONG_SCALES = (8.0, 4.0, 2.0, 1.0)
# about so many points a frame are enough for that
_SHORT_POINTS = 120
# starts are judged by so many frames first, and so many of them go on to all frames, then to the long fit
_FIRST_FRAMES = 2
_CURVES_KEPT = 8
_KEPT = 4
_UNITS = 86.0


@dataclass(frozen=True, eq=False)
class Search:
    """What starts are looked for with.

    Parameters
    ----------
    field : Field
        The pitch.
    shape : FieldShape
        Its walls and lines.
    line_map : LineMap
        Its lines.
    model : CameraModel
        The family of curves.
    start : (G,) float64
        What is known, or guessed, beforehand.
    bounds : ((G,), (G,)) float64
        How far from it a fit may go.
    is_guess : bool
        Whether the start's curve is a mere guess: its horizon then counts for nothing.
    """

    field: Field
    shape: FieldShape
    line_map: LineMap
    model: CameraModel
    start: FloatArray
    bounds: tuple[FloatArray, FloatArray]
    is_guess: bool

    @property
    def unit_px(self) -> float:
        """What widths of weights are counted in: a pixel in a small image, more in a large one."""
        inner, outer = self.model.frame.usable_radius_px
        return max(1.0, (outer - inner) / _UNITS)

    def best(self, sightings: Sequence[Sighting], polar: PolarView) -> list[Fit]:
        """Return the best distinct long fits to the frames that show most, best first.

        Parameters
        ----------
        sightings : sequence of Sighting
            Not empty.
        polar : PolarView
            That the floor's edges were seen in.
        """
        most = sorted(sightings, key=lambda s: -(len(s.boundary_px) + len(s.line_px)))[:_FRAMES]
        vectors = self._curves(most, polar)
        if len(most) > _FIRST_FRAMES:
            vectors = [fit.vector for fit in self._short_fits(vectors, most[:_FIRST_FRAMES], polar)[:_CURVES_KEPT]]
        kept = self._short_fits(vectors, most, polar)[:_KEPT]
        joint = JointFit(self.shape, points_of(most))
        scales = (*(scale * self.unit_px for scale in LONG_SCALES), 1.0)
        fits = [joint.solve(self.model, fit.vector, fit.poses, scales, self.start, self.bounds) for fit in kept]
        return sorted(fits, key=lambda fit: fit.cost)

    def _short_fits(self, vectors: list[FloatArray], sightings: Sequence[Sighting], polar: PolarView) -> list[Fit]:
        """Fits of level cameras from several starts, best first, just far enough to tell good starts from bad ones."""
        points = points_of(sightings)
        stride = -(-len(points.pixels) // (_SHORT_POINTS * len(sightings)))
        joint = JointFit(self.shape, points.take(np.arange(len(points.pixels)) % stride == 0))
        level = np.ones(self.model.size, dtype=bool)
        level[TILT] = False
        scales = tuple(scale * self.unit_px for scale in _SHORT_SCALES)
        fits = []
        for vector in vectors:
            poses = self._poses(self.model.camera(vector), sightings, polar)
            if poses is not None:
                fits.append(
                    joint.solve(self.model, vector, poses, scales, vector, self.bounds, level, repeats=2, most=4)
                )
        return sorted(fits, key=lambda fit: fit.cost)

    def _curves(self, sightings: Sequence[Sighting], polar: PolarView) -> list[FloatArray]:
        low, high = self.bounds
        curves = []
        outer = self.model.frame.usable_radius_px[1]
        horizons = [math.log(outer * f) for f in _UNKNOWN_HORIZONS]
        if not self.is_guess:
            horizons = [float(self.start[HORIZON]) + math.log(f) for f in _HORIZONS]
        for horizon in horizons:
            vector = self.start.copy()
            vector[HORIZON] = horizon
            factors: tuple[float, ...] = _GUESSED_SCALES if self.is_guess else _SCALES
            if self.field.is_bounded:
                grown = self._scale_by_area(vector, sightings, polar)
                if grown is not None:
                    vector[SCALE], factors = grown, _SCALES_BY_AREA
            for factor in factors:
                scaled = vector.copy()
                scaled[SCALE] += math.log(factor)
                curves.append(np.clip(scaled, low, high))
        return curves

    def _scale_by_area(self, vector: FloatArray, sightings: Sequence[Sighting], polar: PolarView) -> float | None:
        """Logarithm of the K that gives the convex hull of the floor seen the field's area, if the horizon is right."""
        camera = self.model.camera(vector)
        corners = self.field.floor_polygon
        turned = np.roll(corners, -1, axis=0)
        area = 0.5 * abs(float(np.sum(corners[:, 0] * turned[:, 1] - corners[:, 1] * turned[:, 0])))
        cos_b, sin_b = np.cos(polar.bearing_rad), np.sin(polar.bearing_rad)
        farthest_m = 1.2 * float(np.hypot(*np.ptp(corners, axis=0)))
        ratios = []
        for sighting in sightings:
            hull = np.empty(len(cos_b))
            if hull_radius(cos_b, sin_b, sighting.radius_px, hull) < 3:
                continue
            q = np.maximum(np.nan_to_num(camera.floor_range.inverse_range_per_m(hull)), 1 / farthest_m)
            ratios.append(0.5 * math.sin(math.tau / len(q)) * float(np.sum(1 / (q * np.roll(q, 1)))) / area)
        # where others stand in the way the hull is too small
        return float(vector[SCALE]) + 0.5 * math.log(float(np.percentile(ratios, 60))) if ratios else None

    def _poses(self, camera: OmniCamera, sightings: Sequence[Sighting], polar: PolarView) -> FloatArray | None:
        fitter = None
        if self.field.is_bounded:
            seen_from = dataclasses.replace(camera, center_px=polar.camera.center_px, tilt_rad=(0.0, 0.0))
            fitter = OutlineFitter(self.field, seen_from, polar)
        poses = []
        for sighting in sightings:
            pose = None
            if fitter is not None:
                estimate, _ = fitter.locate(sighting.radius_px)
                pose = estimate.pose if estimate else fitter.first_guess(sighting.radius_px)
            if pose is None:
                points = LinePoints.from_pixels(camera, sighting.line_px, sighting.line_weight)
                found = search_by_lines(points, self.line_map, 1)
                pose = found[0].pose if found else None
            if pose is None:
                return None
            poses.append(pose.array)
        return np.array(poses)
