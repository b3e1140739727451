"""The verdict on a pose by line points alone: those that its lines explain, and lines in plain sight found or missed.

Line points off the lines lie on robots, cables, people: they are explained by clutter, at the rate that pictures show.
How often a predicted line is found by chance is asked of the frame itself, by placing the lines anywhere.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from robocup_vision.arrays import Int64Array, UInt8Array
from robocup_vision.geometry import Pose2
from robocup_vision.localization.evidence import LineCounts, LinesAloneLikelihoods, odds_text
from robocup_vision.localization.lines.fit import residuals_px
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.search import LineSearchSettings, one_per_patch
from robocup_vision.perception.line_points import FloorCamera, LinePoints

# samples of the lines lie this far apart, in lengths of the field: of any field there are as many
_SPACING = 0.02
# a sample is found where a line point lies in the square of so many pixels about it
_NEAR_PX = 9
# of the gate within which a point agrees with a pose, the part where it is on the line
_ON_LINE = 1 / 3
# places at which the lines of a frame are found by chance: the share of all their samples is what counts
_PLACES = 48


class SeenLines(NamedTuple):
    """The line points of one frame, as poses are judged by.

    Parameters
    ----------
    patches : LinePoints
        One line point for each patch of floor.
    near : (H, W) uint8
        Not zero near a line point.
    bare : (H, W) uint8
        Not zero where there is floor and no line.
    chance : float
        See `LineCounts`.
    """

    patches: LinePoints
    near: UInt8Array
    bare: UInt8Array
    chance: float


class LineTally(NamedTuple):
    """What a frame's line points say of a pose: its log odds, and what is counted."""

    log_odds: float
    counts: LineCounts

    @property
    def reason(self) -> str:
        """Say what was missing."""
        on_line, near, _ = self.counts.points
        found, visible = self.counts.found, self.counts.found + self.counts.missed
        return (
            f"{found} of {visible} visible line samples found, {on_line + near:.0f} of {self.counts.points.sum():.0f} "
            f"patches of line points on lines, odds {odds_text(self.log_odds)}"
        )


class LinesAloneEvidence:
    """Counts what line points show of a pose, and weighs it.

    Parameters
    ----------
    camera : FloorCamera
        Takes the frames.
    line_map : LineMap
        The field's lines.
    likelihoods : LinesAloneLikelihoods
        Of what is counted.
    inlier_px : float
        A point within this many pixels of a line agrees with a pose.
    settings : LineSearchSettings, optional
        Its patches are used.
    """

    def __init__(
        self,
        camera: FloorCamera,
        line_map: LineMap,
        likelihoods: LinesAloneLikelihoods,
        inlier_px: float,
        settings: LineSearchSettings = LineSearchSettings(),
    ) -> None:
        self._camera, self._map, self._likelihoods = camera, line_map, likelihoods
        self._inlier_px, self._settings = inlier_px, settings
        self._samples_m = line_map.field.line_points(_SPACING * line_map.field.length_m)
        rng = np.random.default_rng(0)
        low, high = line_map.extent_m
        anywhere = rng.uniform([*low, -math.pi], [*high, math.pi], (_PLACES, 3)).tolist()
        self._anywhere = np.concatenate([self._places(Pose2(*at)) for at in anywhere])

    def see(self, points: LinePoints) -> SeenLines:
        """Prepare a frame's line points; without bare floor nothing predicted is found or missed."""
        patches = one_per_patch(points, math.inf, self._settings)
        width, height = self._camera.size_px
        if points.bare_floor is None:
            nothing = np.zeros((height, width), dtype=np.uint8)
            return SeenLines(patches, nothing, nothing, 0.5)
        spots = np.zeros((height, width), dtype=np.uint8)
        u, v = np.rint(points.pixels).astype(np.int64).T
        spots[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)] = 1
        near = np.asarray(cv2.dilate(spots, np.ones((_NEAR_PX, _NEAR_PX), dtype=np.uint8)), dtype=np.uint8)
        seen = SeenLines(patches, near, points.bare_floor.view(np.uint8), 0.5)
        found, missed = _looked_up(seen, self._anywhere)
        return seen._replace(chance=(found + 1) / (found + missed + 2))

    def tally(self, pose: Pose2, seen: SeenLines) -> LineTally:
        """Weigh a pose."""
        counts = self.counts(pose, seen)
        return LineTally(self._likelihoods.log_odds(counts), counts)

    def counts(self, pose: Pose2, seen: SeenLines) -> LineCounts:
        """Count what the line points show of a pose."""
        residual_px = residuals_px(pose, seen.patches, self._map)
        agrees = residual_px <= self._inlier_px
        on_line = int(np.count_nonzero(residual_px <= _ON_LINE * self._inlier_px))
        explained = int(np.count_nonzero(agrees))
        # what stands around the field is neither for nor against a pose
        told = int(np.count_nonzero(self._map.counts(pose.transform(seen.patches.floor_m), agrees)))
        points = np.array([on_line, explained - on_line, told - explained], dtype=np.float64)
        found, missed = _looked_up(seen, self._places(pose))
        return LineCounts(points, found, missed, seen.chance)

    def _places(self, pose: Pose2) -> Int64Array:
        """Return where in the frame, flattened, the samples of the lines lie by a pose."""
        width, height = self._camera.size_px
        pixels = self._camera.floor_to_pixel(pose.inverse().transform(self._samples_m))
        pixels = np.rint(pixels[np.isfinite(pixels).all(axis=1)])
        u, v = pixels[((pixels >= 0) & (pixels < (width, height))).all(axis=1)].astype(np.int64).T
        return np.asarray(v * width + u)


def _looked_up(seen: SeenLines, places: Int64Array) -> tuple[int, int]:
    """Count the places that are found, and those that show bare floor instead."""
    near = seen.near.ravel()[places] > 0
    bare = seen.bare.ravel()[places] > 0
    return int(np.count_nonzero(near)), int(np.count_nonzero(bare & ~near))
