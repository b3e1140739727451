"""Proposes cameras by a goal's silhouette, where paint alone does not show the goal.

Lamps wash posts white, clutter of their hue touches them, windows shine behind the bar. What remains are edges, of some
step of light or colour, along most of the silhouette, and some paint. Every place on the pitch from which the whole
goal can be seen is tried, with every heading and tilt, in a small picture; the likeliest cameras are settled in the
whole one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.picture import GoalScene
from robocup_vision.kernels.goal.silhouettes import (
    Cameras,
    Evidence,
    Int32Array,
    mark_edges,
    score_places,
    settle,
    silhouette_nats,
    strongest_gradients,
)
from robocup_vision.localization.distinct import Apart
from robocup_vision.localization.goal.edges import from_ideal
from robocup_vision.localization.goal.fit import GoalModel
from robocup_vision.localization.goal.geometry import HEADING, HEIGHT, ROLL, TILT, UNKNOWNS, X, Y

_DIRECTIONS = 4
# of a cell's 255, what makes it painted
_MIN_PAINT = 75
_WIDTH_CELLS = 104  # of the small picture: the posts of the farthest goal are two cells wide there
# steps of the bank, by how far each moves ends of the silhouette: edges may lie a cell or two beside it
_PLACE_CELLS = 3.0
_TILT_CELLS = 2.9
_COLUMN_CELLS = 1.5
_LARGE_RATIO = 0.5  # goals wider than this fraction of a picture are searched in one of half the size
_BLUR_PX = 0.8  # blur before gradients are taken: no edge is sharper, but noise is
_EDGE_RATIO = 4.0  # ratio of an edge's gradient to the picture's median gradient
# fraction of a goal's silhouette with an edge exactly there, and of that with one in a neighbouring cell instead
_SEEN_RATIO = 0.4
_PAINTED_RATIO = 0.5  # fraction of posts and bar that has kept its hue
_PROPOSED = 20  # cameras that are settled and proposed
_APART = Apart(0.1, 0.03)  # of two cameras


@dataclass(frozen=True, slots=True, eq=False)
class _Bank:
    """Cameras, the view of a picture of cells, and how many pixels each of these has along a side."""

    cell_px: int
    scene: GoalScene
    cameras: Cameras


class Edges(NamedTuple):
    """Edges of a picture, and their evidence: the first two of `kernels.goal.silhouettes.Evidence`."""

    levels: UInt8Array
    nats: FloatArray


class Gradients(NamedTuple):
    """Differences (H, W) int32 along rows and down columns, and their least square at an edge."""

    along: Int32Array
    down: Int32Array
    least: float


class SilhouetteSearch:
    """Proposes cameras that see a goal's silhouette, at |x|, |y| up to `extent_m` (2,)."""

    def __init__(
        self,
        model: GoalModel,
        camera: PinholeCamera,
        extent_m: FloatArray,
    ) -> None:
        self._camera = camera
        self._model = model
        self._extent_m = extent_m
        self._scene = GoalScene(model.scene.shape, model.scene.camera, np.empty(0))

    @cached_property
    def _banks(self) -> tuple[_Bank, ...]:
        """Every camera whose picture would hold the whole goal; those near it by a picture of half the size."""
        shape, focal_px = self._model.shape, self._camera.focal_px[0]
        farthest = math.hypot(shape.line_x_m + self._extent_m[0], self._extent_m[1])
        # nearer the posts do not fit into the picture
        nearest = shape.width_m * focal_px / self._camera.size_px[0] / 2
        cell_px = max(1, round(self._camera.size_px[0] / _WIDTH_CELLS))
        between = shape.width_m * focal_px / (_LARGE_RATIO * self._camera.size_px[0])
        between = min(max(between, nearest), farthest)
        return self._bank(2 * cell_px, nearest, between), self._bank(cell_px, between, farthest)

    def _bank(self, cell_px: int, nearest_m: float, farthest_m: float) -> _Bank:
        shape, prior, weight = self._model.shape, self._model.prior, self._model.weight
        view = np.array([*self._camera.focal_px, *(np.array(self._camera.center_px) + 0.5)]) / cell_px
        view[2:] -= 0.5
        columns, rows = (side / cell_px for side in self._camera.size_px)
        away, places = nearest_m, [np.empty((0, 2))]
        while away < farthest_m:
            step = _PLACE_CELLS / (view[0] * shape.width_m / away)
            count = math.ceil(math.pi / (2 * step))
            turned = (np.arange(1, count) / count - 0.5) * math.pi
            places.append(np.stack([shape.line_x_m - away * np.cos(turned), away * np.sin(turned)], axis=-1))
            away *= 1.0 + step
        place = np.concatenate(places)
        place = place[np.all(np.abs(place) <= self._extent_m, axis=1)]
        # a bar over the horizon and feet below it leave the axis within half a view of it
        high = math.atan(rows / 2 / view[1])
        low = -high
        if weight[TILT] > 0:
            spread = 3.0 / math.sqrt(float(weight[TILT]))
            low, high = max(low, float(prior[TILT]) - spread), min(high, float(prior[TILT]) + spread)
        tilts = np.linspace(low, high, max(math.ceil((high - low) * view[1] / _TILT_CELLS), 1) + 1)
        across = np.arange(0.0, columns, _COLUMN_CELLS)
        cameras = Cameras(np.ascontiguousarray(place), tilts, across, float(prior[ROLL]), float(prior[HEIGHT]))
        return _Bank(cell_px, self._scene._replace(camera=view), cameras)

    @cached_property
    def _ideal_px(self) -> tuple[FloatArray, FloatArray] | None:
        """Where a lens without distortion would show each pixel, for `cv2.remap`; None for such a lens."""
        if not self._camera.is_bent:
            return None
        width, height = self._camera.size_px
        grid = np.stack(np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)), axis=-1)
        u, v = np.moveaxis(from_ideal(self._camera, grid), -1, 0).astype(np.float32)
        return u, v

    def picture(self, frame: UInt8Array) -> UInt8Array:
        """Return the frame as a lens without distortion would show it: `propose` takes masks of this one."""
        if self._ideal_px is None:
            return frame
        return np.asarray(cv2.remap(frame, *self._ideal_px, cv2.INTER_LINEAR), np.uint8)

    def gradients(self, picture: UInt8Array) -> Gradients:
        """Differentiate a picture."""
        height, width = picture.shape[:2]
        along, down = np.empty((2, height, width), np.int32)
        channels = np.asarray(cv2.split(cv2.GaussianBlur(picture, (0, 0), _BLUR_PX)), np.uint8)
        strongest_gradients(channels, along, down)
        # every fourth pixel each way: the median of a picture needs no more
        square = along[::4, ::4] ** 2 + down[::4, ::4] ** 2
        return Gradients(along, down, _EDGE_RATIO**2 * float(np.median(square)))

    def edges(self, gradients: Gradients, cell_px: int = 1) -> Edges:
        """Mark edges in a picture of cells so wide."""
        height, width = gradients.along.shape
        levels = np.zeros((height // cell_px, width // cell_px), np.uint8)
        mark_edges(*gradients, cell_px, levels)
        return Edges(levels, self._edge_nats(levels))

    def propose(self, gradients: Gradients, paint: UInt8Array, carpet: UInt8Array) -> list[tuple[float, FloatArray]]:
        """Propose cameras: evidence and unknowns (8,), the likeliest first; the masks (H, W) may be of reduced size."""
        likely: list[tuple[float, float, float, FloatArray]] = []
        whole = self.edges(gradients)
        for bank in self._banks:
            seen = self.edges(gradients, bank.cell_px)
            found = np.empty((len(bank.cameras.places_m), 4))
            score_places(bank.scene, self.evidence(seen, paint, carpet), bank.cameras, found)
            for place in np.argsort(-found[:, 0], kind="stable")[:_PROPOSED].tolist():
                nats, heading, tilt, of_paint = found[place].tolist()
                p = np.array([*bank.cameras.places_m[place], heading, tilt, bank.cameras.roll_rad])
                likely.append((nats, of_paint, float(bank.cell_px), p))
        likely.sort(key=lambda one: -one[0])
        height = float(self._model.prior[HEIGHT])
        settled = [
            (of_paint + settle(self._scene, *whole, height, step_px, p), p)
            for nats, of_paint, step_px, p in likely[:_PROPOSED]
            if math.isfinite(nats)
        ]
        settled.sort(key=lambda one: -one[0])
        proposed: list[tuple[float, FloatArray]] = []
        for k in _APART.first(np.array([p[:3] for _, p in settled]).reshape(-1, 3), _PROPOSED):
            nats, p = settled[k]
            unknowns = np.zeros(UNKNOWNS)
            unknowns[[X, Y, HEADING, TILT, ROLL]] = p
            unknowns[HEIGHT] = height
            proposed.append((nats, unknowns))
        return proposed

    def nats(self, seen: Evidence, unknowns: FloatArray) -> float:
        """Evidence that a whole picture shows the goal where a camera (8,) has it; minus infinity behind the camera."""
        return float(silhouette_nats(self._scene, seen, unknowns))

    def evidence(self, edges: Edges, paint: UInt8Array, carpet: UInt8Array) -> Evidence:
        """Weigh edges, paint and carpet of a picture; the masks may be of another size than the edges."""
        rows, columns = edges.levels.shape
        size = (columns, rows)
        painted = cv2.resize(paint, size, interpolation=cv2.INTER_AREA) > _MIN_PAINT
        background = min(max(float(painted.mean()), 0.02), _PAINTED_RATIO)
        ratios = _PAINTED_RATIO / background, (1 - _PAINTED_RATIO) / (1 - background)
        of_paint, of_others = np.log(ratios).astype(np.float32)
        nats = np.where(painted, of_paint, of_others)
        green = np.asarray(cv2.resize(carpet, size, interpolation=cv2.INTER_NEAREST), np.uint8)
        return Evidence(*edges, nats, green)

    def _edge_nats(self, levels: UInt8Array) -> FloatArray:
        """(4, 3) float64: see `kernels.goal.silhouettes.Evidence`; clutter has the picture's mean rates."""
        of_goal = np.array([1 - 2 * _SEEN_RATIO, _SEEN_RATIO, _SEEN_RATIO])
        nats = np.empty((_DIRECTIONS, 3))
        for direction in range(_DIRECTIONS):
            there = np.count_nonzero(levels & (1 << direction)) / levels.size
            nearby = np.count_nonzero(levels & (16 << direction)) / levels.size - there
            background = np.maximum([1 - there - nearby, nearby, there], 0.01)
            nats[direction] = np.log(of_goal / background)
        return nats
