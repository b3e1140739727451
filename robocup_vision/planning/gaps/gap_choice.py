"""How long it takes, on the average, to pass a gap of uncertain width, and which of several gaps to take.

Miura (2004), section 6.2: E[T] = sum over widths of p(w) T(w), with T(w) at the largest safe speeds. A mean width hides
that a gap half of whose widths are slow or blocked is slower than its mean one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.disc import Disc
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.motion import path_following as kernel
from robocup_vision.planning.gaps.gap import Gap, Point
from robocup_vision.planning.speed.speed_planner import SpeedPlanner

# the table's widths, robot widths; how far before and after a gap it still counts, metres
_NARROWEST, _WIDEST, _WIDTHS, _WAY_M = 1.0, 6.0, 41, 1.5
# given up after so long; commands between two plans; widths that stand for the distribution
_LATEST_S, _EVERY, _CELLS, _SPREAD = 30.0, 3, 61, 3.5
# gaps that are reckoned with once others have turned out blocked
_DEEP = 3
# the standard normal distribution in cells of equal width
_EDGES = np.linspace(-_SPREAD, _SPREAD, _CELLS + 1)
_MIDDLES = 0.5 * (_EDGES[1:] + _EDGES[:-1])


class PassageTimes:
    """What gaps cost by their width, driven through in the mind with the real planner and controller.

    Parameters
    ----------
    planner : SpeedPlanner
        Which plans the speeds.
    opponent_radius_m : float
        Of what makes the gaps.
    opponent_sigma_m : float
        How well opponents are placed when the robot gets there.
    """

    def __init__(self, planner: SpeedPlanner, opponent_radius_m: float, opponent_sigma_m: float) -> None:
        from scipy.special import ndtr

        for name, value in (("opponent_radius_m", opponent_radius_m), ("opponent_sigma_m", opponent_sigma_m)):
            if not (math.isfinite(value) and value > 0.0):
                raise ArgumentError(f"{name} must be positive, got {value!r}")
        self.planner = planner
        mass = np.diff(ndtr(_EDGES))
        self._probability = mass / mass.sum()
        self._opponent = float(opponent_radius_m), float(opponent_sigma_m)
        widths = np.linspace(_NARROWEST, _WIDEST, _WIDTHS) * 2 * planner.robot_radius_m
        open_s = self._drive_s(None)
        extra = np.array([self._drive_s(width) - open_s for width in widths.tolist()])
        # a wider gap is never worse: where the rollout says so, it is by the phase of the looks
        self._widths_m, self._extra_s = read_only(widths), read_only(np.minimum.accumulate(extra))

    @property
    def narrowest_m(self) -> float:
        """The narrowest width, of those in the table, that has a safe speed; inf if none has."""
        passable = np.isfinite(self._extra_s)
        return float(self._widths_m[np.argmax(passable)]) if passable.any() else math.inf

    def extra_s(self, width_m: float) -> float:
        """Return the seconds that a gap of this width costs beyond the open floor; inf: there is no safe speed."""
        if width_m < self.narrowest_m:
            return math.inf
        passable = np.isfinite(self._extra_s)
        return float(np.interp(width_m, self._widths_m[passable], self._extra_s[passable]))

    def expected_s(self, gap: Gap, way_m: float, blocked_s: float) -> float:
        """Return E[T] over the widths that the gap may have.

        Parameters
        ----------
        gap : Gap
            As believed.
        way_m : float
            Length of the way through it to the target.
        blocked_s : float
            What it takes in all if the gap turns out to have no safe speed: there, back, and another way.
        """
        widths = gap.width_m + gap.sigma_m * _MIDDLES
        open_s = self.planner.follower.limits.travel_s(way_m)
        passable = np.isfinite(self._extra_s)
        times = np.interp(widths, self._widths_m[passable], open_s + self._extra_s[passable])
        times = np.where(widths < self.narrowest_m, blocked_s, times)
        return float(self._probability @ times)

    def _drive_s(self, width_m: float | None) -> float:
        """Seconds of a drive in which nothing goes wrong, but everything might; inf if it is not finished."""
        planner, (radius, sigma) = self.planner, self._opponent
        path = np.array([[-_WAY_M, 0.0], [_WAY_M, 0.0]])
        doubt = sigma**2 * np.eye(2)
        discs = [] if width_m is None else [Disc(0.0, s * (0.5 * width_m + radius), radius, doubt) for s in (-1, 1)]
        limits = planner.follower.limits
        every = max(1, round(planner.look_period_s / planner.period_s))
        look = np.asarray(planner.noise.look_covariance)
        covariance = look
        place, velocity, asked = (-_WAY_M, 0.0), (0.0, 0.0), (0.0, 0.0)
        seen, speed = place, 0.0
        for step in range(int(_LATEST_S / planner.period_s)):
            if step % every == 0:
                covariance = look
                seen = place
            if step % _EVERY == 0 or step % every == 0:
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
    """Which gap to take.

    Parameters
    ----------
    index : int
        Of the gap, in the order given.
    expected_s : tuple of float
        Expected time to the target by each.
    reason : str
        In words.
    """

    index: int
    expected_s: tuple[float, ...]
    reason: str


def choose_gap(times: PassageTimes, robot_m: Point, target_m: Point, gaps: Sequence[Gap]) -> GapChoice:
    """Return the gap with the least expected time; one that turns out blocked is left for the best of the others.

    Parameters
    ----------
    times : PassageTimes
        What gaps cost by their width.
    robot_m, target_m : (float, float)
        Where the robot is, and where it wants to be.
    gaps : sequence of Gap
        At least one. The last resort, if all others are blocked, is a wait of a table's longest drive.
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
    """Return the expected time by gap k first; if that is blocked, by the best order of the others."""
    gap = gaps[k]
    others = tuple(sorted(gaps[:k] + gaps[k + 1 :], key=lambda other: _by(gap.center_m, other, target_m)))
    after = _LATEST_S
    # beyond a few gaps the rest no longer matters: each is only reached if all before are blocked
    if others:
        after = min(_by_gap_s(times, gap.center_m, target_m, others[:_DEEP], j) for j in range(len(others[:_DEEP])))
    there = times.planner.follower.limits.travel_s(math.dist(start_m, gap.center_m))
    return times.expected_s(gap, _by(start_m, gap, target_m), there + after)


def _by(start_m: Point, gap: Gap, target_m: Point) -> float:
    return math.dist(start_m, gap.center_m) + math.dist(gap.center_m, target_m)
