"""Estimates the robot's motion from the range profiles of several frames (Miura 2004, section 2.3).

A range profile is the inverse range of the nearest object at every bearing. The earlier profiles are predicted from
candidate poses near the odometry. The pose at which they agree best with the present profile is the estimate. No
features are used. Bearings of moving robots agree with no profile and are outliers.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.geometry import Pose2, compose_covariance
from robocup_vision.kernels.mapping import ego_motion as kernels

# gate in standard deviations: larger differences belong to something that moved, or came into view
_GATE_SIGMAS = 4.0
# gate of the first Gauss-Newton step, wider because the pose has not converged
_FIRST_GATE_SIGMAS = 2.0 * _GATE_SIGMAS
# gates of all Gauss-Newton steps
_GATES = np.array([_FIRST_GATE_SIGMAS] + 4 * [_GATE_SIGMAS])
# least inlier ratio of an earlier profile among the bearings that can be compared: those not hidden and with a range
_MIN_INLIER_RATIO = 0.3
# inlier ratio near the odometry below which the pose is searched on a grid
_SEARCH_BELOW_RATIO = 0.5
# greatest width of a moving object, and the standard deviation of its speed along each axis
_MOVER_M, _MOVER_MPS = 0.6, 0.3
# number of neighbours of the same object on either side over which a bearing is smoothed
_REACH = 2
# grid: number of candidates in each dimension, half its extent in standard deviations of odometry, and greatest number
# of earlier points
_CANDIDATES, _SEARCH_SIGMAS, _SEARCH_POINTS = 7, 3.0, 64


@dataclass(frozen=True, slots=True)
class EgoMotionSettings:
    """Which profiles `EgoMotion` compares.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    profiles: int = 5  #: number k of earlier profiles with which the present one is compared
    #: least time between these profiles, of which the first is the last frame's: moving objects differ more from older
    #: frames, and fewer steps accumulate fewer errors
    spacing_s: float = 0.4

    def __post_init__(self) -> None:
        if self.profiles < 1 or not 0.0 <= self.spacing_s < math.inf:
            raise ArgumentError(
                "profiles must be at least 1, and spacing_s finite and not negative, "
                f"got {self.profiles}, {self.spacing_s}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The robot's motion since the frame before."""

    #: pose of the robot now in its frame at the frame before; for the first frame, odometry. After frames with odometry
    #: alone it also corrects their drift.
    motion: Pose2
    #: (3, 3) float64: covariance of x, y, theta of the present pose given the earlier ones, robot frame before; m, rad
    covariance: FloatArray
    profiles: int  #: number of earlier profiles in use; 0 for odometry alone
    agreement: float  #: ratio of the bearings that agree with the earlier profiles; 0 without profiles
    pose: Pose2  #: pose of the robot now in its frame at the first frame

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", read_only(self.covariance))


@dataclass(frozen=True, slots=True, eq=False)
class _Profile:
    """A smoothed range profile.

    `present` (3, J) is in the kernels' format, `thing` (J,) is each bearing's object, -1 for none, and `things` their
    number. `weight` is the number of independent measurements per bearing: smoothing correlates neighbours.
    """

    present: FloatArray
    thing: npt.NDArray[np.int64]
    things: int
    weight: float

    @classmethod
    def smooth(cls, inverse: FloatArray, std: FloatArray) -> _Profile:
        variance = std**2
        present = np.empty((3, len(inverse)))
        kernels.smooth(inverse, variance, _REACH, *present)
        thing = np.empty(len(inverse), dtype=np.int64)
        things = kernels.part(present[kernels.VALUE], present[kernels.VARIANCE], thing)
        known = thing >= 0
        ratios = present[kernels.VARIANCE, known] / variance[known]
        return cls(present, thing, things, float(ratios.mean()) if known.any() else 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Past:
    """An earlier profile: points (J, 4) in the kernels' format and the first frame, whether they may move, objects."""

    t_s: float
    points: FloatArray
    may_move: npt.NDArray[np.bool_]
    thing: npt.NDArray[np.int64]

    def at(self, t_s: float) -> FloatArray:
        """Return the points (J, 4) with the variance of their displacement up to a time."""
        points = self.points.copy()
        points[:, kernels.MOVED_VARIANCE] = self.may_move * (_MOVER_MPS * (t_s - self.t_s)) ** 2
        return points


class EgoMotion:
    """Estimates the robot's motion frame by frame; one object for each robot.

    Parameters
    ----------
    bearings : int
        Number J of bearings of a profile; bearing j is 2 pi j / J in the robot frame.
    settings : EgoMotionSettings, optional
        How profiles are compared.

    Raises
    ------
    ArgumentError
        If there are less than 8 bearings.

    Notes
    -----
    The cost is Miura's (eqs. 1, 2): over the earlier profiles, the sum of the mean of (D_t - D_{t-i})^2 / (sigma_i^2 +
    sigma_0^2), in inverse range, without bearings that have no range or differ by more than 4 sigma. Differences are:

    - odometry is not only the start of the search, but also a measurement;
    - the pose is found by Gauss-Newton, which is faster and not limited to a grid's step; the paper's grid of
      candidates is used only if less than half of the bearings agree near the odometry;
    - a profile is used if 30 % of the bearings that can be compared agree (not hidden, and with a range);
    - an object less than 0.6 m wide may have moved at about 0.3 m/s: slow movers pass the gate and would bias the pose;
    - the covariance is the inverse of the cost's curvature, which is first divided by the factor by which gradients of
      blocks of neighbouring bearings scatter more than their variances state, because errors are correlated.
    """

    def __init__(self, bearings: int, settings: EgoMotionSettings = EgoMotionSettings()) -> None:
        if bearings < 8:
            raise ArgumentError(f"bearings must be at least 8, got {bearings}")
        self.bearings = bearings
        angle = np.arange(bearings) * (math.tau / bearings)
        self._rays = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        self.settings = settings
        self._past: deque[_Past] = deque()
        self.forget()

    def forget(self) -> None:
        """Forget all profiles: the next one is the first."""
        self._past.clear()
        self._t_s: float | None = None
        self._pose = Pose2(0.0, 0.0, 0.0)
        # covariance of that pose from odometry alone, since a profile last corrected it
        self._drift = np.zeros((3, 3))

    def update(
        self,
        inverse_range_per_m: npt.ArrayLike,
        std_per_m: npt.ArrayLike,
        odometry: Pose2,
        odometry_covariance: npt.ArrayLike,
        t_s: float,
    ) -> Motion:
        """Update with the profile of a frame.

        Parameters
        ----------
        inverse_range_per_m : (J,) float
            Inverse range of the nearest object at each bearing, 1/m; NaN or 0 if there is none.
        std_per_m : float or (J,) float
            Its standard deviation, 1/m.
        odometry : Pose2
            The motion since the frame before as the wheels measure it, in the robot frame then.
        odometry_covariance : (3, 3) float
            Covariance of the odometry, of x, y, theta; m, rad.
        t_s : float
            Time of the frame; later than that of the frame before.

        Raises
        ------
        ArgumentError
            If a size is wrong, a standard deviation is not positive, the odometry is not finite, its covariance is not
            positive definite, or the time does not increase.
        """
        inverse = np.array(inverse_range_per_m, dtype=np.float64)
        std = np.asarray(std_per_m, dtype=np.float64)
        covariance = np.asarray(odometry_covariance, dtype=np.float64)
        if inverse.shape != (self.bearings,):
            raise ArgumentError(f"inverse_range_per_m must be ({self.bearings},), got {inverse.shape}")
        if std.shape not in ((), (self.bearings,)):
            raise ArgumentError(f"std_per_m must be one number or ({self.bearings},), got {std.shape}")
        inverse[~(np.isfinite(inverse) & (inverse > 0.0))] = np.nan
        std = np.broadcast_to(std, inverse.shape)
        known = std[np.isfinite(inverse)]
        if not np.all((known > 0.0) & np.isfinite(known)):
            raise ArgumentError("std_per_m must be positive wherever there is a range")
        if not np.isfinite(odometry.array).all():
            raise ArgumentError(f"odometry must be finite, got {odometry}")
        if covariance.shape != (3, 3) or not _is_definite(covariance):
            raise ArgumentError("odometry_covariance must be (3, 3) and positive definite")
        if not math.isfinite(t_s) or (self._t_s is not None and t_s <= self._t_s):
            raise ArgumentError(
                f"t_s must be finite and later than the frame before, got {t_s!r}: forget() begins a run anew"
            )
        profile = _Profile.smooth(inverse, std)
        if self._t_s is None:
            motion = Motion(odometry, covariance, 0, 0.0, self._pose)
        else:
            motion = self._fit(profile, odometry, covariance, t_s)
        self._t_s, self._pose = t_s, motion.pose
        if profile.things:
            self._past.append(self._in_frame_of_first(profile, t_s))
        return motion

    def _in_frame_of_first(self, profile: _Profile, t_s: float) -> _Past:
        range_m = 1.0 / profile.present[kernels.VALUE]
        points = np.zeros((self.bearings, 4))
        points[:, :2] = self._pose.transform(self._rays * range_m[:, None])
        points[:, kernels.RANGE_VARIANCE] = profile.present[kernels.VARIANCE] * range_m**4
        width = np.empty(profile.things)
        kernels.widths(points, profile.thing, width)
        return _Past(t_s, points, np.append(width < _MOVER_M, False)[profile.thing], profile.thing)

    def _chosen(self) -> list[_Past]:
        """Return the last profile and earlier ones at least `spacing_s` apart; drop those that are too old."""
        chosen: list[_Past] = []
        for past in reversed(self._past):
            if len(chosen) == self.settings.profiles:
                break
            # tolerance of half a millisecond: periodic frames may be early by a rounding error
            if not chosen or chosen[-1].t_s - past.t_s >= self.settings.spacing_s - 5e-4:
                chosen.append(past)
        while len(chosen) == self.settings.profiles and self._past[0] is not chosen[-1]:
            self._past.popleft()
        return chosen

    def _fit(self, profile: _Profile, odometry: Pose2, covariance: FloatArray, t_s: float) -> Motion:
        before, predicted = self._pose, self._pose.compose(odometry)
        spread = compose_covariance(before, self._drift, odometry, covariance)
        unaided = Motion(odometry, covariance, 0, 0.0, predicted)
        chosen, self._drift = self._chosen(), spread
        if not chosen:
            return unaided
        past, thing = np.stack([one.at(t_s) for one in chosen]), np.stack([one.thing for one in chosen])
        information = np.asarray(np.linalg.inv(spread), dtype=np.float64)
        normal = np.empty((3, 3))

        rules = kernels.Rules(_MIN_INLIER_RATIO, profile.weight, 2 * _REACH + 1)
        earlier, prediction = kernels.Earlier(past, thing), kernels.Prediction(predicted.array, information)

        def refine(pose: FloatArray) -> tuple[int, float]:
            used, ratio = kernels.refine(profile.present, earlier, pose, prediction, _GATES, rules, normal)
            return int(used), float(ratio)

        pose = predicted.array
        used, ratio = refine(pose)
        if ratio < _SEARCH_BELOW_RATIO:
            pose = self._search(profile.present, past, predicted, spread)
            used, ratio = refine(pose)
        if not used:
            return unaided
        self._drift = np.zeros((3, 3))
        now = Pose2(*pose.tolist())
        c, s = math.cos(before.theta_rad), math.sin(before.theta_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return Motion(before.inverse().compose(now), turn.T @ np.linalg.inv(normal) @ turn, used, ratio, now)

    def _search(self, present: FloatArray, past: FloatArray, predicted: Pose2, covariance: FloatArray) -> FloatArray:
        """Return the best (3,) of a grid of candidate poses around the odometry."""
        axis = np.linspace(-_SEARCH_SIGMAS, _SEARCH_SIGMAS, _CANDIDATES)
        grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
        poses = predicted.array + grid @ np.linalg.cholesky(covariance).T
        # nearest to the odometry first, which decides between equal scores
        poses = poses[np.argsort(np.sum(grid**2, axis=1), kind="stable")]
        points = past.reshape(-1, 4)
        points = points[np.isfinite(points[:, 0])]
        thinned = np.ascontiguousarray(points[:: max(1, len(points) // _SEARCH_POINTS)])
        best: int = kernels.search(present, thinned, poses, _FIRST_GATE_SIGMAS)
        return np.array(poses[best])


def _is_definite(covariance: FloatArray) -> bool:
    return bool(np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance)[0] > 0.0)
