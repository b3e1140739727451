"""The final fit of a goal of a hue: whole rows across its posts, whole columns across its bar and down to its feet.

The camera follows from all sections at once, under the point spread that the picture itself shows (see
`kernels.goal.sections`). What each piece of an edge adds to that is a sample of the fit that the field's lines join.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.edge_places import goal_points
from robocup_vision.kernels.goal.sections import (
    BAR,
    BRIGHTNESS,
    CHANNELS,
    COLOR,
    LEVELS,
    MEMBERS,
    SHAPES,
    DueGoal,
    Response,
    SectionPicture,
    Sections,
    SectionSpread,
    fit_sections,
    gather_sections,
    spread_cost,
)
from robocup_vision.localization.goal.edges import FOOT_OFFSETS, EdgeAppearance, EdgeSamples, from_ideal
from robocup_vision.localization.goal.fit import GoalFit, GoalModel, fit, residuals
from robocup_vision.localization.goal.geometry import BAR_TOP, EDGES, LOG_FOCAL
from robocup_vision.localization.goal.point_spread import (
    HALVED,
    PER_PX,
    TYPICAL,
    PointSpread,
    nearest_best,
    step_response,
)

_BRIGHTNESS = (0.114, 0.587, 0.299)  # of B, G and R: the luma of BT.601
_SCALES = np.array([1.0, 0.5, 0.3, 0.3])  # of the robust loss in each iteration, pixels: the start is right to a pixel
_CELLS = 8  # of even light across a member; those at its edges are the narrowest
_STEPS = np.array([1e-4, 1e-4, 1e-5, 1e-5, 1e-5, 1e-4])  # of the camera for differences: metres, radians
_FIRST_STD = 3.0  # of a pixel's noise, grey levels, before it is estimated
_MIN_VARIANCE = 0.5  # of it: grey levels are whole
_OFFSETS = EDGES + 2  # what whole edges and feet are off
# pieces of a member, so that a hidden one is noticed, and most rows (bar: columns) of each
_PIECES = 6
_MAX_LINES = 8
# of background and of paint beside an edge: wider than the point spread
_OUTSIDE_PX = 3.0
_INSIDE_PX = 4.5
_CLEAR_OF_CORNERS_PX = 1.8  # distance from corners and feet that is left out: two members blur into each other there
_SATURATED = 246  # grey level from which a pixel is saturated
_LIGHT_STD = 30.0  # prior on how the paint's light changes across a member, grey levels
_ROUNDS = 3  # of the fit, the first with a typical point spread
# stride of the rows and columns taken for the point spread and for all steps but the last
_EVERY = 3
_CUT = 9.0  # ratio of squared residuals to their expectation at which a section has a quarter of its weight
# prior on an edge's move: the edges' fit is right to a pixel. All edges together move no farther.
_MOVE_STD_PX = 1.0
_MAX_STD_PX = 0.6  # noise from which a piece's edge is left out: it is less certain than the edges' fit
# common error of whole edges and feet, in addition to their noise
_EDGE_ERROR_PX = 0.03
_FOOT_ERROR_PX = 0.06
# fraction of a piece's variance that is common to its whole edge (feet: twice that), as measured on rendered goals
_COMMON = 0.5
# unknowns that the goal's edges determine, and the weight of the edges' own noise, in samples
_FREEDOM = 5
_TRUSTED = 2.0


class _Paint(NamedTuple):
    """Knots, jumps, numbers of levels and tightness of the paint's light, see `Response`."""

    knots: FloatArray
    jumps: FloatArray
    levels: Int64Array
    tightness: FloatArray


@lru_cache(maxsize=4)
def _paint(light_std: float) -> _Paint:
    """Light that is even, slopes, falls as on a lit cylinder, and has a terminator."""
    knots = (1 - np.cos(np.pi * np.arange(_CELLS + 1) / _CELLS)) / 2
    light = np.zeros((SHAPES, _CELLS + 2))
    for cell in range(_CELLS):
        xi = np.linspace(2 * knots[cell] - 1, 2 * knots[cell + 1] - 1, 41)
        shapes = (np.ones_like(xi), xi, np.sqrt(np.maximum(0.0, 1 - xi * xi)) - math.pi / 4, np.abs(xi) - 0.5)
        light[:, cell + 1] = [shape.mean() for shape in shapes]
    tightness = np.full(LEVELS, light_std**-2)
    tightness[: LEVELS - SHAPES + 1] = 1e-6
    # lamps hang above the bar, and a foot is no cylinder's side
    levels = LEVELS - np.array([1, 1, 0, 2, 2])
    return _Paint(knots, np.ascontiguousarray(np.diff(light, axis=1)), levels, tightness)


