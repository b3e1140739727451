"""Solves the gate problem: drive through a gap that may be too narrow, take a free detour, or look first, and where.

Miura (2004), section 5, with the cost
C*(x, I) = min(detour, pass if confirmed, min over x' of C_move + C_look + sum_k P(I_k) C*(x', I_k)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.checks import as_positive, require_at_least, require_not_negative, require_positive
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.kernels.motion import gate_problem
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.normal import normal_below
from robocup_vision.planning.gaps.gap_choice import Gap, Point, WidthSensor

# number of cells of the width's distribution, and standard deviations that they cover to either side. A finer
# discretisation does not change the plans; nor does it for the next constant.
_WIDTHS, _SPREAD_SIGMAS = 32, 4.0
# bounds between the classes of a measured width: its difference from the needed width in standard deviations
_MEASURED_AT_SIGMAS = (-2.0, -1.0, 0.0, 1.0, 2.0)
# viewpoints form a grid over the triangle of robot, gap and detour, with this many steps per side
_GRID_STEPS = 5


@dataclass(frozen=True, slots=True)
class GatePlannerSettings:
    """The costs and the horizon of `GatePlanner`.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    confirmed: float = 0.95  #: probability of being wide enough from which a gap may be entered
    look_s: float = 0.2  #: time that a look takes while standing: a few frames
    #: cost of entering a gap that is too narrow, besides the way to it and back: contact, stopping, turning
    failure_s: float = 2.0
    looks: int = 3  #: horizon: greatest number of looks in a plan; after each look a new plan is made

    def __post_init__(self) -> None:
        require_positive(self, "look_s")
        if not 0.5 <= self.confirmed < 1.0:
            raise ArgumentError(f"confirmed must be from 0.5 to below 1, got {self.confirmed!r}")
        require_not_negative(self, "failure_s")
        require_at_least(self, 1, "looks")


@dataclass(frozen=True, slots=True)
class GatePlan:
    """A decision about a gap."""

    action: Literal["detour", "pass", "look"]  #: take the detour, pass the gap, or look
    viewpoint_m: Point | None  #: where to look from; None unless that is the action
    expected_s: float  #: expected time to the target
    #: expected times of simpler plans: the detour at once; one look from here, or one from before the gap, and then the
    #: better of the gap, if confirmed, and the detour
    detour_s: float
    look_now_s: float
    go_and_look_s: float
    probability: float  #: probability that the gap is wide enough, by the present estimate
    beliefs: int  #: number of beliefs that the search has evaluated
    reason: str  #: the reason, as text


@dataclass(frozen=True, slots=True, eq=False)
class GateTables:
    """The gate problem in numbers, as `robocup_vision.kernels.motion.gate_problem` takes them."""

    viewpoints_m: FloatArray  #: (N, 2) float64: places to look from: first the robot's, second one before the gap
    prior: FloatArray  #: (W,) float64: probability of each cell of width
    first_wide: int  #: index of the first cell that is wide enough
    likelihood: FloatArray  #: (N, K, W) float64: probability of each class of measured width
    move_s: FloatArray  #: (N, N) float64: seconds between viewpoints
    #: (N,) float64: seconds to the target through a wide gap, by a narrow one and back, and by the detour
    pass_s: FloatArray
    fail_s: FloatArray
    detour_s: FloatArray


