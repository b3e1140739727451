"""Finds the landmarks a camera may see without looking at the whole map: a floor plan of cells, the best of each.

A cell of space keeps its best few views from each of the 36 directions, so that the time a look-up takes depends on the
surfaces in view, not on how many landmarks the map holds.
"""

from __future__ import annotations

import math

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.algebra.pinhole import PinholeView
from robocup_vision.kernels.landmarks.index import FloorPlan, InView, views_in_frustum
from robocup_vision.landmarks.landmark_map import DIRECTIONS, VIEW_REACH_RAD, Expected, LandmarkMap, nearest_views


class MapIndex:
    """A map sorted by place.

    Parameters
    ----------
    cell_m : float
        Side of a cell of space.
    keep : int
        Views kept of a cell and direction: those of the highest success rate, then contrast.
    reach_m : float
        Farthest distance looked up.
    """

    def __init__(self, landmarks: LandmarkMap, *, cell_m: float = 0.25, keep: int = 3, reach_m: float = 15.0) -> None:
        if not (cell_m > 0 and keep >= 1 and reach_m > 0):
            raise ArgumentError(f"cell_m, keep and reach_m must be positive, got {cell_m}, {keep}, {reach_m}")
        self.landmarks = landmarks
        self._reach_m = reach_m
        of = landmarks.view_landmark
        places = landmarks.positions_m[of]
        corner = places.min(axis=0) - 1e-6 if len(places) else np.zeros(3)
        cell = ((places - corner) / cell_m).astype(np.int64)
        wide, deep, _ = cell.max(axis=0, initial=0) + 1
        column = cell[:, 1] * wide + cell[:, 0]
        box = (column * (cell[:, 2].max(initial=0) + 1) + cell[:, 2]) * DIRECTIONS + landmarks.view_direction
        order = np.lexsort((-landmarks.view_contrast, -landmarks.success[of], box))
        rank = np.arange(len(order)) - np.searchsorted(box[order], box[order])
        self._views = order[rank < keep].astype(np.int64)
        self._plan = FloorPlan(
            np.ascontiguousarray(places[self._views]),
            landmarks.view_direction[self._views] * (math.tau / DIRECTIONS),
            np.searchsorted(column[self._views], np.arange(wide * deep + 1)),
            (int(wide), int(deep)),
            corner,
            cell_m,
        )
        count = len(self._views)
        self._found = InView(np.empty(count, dtype=np.int64), np.empty((count, 2)), np.empty(count))

    def __len__(self) -> int:
        return len(self._views)

    def expect(self, camera: PinholeCamera, pose: FloatArray) -> Expected:
        """Landmarks in the view frustum of a robot at a pose (3,), as `landmark_map.expect`, of each cell the best."""
        found = self._found
        count = views_in_frustum(
            pinhole_view(camera),
            camera.size_px,
            pose,
            self._plan,
            self._reach_m,
            VIEW_REACH_RAD + math.pi / DIRECTIONS,
            found,
        )
        views = self._views[found.number[:count]]
        return nearest_views(self.landmarks, camera, pose, views, found.pixels[:count], found.depth_m[:count])


def pinhole_view(camera: PinholeCamera) -> PinholeView:
    """Return what the kernels need of a camera."""
    return PinholeView(
        np.ascontiguousarray(camera.camera_to_robot.T),
        np.array(camera.viewpoint_m),
        np.array(camera.focal_px, dtype=np.float64),
        np.array(camera.center_px, dtype=np.float64),
    )