class _Due(NamedTuple):
    """Where cameras (N, 8) have the goal: edges, spans and arcs as `DueGoal` takes them, with a leading axis."""

    edges: FloatArray
    spans: FloatArray
    arcs: FloatArray


def _due(camera: PinholeCamera, model: GoalModel, p: FloatArray, clear_px: float) -> _Due | None:
    """Where cameras (N, 8) have the goal; None behind one of them."""
    points = np.empty((len(p), 2 * EDGES + 4 * len(FOOT_OFFSETS), 2))
    if not all(goal_points(model.scene, one, found) for one, found in zip(p, points, strict=True)):
        return None
    return _predicted(from_ideal(camera, points), clear_px)


class _SectionFit:
    """The sections of one picture, and the camera that fits them, from a start (8,) with an error below a pixel."""

    def __init__(
        self,
        image: UInt8Array,
        camera: PinholeCamera,
        model: GoalModel,
        start: FloatArray,
        appearance: EdgeAppearance,
    ) -> None:
        self._camera, self._model = camera, model
        self.p = np.concatenate([start, np.zeros(_OFFSETS)])
        due = _due(camera, model, start[None], _CLEAR_OF_CORNERS_PX)
        self.count = 0
        if due is None:
            return
        capacity = MEMBERS * _PIECES * _MAX_LINES * 2 + 40
        self.sections = Sections(
            np.empty((capacity * 14, CHANNELS + 1)),
            np.zeros(capacity + 1, np.int64),
            np.empty((capacity, 3)),
            np.empty(capacity, np.int64),
            np.empty(capacity, np.int64),
            np.empty(capacity, np.int64),
            np.empty(MEMBERS * _PIECES + 2),
        )
        picture = SectionPicture(image, np.array([appearance.towards, _BRIGHTNESS]), _SATURATED)
        spread = SectionSpread(_PIECES, _MAX_LINES, _OUTSIDE_PX, _INSIDE_PX)
        self.count = count = gather_sections(picture, DueGoal(*(part[0] for part in due)), spread, self.sections)
        self.kind, self.piece = self.sections.kind[:count], self.sections.piece[:count]
        self._line, self._axis = self.sections.line[:count].astype(np.float64), (self.kind >= BAR).astype(np.int64)
        self._spreads = [[TYPICAL] * CHANNELS, [TYPICAL] * CHANNELS]
        self._variance = np.full((2, CHANNELS), _FIRST_STD**2)
        self._few = [np.flatnonzero(self._axis == axis)[::_EVERY].copy() for axis in (0, 1)]
        self._line_evidence, self._misfit = np.empty((count, CHANNELS, 5)), np.empty((count, CHANNELS))
        weight = np.where(np.isinf(model.weight), 1e12, model.weight)
        errors = [_EDGE_ERROR_PX] * EDGES + [_FOOT_ERROR_PX] * 2
        self._weight = np.concatenate([weight, np.array(errors) ** -2])
        self._prior = np.concatenate([model.prior, np.zeros(_OFFSETS)])

    def fit(self) -> bool:
        """Fit noise, point spread and camera; whether that went well."""
        self._jacobian = self._differences()
        for step in range(_ROUNDS):
            if not self._place():
                return False
            if step == 1:
                self._choose()
            if not self._move(1 if step == _ROUNDS - 1 else _EVERY):
                return False
        return bool(np.isfinite(self.p).all())

    def samples(self) -> EdgeSamples | None:
        """Return each piece of an edge and each foot as a sample of the fit of a goal."""
        pieces = MEMBERS * _PIECES
        due = _due(self._camera, self._model, self.p[None, :8], _CLEAR_OF_CORNERS_PX)
        if due is None:
            return None
        by_piece = np.zeros((pieces + 2, 5))
        np.add.at(by_piece, self.piece, self._evidence)
        information = by_piece[:, [0, 2]] + _MOVE_STD_PX**-2
        move = by_piece[:, 3:] / information
        move[:pieces] += self.p[8 : 8 + EDGES].reshape(MEMBERS, 2).repeat(_PIECES, axis=0)
        move[pieces:, 1] += self.p[8 + EDGES :]
        variance = 1 / information
        variance[np.abs(move) > 2 * _MOVE_STD_PX] = np.inf
        edges, arcs = due.edges[0], due.arcs[0]
        at = self.sections.middle[:pieces, None]
        edge = 2 * np.repeat(np.arange(MEMBERS), _PIECES)[:, None] + [0, 1]
        slope = edges[edge, 1]
        across, along = edges[edge, 0] + slope * at + move[:pieces], np.broadcast_to(at, edge.shape)
        uv = np.where((edge < BAR_TOP)[..., None], np.stack([across, along], -1), np.stack([along, across], -1))
        square = variance[:pieces] / (1 + slope**2)
        good = (square < _MAX_STD_PX**2) & np.isfinite(along)
        left, right = (
            edges[first : first + 3 : 2, 0] + edges[first : first + 3 : 2, 1] * arcs[:, 0] for first in (0, 1)
        )
        steep = 2 * arcs[:, 1] / (right - left)
        direction = np.stack([-steep, np.ones(2)], axis=-1) / np.sqrt(1 + steep**2)[:, None]
        foot_uv = np.stack([(left + right) / 2, arcs[:, 0] + move[pieces:, 1]], axis=-1)
        foot_square = variance[pieces:, 1] / (1 + steep**2)
        stands = foot_square < _MAX_STD_PX**2
        return EdgeSamples(
            np.ascontiguousarray(edge[good]),
            np.ascontiguousarray(self._camera.ideal_pixels(uv[good])),
            np.flatnonzero(stands),
            np.full(int(stands.sum()), len(FOOT_OFFSETS) // 2),
            np.ascontiguousarray(self._camera.ideal_pixels(foot_uv[stands])),
            np.ascontiguousarray(direction[stands]),
            np.sqrt(np.concatenate([square[good], foot_square[stands]])),
            np.bincount(edge[np.isfinite(along)], minlength=EDGES),
        )

    def moved_px(self, before: FloatArray, after: FloatArray) -> float:
        """Return the root mean square of how far the sections' edges are between two cameras (8,), pixels."""
        first, last = self._places(np.array([before, after]))
        return float(np.sqrt(np.mean((last - first) ** 2)))

    def _places(self, p: FloatArray) -> FloatArray:
        """Where cameras (N, 8) have both edges of each section: (N, S, 2), pixels across."""
        due = _due(self._camera, self._model, p, _CLEAR_OF_CORNERS_PX)
        if due is None:
            return np.full((len(p), self.count, 2), np.nan)
        edges = due.edges.reshape(len(p), MEMBERS, 2, 2)[:, np.minimum(self.kind, BAR)]
        places = edges[..., 0] + edges[..., 1] * self._line[:, None]
        depth = _INSIDE_PX + _OUTSIDE_PX
        for post in (0, 1):
            row, foot = due.arcs[:, post, :1], self.kind == MEMBERS + post
            left, right = (due.edges[:, 2 * post + k, :1] + due.edges[:, 2 * post + k, 1:] * row for k in (0, 1))
            s = np.clip(2 * (self._line[foot] - left) / (right - left) - 1, -1, 1)
            places[:, foot, 1] = row + (due.arcs[:, post, 1:2] + due.arcs[:, post, 2:] * s) * s
            places[:, foot, 0] = places[:, foot, 1] - 2 * depth
        return places

    def _differences(self) -> FloatArray:
        """Differentiate (S, 2, 16) the edges' places by the camera and by what whole edges and feet are off."""
        by = np.zeros((self.count, 2, 8 + _OFFSETS))
        # where edges are due goes by the stated focal length
        free = np.flatnonzero(np.isfinite(self._model.weight[:LOG_FOCAL]))
        steps = np.eye(8)[free] * _STEPS[free, None]
        there = self._places(np.concatenate([self.p[:8] + steps, self.p[:8] - steps]))
        by[:, :, free] = np.moveaxis((there[: len(free)] - there[len(free) :]) / (2 * _STEPS[free, None, None]), 0, -1)
        index, is_foot = np.arange(self.count), self.kind >= MEMBERS
        by[index, 0, np.where(is_foot, 0, 8 + 2 * self.kind)] = 1
        by[index, 1, np.where(is_foot, 8 + EDGES - MEMBERS + self.kind, 9 + 2 * self.kind)] = 1
        by[is_foot, 0] = 0
        return by

    def _response(self, spread: PointSpread) -> Response:
        return Response(step_response(spread).reshape(-1, 2), float(PER_PX), *_paint(_LIGHT_STD))

    def _place(self) -> bool:
        """Let the sections' edges be where the camera has them now; False where it has none."""
        places = self._places(self.p[None, :8])[0] + self._jacobian[:, :, 8:] @ self.p[8:]
        self.sections.place[: self.count, 1:] = places
        return bool(np.isfinite(places).all())

    def _measure(self, every: int) -> FloatArray:
        """Return the evidence of sections with a stride on their edges' places by the present camera: (S, 5)."""
        a, b, c, d = (self._response(spread) for axis in self._spreads for spread in axis)
        fit_sections(self.sections, every, (a, b, c, d), self._variance, self._line_evidence, self._misfit)
        axis, misfit = self._axis[::every], self._misfit[::every]
        for one in (0, 1):
            if np.any(axis == one):
                typical = np.median(misfit[axis == one], axis=0) / 0.85
                self._variance[one] = np.maximum(typical, _MIN_VARIANCE)
        # a value that several pixels have in common counts once
        shared = np.array([[spread.shared for spread in spreads] for spreads in self._spreads])
        variance = self._variance[axis]
        weight = 1 / (variance * shared[axis] * (1 + misfit / (variance * _CUT)) ** 2)
        evidence = np.zeros((self.count, 5))
        evidence[::every] = (self._line_evidence[::every] * weight[:, :, None]).sum(axis=1)
        return evidence

    def _move(self, every: int) -> bool:
        """Move the camera by a step of Gauss and Newton; whether that went well."""
        self._evidence = evidence = self._measure(every)
        by_a, by_b = self._jacobian[:, 0], self._jacobian[:, 1]
        aa, ab, bb, ga, gb = evidence.T[:, :, None]
        mixed = (by_a * ab).T @ by_b
        normal = (by_a * aa).T @ by_a + (by_b * bb).T @ by_b + mixed + mixed.T
        normal[np.diag_indices(len(normal))] += self._weight + 1e-9
        right = (by_a * ga + by_b * gb).sum(axis=0) - self._weight * (self.p - self._prior)
        if not np.isfinite(normal).all():
            return False
        step = np.linalg.solve(normal, right)
        self.p = self.p + step
        # the evidence at the new place
        a, b = (self._jacobian @ step).T
        aa, ab, bb = evidence.T[:3]
        evidence[:, 3] -= aa * a + ab * b
        evidence[:, 4] -= ab * a + bb * b
        return True

    def _choose(self) -> None:
        """Choose for rows and for columns the point spread under which their sections fit best."""
        for axis, spreads in enumerate(self._spreads):
            whole = nearest_best(partial(self._cost, axis, BRIGHTNESS), TYPICAL)
            of_color = (whole, *(whole._replace(halved=kind) for kind in HALVED))
            spreads[BRIGHTNESS], spreads[COLOR] = whole, min(of_color, key=partial(self._cost, axis, COLOR))

    def _cost(self, axis: int, channel: int, spread: PointSpread) -> float:
        """How badly rows (0) or columns (1) fit under a point spread, as a negative log-likelihood."""
        variance, move_std_px = self._variance[axis, channel], _MOVE_STD_PX
        few, response = self._few[axis], self._response(spread)
        return float(spread_cost(self.sections, few, channel, response, variance, _MIN_VARIANCE, move_std_px))


def _predicted(points: FloatArray, clear_px: float) -> _Due:
    """Lines of the edges, free spans of the members and arcs of the feet from their points (N, K, 2)."""
    ends = points[:, : 2 * EDGES].reshape(-1, EDGES, 2, 2)
    ends = np.where((np.arange(EDGES) < BAR_TOP)[:, None, None], ends, ends[..., ::-1])  # across, along
    slope = (ends[..., 1, 0] - ends[..., 0, 0]) / (ends[..., 1, 1] - ends[..., 0, 1])
    edges = np.stack([ends[..., 0, 0] - slope * ends[..., 0, 1], slope], axis=-1)
    feet = points[:, 2 * EDGES : 2 * EDGES + 2 * len(FOOT_OFFSETS), 1].reshape(len(points), 2, -1)
    s = float(FOOT_OFFSETS[-1])
    low, middle, high = feet[..., 0], feet[..., len(FOOT_OFFSETS) // 2], feet[..., -1]
    arcs = np.stack([middle, (high - low) / (2 * s), (high + low - 2 * middle) / (2 * s * s)], axis=-1)
    under_bar = points[:, 2 * EDGES - 2 : 2 * EDGES]
    spans = np.empty((len(points), MEMBERS, 2))
    spans[:, :2, 0], spans[:, :2, 1] = under_bar[..., 1] + clear_px, feet.min(axis=-1) - clear_px
    spans[:, 2, 0], spans[:, 2, 1] = under_bar[:, 0, 0] + clear_px, under_bar[:, 1, 0] - clear_px
    return _Due(edges, spans, arcs)


def polish(
    image: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    model: GoalModel,
    found: GoalFit,
    appearance: EdgeAppearance,
) -> GoalFit:
    """Fit the sections of a BGR frame from the edges' fit; return that unchanged where they do not confirm it."""
    sections = _SectionFit(image, camera, model, found.unknowns, appearance)
    measured = sections.samples() if sections.count and sections.fit() else None
    if measured is None or len(np.unique(measured.edge)) < EDGES:
        return found
    samples, single = _with_feet(*_weighed(measured), found.samples)
    p, cost, information = fit(model, samples, sections.p[:8], _SCALES)
    if not (math.isfinite(cost) and sections.moved_px(found.unknowns, p) < _MOVE_STD_PX):
        return found
    residual = residuals(model, samples, p)
    # the residuals of the fit estimate the error of each whole edge
    square = np.minimum((residual / samples.sigma) ** 2, 9 * single / samples.sigma**2).sum()
    due = max(float((single / samples.sigma**2).sum()) - _FREEDOM, 1.0)
    excess = (float(square) + _TRUSTED) / (due + _TRUSTED)
    samples = replace(samples, sigma=samples.sigma * math.sqrt(excess))
    return replace(found, unknowns=p, information=information / excess, samples=samples, residual_px=residual)


def _weighed(measured: EdgeSamples) -> tuple[EdgeSamples, npt.NDArray[np.float64]]:
    """Add the common errors of whole edges to the noise; also return the variance of each single sample."""
    n = len(measured.edge)
    typical = _COMMON * float(np.mean(measured.sigma[:n] ** 2))
    whole = np.full(len(measured.sigma), _EDGE_ERROR_PX**2 + typical)
    whole[n:] = _FOOT_ERROR_PX**2 + 2 * typical
    per_edge = np.bincount(measured.edge, minlength=EDGES)[measured.edge]
    shared = whole * np.concatenate([per_edge, np.ones(len(measured.foot_post))])
    return replace(measured, sigma=np.sqrt(measured.sigma**2 + shared)), measured.sigma**2 + whole


def _with_feet(
    samples: EdgeSamples, single: npt.NDArray[np.float64], other: EdgeSamples
) -> tuple[EdgeSamples, npt.NDArray[np.float64]]:
    """Add the feet that `measure` found, whose errors are of another kind; `other` is weighed already."""
    sigma = other.sigma[len(other.edge) :]
    per_foot = np.bincount(other.foot_post, minlength=2)[other.foot_post]
    joined = replace(
        samples,
        foot_post=np.concatenate([samples.foot_post, other.foot_post]),
        foot_at=np.concatenate([samples.foot_at, other.foot_at]),
        foot_uv=np.vstack([samples.foot_uv, other.foot_uv]),
        foot_direction=np.vstack([samples.foot_direction, other.foot_direction]),
        sigma=np.concatenate([samples.sigma, sigma]),
    )
    return joined, np.concatenate([single, sigma**2 / per_foot])