class GatePlanner:
    """Plans for gaps; it depends only on the robot, so one object serves all gaps.

    Parameters
    ----------
    sensor : WidthSensor
        The robot's accuracy in measuring widths.
    needed_m : float
        Width that a gap must have: the robot's width and its clearance.

    Raises
    ------
    ArgumentError
        An argument is out of its range.
    """

    def __init__(
        self,
        limits: MotionLimits,
        sensor: WidthSensor,
        needed_m: float,
        settings: GatePlannerSettings = GatePlannerSettings(),
    ) -> None:
        self._limits, self._sensor, self._settings = limits, sensor, settings
        self._needed_m = as_positive("needed_m", needed_m)
        prepare("planning")

    def plan(
        self,
        robot_m: Point,
        gap: Gap,
        target_m: Point,
        detour_m: Sequence[Point],
        viewpoints_m: FloatArray | None = None,
    ) -> GatePlan:
        """Decide what to do now. Call it again after each look, and as the opponents move.

        Parameters
        ----------
        robot_m, target_m : (float, float)
            Positions of the robot and its target, in the gap's frame; the robot starts and arrives at rest.
        detour_m : sequence of (float, float)
            Waypoints of the detour, without robot and target.
        viewpoints_m : (N, 2) float64, optional
            Viewpoints besides the robot's position and a place right before the gap; by default a grid between robot,
            gap and detour.
        """
        tables = self.tables(robot_m, gap, target_m, detour_m, viewpoints_m)
        belief = np.empty((self._settings.looks + 1, len(tables.prior)))
        belief[0] = tables.prior
        counted = np.ones(1, dtype=np.int64)
        problem = gate_problem.GateProblem(
            tables.first_wide, tables.likelihood, tables.move_s, self._settings.look_s,
            tables.pass_s, tables.fail_s, tables.detour_s, self._settings.confirmed,
        )  # fmt: skip
        expected, action = gate_problem.search(belief, 0, 0, math.inf, problem, counted)
        probability = float(tables.prior[tables.first_wide :].sum())
        detour_s = float(tables.detour_s[0])
        known = f"gap {gap.width_m:.2f} m, sigma {gap.sigma_m:.2f} m"
        viewpoint: Point | None = None
        chosen: Literal["detour", "pass", "look"]
        if action == gate_problem.DETOUR:
            chosen, reason = "detour", f"detour {detour_s:.1f} s: {known}, no look is worth its time"
        elif action == gate_problem.PASS:
            chosen, reason = "pass", f"through the gap: {known}, {100 * probability:.0f} % wide enough"
        else:
            x, y = tables.viewpoints_m[action].tolist()
            chosen, viewpoint = "look", (x, y)
            where = "from here" if action == 0 else f"from ({x:.2f}, {y:.2f})"
            reason = f"look {where}: {known}, expected {expected:.1f} s, detour {detour_s:.1f} s"
        return GatePlan(
            chosen, viewpoint, float(expected), detour_s, self._one_look_s(tables, 0), self._one_look_s(tables, 1),
            probability, int(counted[0]), reason,
        )  # fmt: skip

    def tables(
        self,
        robot_m: Point,
        gap: Gap,
        target_m: Point,
        detour_m: Sequence[Point],
        viewpoints_m: FloatArray | None = None,
    ) -> GateTables:
        """Return the problem in numbers; parameters as those of `plan`."""
        robot, target, center = (np.array(p, dtype=np.float64) for p in (robot_m, target_m, gap.center_m))
        way = np.array(detour_m, dtype=np.float64).reshape(-1, 2)
        if not (np.isfinite([robot, target, center]).all() and np.isfinite(way).all()):
            raise ArgumentError("robot, target, gap and detour must be finite")
        if not len(way):
            raise ArgumentError("detour_m must have at least one point")
        # right before the gap, on the robot's side
        normal = np.array([math.cos(gap.across_rad), math.sin(gap.across_rad)])
        side = -1.0 if (center - robot) @ normal >= 0.0 else 1.0
        before = center + side * self._needed_m * normal
        more = _between(robot, before, way[0]) if viewpoints_m is None else np.asarray(viewpoints_m, dtype=np.float64)
        if more.ndim != 2 or more.shape[1] != 2 or not np.isfinite(more).all():
            raise ArgumentError(f"viewpoints_m must be (N, 2) and finite, got {more.shape}")
        places = np.vstack([robot, before, more])
        to_gap = np.hypot(*(places - center).T)
        to_way = np.hypot(*(places - way[0]).T)
        # from the detour's first point on, from the gap on, and from the gap back into the detour
        after_way = _length(np.vstack([way, target]))
        after_gap = float(np.hypot(*(target - center)))
        back = float(np.hypot(*(way[0] - center))) + after_way
        travel = self._limits.travel_s
        pass_s, detour_s = (
            np.array([travel(d + rest) for d in away])
            for away, rest in ((to_gap.tolist(), after_gap), (to_way.tolist(), after_way))
        )
        fail_s = np.array([travel(d) for d in to_gap.tolist()]) + self._settings.failure_s + travel(back)
        apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
        move_s = np.array([[travel(d) for d in row] for row in apart.tolist()])
        sigma = [
            self._sensor.sigma_m(gap, (float(x), float(y)), travel(d))
            for (x, y), d in zip(places.tolist(), to_gap.tolist(), strict=True)
        ]
        widths, prior, first_wide = _width_cells(gap, self._needed_m)
        edges = self._needed_m + np.multiply.outer(sigma, _MEASURED_AT_SIGMAS)
        below = normal_below((edges[:, :, None] - widths) / np.array(sigma)[:, None, None])
        ends = np.zeros((len(places), 1, len(widths)))
        likelihood = np.diff(np.concatenate([ends, below, ends + 1.0], axis=1), axis=1)
        return GateTables(places, prior, first_wide, likelihood, move_s, pass_s, fail_s, detour_s)

    def _one_look_s(self, tables: GateTables, place: int) -> float:
        joint = tables.prior * tables.likelihood[place]
        narrow, wide = joint[:, : tables.first_wide].sum(axis=1), joint[:, tables.first_wide :].sum(axis=1)
        mass = narrow + wide
        cost = mass * tables.detour_s[place]
        through = wide * tables.pass_s[place] + narrow * tables.fail_s[place]
        cost = np.where(wide >= self._settings.confirmed * mass, np.minimum(cost, through), cost)
        return float(tables.move_s[0, place] + self._settings.look_s + cost.sum())


def _between(robot: FloatArray, gap: FloatArray, detour: FloatArray) -> FloatArray:
    steps = _GRID_STEPS
    corners = ((0, 0), (steps, 0))
    places = [(i, j) for i in range(steps + 1) for j in range(steps + 1 - i) if (i, j) not in corners]
    to_gap, to_detour = np.array(places, dtype=np.float64).T / steps
    return np.asarray(robot + np.multiply.outer(to_gap, gap - robot) + np.multiply.outer(to_detour, detour - robot))


def _length(points: FloatArray) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def _width_cells(gap: Gap, needed_m: float) -> tuple[FloatArray, FloatArray, int]:
    """Return centres and probabilities of the width's cells, split at the needed width, and the first cell above it."""
    spread_m = _SPREAD_SIGMAS * gap.sigma_m
    edges = np.linspace(gap.width_m - spread_m, gap.width_m + spread_m, _WIDTHS + 1)
    edges = np.sort(np.append(edges, np.clip(needed_m, edges[0], edges[-1])))
    middles = 0.5 * (edges[1:] + edges[:-1])
    mass = np.diff(normal_below((edges - gap.width_m) / gap.sigma_m))
    return middles, mass / mass.sum(), int(np.searchsorted(middles, needed_m))
