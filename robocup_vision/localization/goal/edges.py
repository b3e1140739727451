"""Measures silhouette edges of posts, bar and feet where a pose predicts them, to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.edge_places import goal_points
from robocup_vision.kernels.goal.edge_samples import DueEdges, EdgeLook, FoundEdges, sample_edges
from robocup_vision.kernels.goal.fit import FitSamples
from robocup_vision.kernels.goal.picture import GoalScene
from robocup_vision.localization.goal.geometry import (
    EDGES,
    GoalShape,
    IdealView,
)

FOOT_OFFSETS = np.array([-0.7, -0.35, 0.0, 0.35, 0.7])
_NO_MASK = np.empty((0, 0), np.uint8)
_SPACING_PX = 2.0  # between samples on an edge: the noise of nearer ones is correlated
_MAX_SAMPLES = 40  # of one edge: more take time and hardly improve a fit
_PAINT_DEPTH_PX = 3.0  # how far inside an edge there must be paint of the goal's colour
# colour difference (BGR) paint - carpet at a foot. Greenness finds the carpet: brightness steps at sun patches and
# lines as well.
_FOOT_TOWARDS = (0.5, -1.0, 0.5)


@dataclass(frozen=True, slots=True)
class EdgeAppearance:
    """Appearance of the edges between paint and its surroundings."""

    #: (3,) float64: colour difference (BGR) paint - surroundings that every edge agrees with in sign
    towards: FloatArray
    glare: float  #: samples whose paint is brighter than this and half washed white are dropped
    grey: float  #: how much of the difference in brightness counts, see `EdgeLook`
    #: (H, W) uint8: mask of the paint, perhaps of reduced size: edges and feet count only where paint is just inside.
    #: None: anywhere.
    paint: npt.NDArray[np.uint8] | None = None


def _none() -> FloatArray:
    return np.empty((0, 2))


@dataclass(frozen=True, slots=True)
class EdgeSamples:
    """Measured edges in ideal pixels (without distortion), for `kernels.goal.fit.fit_goal`."""

    edge: npt.NDArray[np.int64]  #: (N,) int64: which silhouette edge each sample belongs to (order of goal/geometry.py)
    uv: FloatArray  #: (N, 2) float64: where it was found
    #: (M,) int64: post (0 left, 1 right) of each foot sample, and its index into `FOOT_OFFSETS`
    foot_post: npt.NDArray[np.int64]
    foot_at: npt.NDArray[np.int64]
    #: (M, 2) float64: where the paint ends, and along which direction that was measured
    foot_uv: FloatArray
    foot_direction: FloatArray
    sigma: FloatArray  #: (N + M,) float64: noise of edges and feet, pixels
    #: (6,) int64: samples of each edge inside the image, found or not, without those in glare
    expected: npt.NDArray[np.int64]

    @property
    def for_fit(self) -> FitSamples:
        """The samples as the kernels take them, without marks on lines."""
        return FitSamples(
            self.edge,
            self.uv,
            self.foot_post,
            self.foot_at,
            self.foot_uv,
            self.foot_direction,
            _none(),
            _none(),
            _none(),
            self.sigma,
        )


def goal_scene(shape: GoalShape, view: IdealView) -> GoalScene:
    """Goal and camera as the kernels take them."""
    return GoalScene(
        np.array([shape.line_x_m, shape.width_m, shape.height_m, shape.radius_m]),
        np.array([*view.focal_px, *view.center_px]),
        FOOT_OFFSETS,
    )


def from_ideal(camera: PinholeCamera, ideal: FloatArray) -> FloatArray:
    """Image pixels (..., 2) of ideal ones."""
    if not camera.is_bent:
        return ideal
    slopes = (ideal - np.array(camera.center_px)) / np.array(camera.focal_px)
    return camera.camera_ray_to_pixel(np.concatenate([np.ones((*slopes.shape[:-1], 1)), -slopes], axis=-1))


def measure(
    image: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    view: IdealView,
    shape: GoalShape,
    unknowns: FloatArray,
    reach_px: float,
    appearance: EdgeAppearance,
) -> EdgeSamples | None:
    """Measure silhouette edges and feet of a goal in a BGR frame, within `reach_px` of their places by `unknowns` (8,).

    None where the goal is not in front of the camera.
    """
    feet = 2 * len(FOOT_OFFSETS)
    points = np.empty((2 * EDGES + 2 * feet, 2))
    if not goal_points(goal_scene(shape, view), unknowns, points):
        return None
    capacity = EDGES * _MAX_SAMPLES + feet
    found = FoundEdges(
        np.empty(capacity, np.int64),
        np.empty((capacity, 2)),
        np.empty((capacity, 2)),
        np.empty(capacity),
        np.empty(EDGES, np.int64),
    )
    due = DueEdges(from_ideal(camera, points), feet, _SPACING_PX, _MAX_SAMPLES, reach_px)
    look = EdgeLook(
        appearance.towards,
        np.array(_FOOT_TOWARDS),
        appearance.glare,
        appearance.grey,
        _NO_MASK if appearance.paint is None else appearance.paint,
        _PAINT_DEPTH_PX,
    )
    edges, seen_feet = sample_edges(image, due, look, found)
    last = edges + seen_feet
    where, foot = camera.ideal_pixels(found.uv[:last]), found.edge[edges:last]
    return EdgeSamples(
        found.edge[:edges],
        where[:edges],
        foot // len(FOOT_OFFSETS),
        foot % len(FOOT_OFFSETS),
        where[edges:],
        found.normals[edges:last],
        found.sigma[:last],
        found.expected,
    )
