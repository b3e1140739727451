"""Gaps of estimated width between two opponents: the expected time to pass one, and the choice between several.

Miura (2004), section 6.2: E[T] = sum over widths of p(w) T(w), with T(w) at the largest safe speeds. The time at
the mean width would be too short, since some of the possible widths are slow or blocked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.checks import as_positive, require_positive
from robocup_vision.disc import Disc
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.motion import path_following as kernel
from robocup_vision.normal import normal_below
from robocup_vision.planning.speed.speed_planner import SpeedPlanner

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Gap:
    """An opening of uncertain width."""

    center_m: Point  #: its middle
    across_rad: float  #: direction of passing, or its opposite; the opening is perpendicular to it
    #: mean and standard deviation of the estimated width: a normal distribution
    width_m: float
    sigma_m: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.width_m):
            raise ArgumentError(f"width_m must be finite, got {self.width_m!r}")
        require_positive(self, "sigma_m")

    def updated(self, width_m: float, sigma_m: float) -> Gap:
        """Return the gap updated by another measurement of its width."""
        gain = self.sigma_m**2 / (self.sigma_m**2 + sigma_m**2)
        width = self.width_m + gain * (width_m - self.width_m)
        return Gap(self.center_m, self.across_rad, width, self.sigma_m * math.sqrt(1.0 - gain))

    def wide_enough(self, needed_m: float) -> float:
        """Return the probability that the gap is at least this wide."""
        return float(normal_below((self.width_m - needed_m) / self.sigma_m))


def gap_between(first: Disc, second: Disc) -> Gap:
    """Return the gap between two opponents: free width between their edges along the line of their centres.

    Parameters
    ----------
    first, second : Disc
        The opponents, in the same frame; their errors are assumed to be independent.

    Raises
    ------
    ArgumentError
        Their centres coincide.
    """
    dx, dy = second.x_m - first.x_m, second.y_m - first.y_m
    apart = math.hypot(dx, dy)
    if not apart > 0.0:
        raise ArgumentError(f"a gap needs two places, got {(first.x_m, first.y_m)} twice")
    unit = np.array([dx, dy]) / apart
    variance = float(unit @ (first.covariance + second.covariance) @ unit)
    edge_m = 0.5 * (first.radius_m + apart - second.radius_m)
    center = (first.x_m + unit[0] * edge_m, first.y_m + unit[1] * edge_m)
    width = apart - first.radius_m - second.radius_m
    return Gap((float(center[0]), float(center[1])), math.atan2(-dx, dy), width, max(math.sqrt(variance), 1e-6))


@dataclass(frozen=True, slots=True)
class WidthSensor:
    """The accuracy of measuring a gap's width by one look: best from near and from straight ahead.

    The camera measures the feet of two opponents, each to `angle_rad` in bearing and in depression. At distance d and
    from height h that is d * angle across the line of sight and (d^2 + h^2) / h * angle along it (the floor range is
    h / tan of the depression). With an angle phi between the line of sight and the gap's normal, the errors of both
    edges add up to sigma^2 = 2 angle^2 ((d cos phi)^2 + ((d^2 + h^2) / h sin phi)^2) + edge^2. Until the robot gets
    there the opponents may have moved: + (drift * t)^2.
    """

    angle_rad: float = 0.01  #: standard deviation of an edge's direction: about a pixel's angle, radians
    height_m: float = 0.2  #: height of the camera above the floor
    edge_m: float = 0.01  #: standard deviation that remains at a short distance (shape of the opponents' feet)
    drift_mps: float = 0.0  #: standard deviation of the unknown speed at which the gap widens or closes

    def __post_init__(self) -> None:
        require_positive(self, "angle_rad", "height_m", "edge_m")
        if not self.drift_mps >= 0.0:
            raise ArgumentError(f"drift_mps must not be negative, got {self.drift_mps!r}")

    def sigma_m(self, gap: Gap, eye_m: Point, until_s: float = 0.0) -> float:
        """Return the standard deviation, measured from `eye_m`, of the width that the gap will have after `until_s`."""
        dx, dy = gap.center_m[0] - eye_m[0], gap.center_m[1] - eye_m[1]
        distance = math.hypot(dx, dy)
        phi = math.atan2(dy, dx) - gap.across_rad
        across = distance * math.cos(phi)
        along = (distance**2 + self.height_m**2) / self.height_m * math.sin(phi)
        return math.sqrt(
            2.0 * self.angle_rad**2 * (across**2 + along**2) + self.edge_m**2 + (self.drift_mps * until_s) ** 2
        )


# narrowest and widest gap in the table, in robot widths, and number of entries. In the widest, a robot drives at
# full speed.
_MIN_WIDTH = 1.0
_MAX_WIDTH = 6.0
_WIDTHS = 41
# distance before and after a gap that counts as its passage; beyond it a robot drives at full speed
_WAY_M = 1.5
_MAX_S = 30.0  # a drive that takes longer is given up, and counts as blocked
_PLAN_EVERY = 3  # commands between two plans of the speed
# number of cells of the width's distribution, and the standard deviations that they cover to either side
_CELLS = 61
_SPREAD_SIGMAS = 3.5
# number of gaps that are considered after one has turned out blocked. Each is reached only if all before are blocked,
# so more do not change the choice.
_MAX_ALTERNATIVES = 3


class PassageTimes:
    """The time that a gap costs, by its width: a table of simulated drives with the real planner and controller.

    Parameters
    ----------
    opponent_radius_m : float
        Radius of the robots beside the gap.
    opponent_sigma_m : float
        Standard deviation of an opponent's position when the robot gets there.
    """

    def __init__(
        self,
        planner: SpeedPlanner,
        opponent_radius_m: float,
        opponent_sigma_m: float,
    ) -> None:
        self.planner = planner
        # the standard normal distribution in cells of equal width
        edges = np.linspace(-_SPREAD_SIGMAS, _SPREAD_SIGMAS, _CELLS + 1)
        self._at_sigmas = 0.5 * (edges[1:] + edges[:-1])
        mass = np.diff(normal_below(edges))
        self._probability = mass / mass.sum()
        self._radius_m = as_positive("opponent_radius_m", opponent_radius_m)
        self._sigma_m = as_positive("opponent_sigma_m", opponent_sigma_m)
        widths = np.linspace(_MIN_WIDTH, _MAX_WIDTH, _WIDTHS) * 2 * planner.robot_radius_m
        open_s = self._drive_s(None)
        extra = np.array([self._drive_s(width) - open_s for width in widths.tolist()])
        # a wider gap is never slower; where a simulated drive was, that is due to the phase of its looks
        self._widths_m, self._extra_s = read_only(widths), read_only(np.minimum.accumulate(extra))

    @property
    def narrowest_m(self) -> float:
        """The narrowest width in the table that has a safe speed; inf if none has."""
        passable = np.isfinite(self._extra_s)
        return float(self._widths_m[np.argmax(passable)]) if passable.any() else math.inf

    def extra_s(self, width_m: float) -> float:
        """Return the seconds that a gap of this width costs beyond the open floor; inf: there is no safe speed."""
        if width_m < self.narrowest_m:
            return math.inf
        passable = np.isfinite(self._extra_s)
        return float(np.interp(width_m, self._widths_m[passable], self._extra_s[passable]))

    def expected_s(self, gap: Gap, way_m: float, blocked_s: float) -> float:
        """Return the expected time E[T] over the widths that the gap may have.

        Parameters
        ----------
        way_m : float
            Length of the way through the gap to the target.
        blocked_s : float
            Total time if the gap turns out to have no safe speed: to the gap, back, and along another way.
        """
        widths = gap.width_m + gap.sigma_m * self._at_sigmas
        open_s = self.planner.follower.limits.travel_s(way_m)
        passable = np.isfinite(self._extra_s)
        times = np.interp(widths, self._widths_m[passable], open_s + self._extra_s[passable])
        times = np.where(widths < self.narrowest_m, blocked_s, times)
        return float(self._probability @ times)

    def _drive_s(self, width_m: float | None) -> float:
        """Return the time of a drive without errors, at speeds that allow for errors; inf if it takes too long."""
        planner, radius = self.planner, self._radius_m
        path = np.array([[-_WAY_M, 0.0], [_WAY_M, 0.0]])
        spread = self._sigma_m**2 * np.eye(2)
        discs = [] if width_m is None else [Disc(0.0, s * (0.5 * width_m + radius), radius, spread) for s in (-1, 1)]
        limits = planner.follower.limits
        every = max(1, round(planner.look_period_s / planner.period_s))
        look = np.asarray(planner.noise.look_covariance)
        place, velocity, asked = (-_WAY_M, 0.0), (0.0, 0.0), (0.0, 0.0)
        covariance, seen, speed = look, place, 0.0
        for step in range(int(_MAX_S / planner.period_s)):
            if step % every == 0:
                covariance, seen = look, place
            if step % _PLAN_EVERY == 0 or step % every == 0:
                left_s = (every - step % every) * planner.period_s
                speed = planner.plan(
                    path, Pose2(*place, 0.0), covariance, velocity, discs, asked, until_look_s=left_s
                ).speed_mps
            target = kernel.follow(path, place, speed, planner.follower.ahead(speed), limits.acceleration_mps2)
            place, velocity = kernel.drive(
                place, velocity, asked, target, limits.acceleration_mps2, limits.dead_time_s, planner.period_s
            )
            asked = target
            if place[0] > _WAY_M - 0.02:
                return (step + 1) * planner.period_s
            covariance = grown(look, planner, (place[0] - seen[0], place[1] - seen[1]))
        return math.inf


def grown(covariance: FloatArray, planner: SpeedPlanner, moved_m: Point) -> FloatArray:
    """Return the covariance (3, 3) of a pose after a move by odometry, field frame."""
    xx, xy, yy = kernel.spread(covariance, (planner.noise.along, planner.noise.aside), moved_m)
    after = np.array(covariance)
    after[:2, :2] = [[xx, xy], [xy, yy]]
    after[0, 2] = after[2, 0] = covariance[0, 2] - moved_m[1] * covariance[2, 2]
    after[1, 2] = after[2, 1] = covariance[1, 2] + moved_m[0] * covariance[2, 2]
    return after


@dataclass(frozen=True, slots=True)
class GapChoice:
    """The gap to take."""

    index: int  #: index of the gap, in the order given
    expected_s: tuple[float, ...]  #: expected time to the target through each gap
    reason: str  #: in words


def choose_gap(times: PassageTimes, robot_m: Point, target_m: Point, gaps: Sequence[Gap]) -> GapChoice:
    """Choose the gap with the shortest expected time. If it turns out blocked, the robot takes the best of the others.

    Parameters
    ----------
    times : PassageTimes
        The time that gaps cost, by their width.
    robot_m, target_m : (float, float)
        Positions of the robot and of its target, in the gaps' frame.
    gaps : sequence of Gap
        At least one. If all are blocked, the robot waits for as long as the table's longest drive.
    """
    if not gaps:
        raise ArgumentError("there must be at least one gap")
    expected = [_by_gap_s(times, robot_m, target_m, tuple(gaps), k) for k in range(len(gaps))]
    best = int(np.argmin(expected))
    chosen = gaps[best]
    passable = chosen.wide_enough(times.narrowest_m)
    reason = (
        f"gap {chosen.width_m:.2f} m, sigma {chosen.sigma_m:.2f} m, {100 * passable:.0f} % passable:"
        f" expected {expected[best]:.1f} s"
    )
    if len(gaps) > 1:
        reason += f", next best {sorted(expected)[1]:.1f} s"
    return GapChoice(best, tuple(expected), reason)


def _by_gap_s(times: PassageTimes, start_m: Point, target_m: Point, gaps: tuple[Gap, ...], k: int) -> float:
    """Return the expected time through gap k or, if that is blocked, through the others in the best order."""
    gap = gaps[k]
    others = tuple(sorted(gaps[:k] + gaps[k + 1 :], key=lambda other: _way_m(gap.center_m, other, target_m)))
    after = _MAX_S
    if others:
        next_ones = others[:_MAX_ALTERNATIVES]
        after = min(_by_gap_s(times, gap.center_m, target_m, next_ones, j) for j in range(len(next_ones)))
    there = times.planner.follower.limits.travel_s(math.dist(start_m, gap.center_m))
    return times.expected_s(gap, _way_m(start_m, gap, target_m), there + after)


def _way_m(start_m: Point, gap: Gap, target_m: Point) -> float:
    return math.dist(start_m, gap.center_m) + math.dist(gap.center_m, target_m)
