"""Whether the lines in a picture support a pose that was estimated without them.

A floor's outline can be fitted to any picture: a shore, a bear before a wall. A field also shows its lines, where the
pose says that they lie. Line points that the pose does not explain speak against it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor.free_floor import FLOOR, LINE
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.polar_view import PolarView


@dataclass(frozen=True, slots=True)
class LineSupportSettings:
    """When lines support a pose that the floor's outline gives.

    Parameters
    ----------
    sure_inlier_ratio, max_sure_rms : float
        An outline of which so much agrees needs no lines: on photographs of other things at most 0.7 agree. Round
        shapes agree by chance, too, but spread over the whole gate; see `max_tight_rms`.
    tight_inlier_ratio, max_tight_rms : float
        Nor does one of which so much agrees so well: root mean square of the residuals, in units of 1/86 of the usable
        radius. What agrees by chance is spread over the whole gate: 0.3 to 0.9 on pictures of other things.
    min_evidence : float
        Fraction of the outline that agrees, plus `point_weight` times the fraction of the line points that lie on
        lines: at most 0.76 on photographs of other things, at least 0.89 on rendered crowds and highlights.
    point_weight : float
        A line point is stronger evidence than a bearing: only a field has lines where the pose puts them.
    min_samples : int
        With fewer samples marked as line these are not evidence. They are coarse, but cost nothing; where they do not
        support the pose, line points are found to a fraction of a pixel.
    min_sample_ratio : float
        Of these samples, those that must lie on lines: coarse ones come near to some line by chance. Then floor shows
        where other lines should be.
    min_points : int
        With fewer the points are no evidence: robots may hide all lines. Plain floor where the pose puts lines is then
        evidence against it.
    min_hidden_inlier_ratio, sure_hidden_nats : float
        Where all lines are hidden: the fraction of the outline that must agree, and the log-likelihood ratio a bearing,
        against chance, that needs nothing else.
    min_bare_inlier_ratio, min_bare_nats, max_bare_samples : float, float, int
        With less the picture may show plain floor, far from the walls: more must agree, with some of that ratio, and
        hardly any sample may look like a line where the pose has none.
    min_bare_samples : int
        So many samples of plain floor where the pose puts lines speak against it, where no lines are seen.
    near_widths : float
        So near to a line's middle, in line widths, a point is on it.
    clear_ratio : float
        Of several poses, one is chosen whose lines are so many times nearer to the samples than those of any other.
    """

    sure_inlier_ratio: float = 0.8
    max_sure_rms: float = 0.45
    tight_inlier_ratio: float = 0.65
    max_tight_rms: float = 0.35
    chance_rms: float = 3.0 / math.sqrt(math.tau * math.e)
    min_evidence: float = 0.83
    point_weight: float = 1.5
    min_samples: int = 20
    min_sample_ratio: float = 0.4
    min_points: int = 20
    min_hidden_inlier_ratio: float = 0.4
    sure_hidden_nats: float = 0.6
    min_bare_inlier_ratio: float = 0.53
    min_bare_nats: float = 0.15
    max_bare_samples: int = 15
    min_bare_samples: int = 10
    near_widths: float = 1.2
    clear_ratio: float = 2.0


class LineSupport:
    """Decides whether lines support a mirror camera's pose.

    Parameters
    ----------
    line_map : LineMap
        The field's lines.
    find_points : callable
        Returns the line points in a frame of the camera's.
    view : PolarView
        Where the marked floor samples lie.
    settings : LineSupportSettings
        Thresholds.
    """

    def __init__(
        self,
        line_map: LineMap,
        find_points: Callable[[UInt8Array], LinePoints],
        view: PolarView,
        settings: LineSupportSettings = LineSupportSettings(),
    ) -> None:
        self._map, self._find_points, self._view, self._settings = line_map, find_points, view, settings
        self._near_m = settings.near_widths * line_map.field.line_width_m
        inner, outer = view.camera.usable_radius_px
        self._unit_px = max(1.0, (outer - inner) / 86.0)
        deep_m = np.gradient(view.range_m)
        # a sample stands for half a column inwards and outwards
        self._near_sample_m = np.maximum(self._near_m, 0.5 * deep_m + 0.5 * self._near_m)
        # near enough for a line to fill its sample
        is_fine = deep_m < 2 * line_map.field.line_width_m
        self._bare_m = np.where(is_fine, 0.25 * line_map.field.line_width_m, 0.0)

    def supports(self, estimate: PoseEstimate, frame: UInt8Array, marks: UInt8Array) -> bool:
        """Whether the lines in view support a pose.

        Parameters
        ----------
        estimate : PoseEstimate
            By the floor's outline.
        frame : (H, W, 3) uint8
            BGR.
        marks : (K, M) uint8
            What the view's samples show, from `FloorMarking.mark`.
        """
        settings = self._settings
        rms = estimate.residual_px / self._unit_px
        if estimate.inlier_ratio >= settings.sure_inlier_ratio and rms <= settings.max_sure_rms:
            return True
        if estimate.inlier_ratio >= settings.tight_inlier_ratio and rms <= settings.max_tight_rms:
            return True
        above_chance = math.log(settings.chance_rms / max(rms, 1e-3))
        tightness = above_chance / math.log(settings.chance_rms / settings.max_tight_rms)
        agreeing_ratio = estimate.inlier_ratio * min(max(tightness, 0.0), 1.0)
        samples = int(np.count_nonzero(marks == LINE))
        missing_ratio = (settings.min_evidence - agreeing_ratio) / settings.point_weight
        on_lines = self._map.count_near(estimate.pose, marks, LINE, self._view.floor_m, self._near_sample_m)
        min_on_lines = max(missing_ratio, settings.min_sample_ratio) * samples
        if samples >= settings.min_samples and on_lines >= min_on_lines and not self._lacks_lines(estimate, marks):
            return True
        points = self._find_points(frame)
        if len(points) >= settings.min_points:
            away_m = self._map.nearest(estimate.pose.transform(points.floor_m)).distance_m
            return bool(np.count_nonzero(away_m < self._near_m) >= missing_ratio * len(points))
        nats = estimate.inlier_ratio * above_chance
        if nats >= settings.sure_hidden_nats:
            is_outline_enough = estimate.inlier_ratio >= settings.min_hidden_inlier_ratio
        else:
            is_outline_enough = (
                estimate.inlier_ratio >= settings.min_bare_inlier_ratio
                and nats >= settings.min_bare_nats
                and samples - on_lines <= settings.max_bare_samples
            )
        return is_outline_enough and not self._lacks_lines(estimate, marks)

    def choose(self, poses: list[Pose2], marks: UInt8Array) -> int | None:
        """Return the index of the pose whose lines clearly run best through the samples marked as line; else None.

        Parameters
        ----------
        poses : list of Pose2
            Two or more that explain the outline about equally well.
        marks : (K, M) uint8
            As `supports` takes them.
        """
        row, column = np.nonzero(marks == LINE)
        if len(row) < self._settings.min_samples:
            return None
        loss = self._map.rough_losses_m(poses, self._view.floor_m[row, column])
        best, second = np.argsort(loss)[:2]
        return int(best) if self._settings.clear_ratio * loss[best] < loss[second] else None

    def _lacks_lines(self, estimate: PoseEstimate, marks: UInt8Array) -> bool:
        """Whether plain floor shows where the pose puts lines."""
        bare = self._map.count_near(estimate.pose, marks, FLOOR, self._view.floor_m, self._bare_m)
        return bare >= self._settings.min_bare_samples
