"""Estimates the robot's motion from the range profiles of several frames (Miura 2004, section 2.3).

A range profile is the inverse range of the nearest thing in every direction. The earlier profiles are predicted from
candidate poses around the odometry. The pose at which they agree best with the present profile is the estimate. It uses
no features. Bearings of moving robots agree with no profile and are skipped.
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

# differences beyond this many standard deviations belong to something that moved, or came into view
_GATE_SIGMAS = 4.0
# the same of the first Gauss-Newton step: it narrows while the pose converges
_FIRST_GATE_SIGMAS = 2.0 * _GATE_SIGMAS
# of each Gauss-Newton step
_GATES = np.array([_FIRST_GATE_SIGMAS] + 4 * [_GATE_SIGMAS])
# an earlier profile counts if at least this ratio of the directions that can be compared agrees: one that is hidden, or
# without a range, cannot be compared
_MIN_INLIER_RATIO = 0.3
# where less than this ratio agrees around what odometry reports, the pose is searched for on a grid
_SEARCH_BELOW_RATIO = 0.5
# nothing wider than this moves by itself, and what does, at about this speed along each axis
_MOVER_M, _MOVER_MPS = 0.6, 0.3
# a direction is smoothed over this many neighbours on either side, as long as they lie on the same thing
_REACH = 2
# candidates a dimension of the grid, over this many standard deviations of odometry, on so many earlier points
_CANDIDATES, _SEARCH_SIGMAS, _SEARCH_POINTS = 7, 3.0, 64


@dataclass(frozen=True, slots=True)
class EgoMotionSettings:
    """Which profiles `EgoMotion` compares.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    profiles: int = 5  #: number k of earlier profiles that the present one is compared with
    #: the first of them is the last frame's, and the others are at least so far apart: what moves shows against frames
    #: farther back, and errors add up less often
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

    #: the robot now, in its frame at the frame before; of the first frame, odometry. After frames that rested on
    #: odometry alone it takes back their drift as well.
    motion: Pose2
    #: (3, 3) float64: of the present pose given the earlier ones, (x_m, y_m, theta_rad) in the robot frame before; m,
    #: m, rad
    covariance: FloatArray
    profiles: int  #: number of earlier profiles that it rests on; 0: odometry alone
    agreement: float  #: ratio of the bearings that agree with the earlier profiles; 0 without profiles
    pose: Pose2  #: the robot now, in its frame at the first frame

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", read_only(self.covariance))


@dataclass(frozen=True, slots=True, eq=False)
class _Profile:
    """What a frame shows, smoothed along things: the kernels' (3, J), which thing each direction is of, and its weight.

    `weight`: independent measurements a direction, since those of neighbours are the same in part.
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
    """An earlier profile: the kernels' points (J, 4) in the frame of the first, whether they may move, their things."""

    t_s: float
    points: FloatArray
    may_move: npt.NDArray[np.bool_]
    thing: npt.NDArray[np.int64]

    def at(self, t_s: float) -> FloatArray:
        """(J, 4) with how far each point may have moved by then."""
        points = self.points.copy()
        points[:, kernels.MOVED_VARIANCE] = self.may_move * (_MOVER_MPS * (t_s - self.t_s)) ** 2
        return points


class EgoMotion:
    """Follows the robot's motion frame by frame; one object a robot.

    Parameters
    ----------
    bearings : int
        Number J of directions of a profile; direction j is at 2 pi j / J in the robot frame.
    settings : EgoMotionSettings, optional
        How profiles are compared.

    Raises
    ------
    ArgumentError
        If there are less than 8 bearings.

    Notes
    -----
    The cost is Miura's (eqs. 1, 2): over the earlier profiles, the sum of the mean of (D_t - D_{t-i})^2 / (sigma_i^2 +
    sigma_0^2), in inverse range, with directions skipped that show nothing or differ by more than 4 sigma. Here

    - odometry is not only where the search begins, but a measurement like the others;
    - the pose is found by Gauss-Newton, and on a grid of candidates, as in the paper, only where less than half of the
      directions agree around the odometry: faster, and not limited to a grid's step;
    - a profile counts if 30 % of the directions that can be compared agree: one that is hidden, or without a range,
      cannot be compared;
    - a thing less than 0.6 m wide may itself have moved, at some 0.3 m/s: slow movers pass the gate, and would take
      the pose with them;
    - the covariance is the inverse of the cost's curvature, but errors of directions side by side are not independent:
      the curvature is divided by how much more the pulls of blocks of them scatter than they claim.
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
        """Begin anew: the next profile is the first."""
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
            Inverse range of the nearest thing in each direction, 1/m; NaN or 0 where there is none.
        std_per_m : float or (J,) float
            Its standard deviation, 1/m.
        odometry : Pose2
            The motion since the frame before as the wheels measure it, in the robot frame then.
        odometry_covariance : (3, 3) float
            Of that, m, m, rad.
        t_s : float
            When the frame was taken; later than the one before.

        Raises
        ------
        ArgumentError
            If a size is wrong, a standard deviation is not positive, the odometry is not finite, its covariance not
            positive definite, or time does not go on.
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
        """Choose the last profile and others behind it as far apart as asked; drop those too old for that."""
        chosen: list[_Past] = []
        for past in reversed(self._past):
            if len(chosen) == self.settings.profiles:
                break
            # half a millisecond: frames that come as often as asked may come a rounding error too early
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
        """Return (3,) float64: the best of a grid of candidates about the odometry."""
        axis = np.linspace(-_SEARCH_SIGMAS, _SEARCH_SIGMAS, _CANDIDATES)
        grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
        poses = predicted.array + grid @ np.linalg.cholesky(covariance).T
        # odometry first: of equals, it stays
        poses = poses[np.argsort(np.sum(grid**2, axis=1), kind="stable")]
        points = past.reshape(-1, 4)
        points = points[np.isfinite(points[:, 0])]
        thinned = np.ascontiguousarray(points[:: max(1, len(points) // _SEARCH_POINTS)])
        best: int = kernels.search(present, thinned, poses, _FIRST_GATE_SIGMAS)
        return np.array(poses[best])


def _is_definite(covariance: FloatArray) -> bool:
    return bool(np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance)[0] > 0.0)
