"""How the robot has moved, from the range profiles of several frames (Miura 2004, section 2.3).

A range profile is the inverse range of the nearest thing in every direction. The earlier ones are seen again from
candidate poses around what odometry says; where they agree best with the present one, the robot is. No feature is
looked for, and moving robots are the bearings that agree with nothing and are skipped.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.geometry import FloatArray, Pose2, read_only
from robocup_vision.kernels import range_profile

# differences beyond this many standard deviations belong to something that moved, or came into view
_GATE_SIGMAS = 4.0
# the gate closes while the pose settles
_GATES = np.array([2.0, 1.0, 1.0, 1.0, 1.0]) * _GATE_SIGMAS
# an earlier profile counts if at least this share of it agrees
_LEAST_SHARE = 0.3
# where less than this agrees around what odometry says, the pose is searched for
_AGREED_SHARE = 0.5
# nothing wider than this moves by itself, and what does, about so fast along each axis
_MOVER_M, _MOVER_MPS = 0.5, 0.3
# a direction is smoothed over this many neighbours on either side, as long as they lie on the same thing
_REACH = 4
# candidates a dimension of the search, over this many standard deviations of odometry
_CANDIDATES, _SEARCH_SIGMAS = 7, 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """How the robot moved since the frame before.

    Parameters
    ----------
    motion : Pose2
        The robot now, in its frame at the frame before.
    covariance : (3, 3) float64
        Of the present pose given the earlier ones, (x_m, y_m, theta_rad) in the robot frame before; m, m, rad.
    profiles : int
        Number of earlier profiles that it rests on; 0: odometry alone.
    agreement : float
        Share of the bearings that agree with the earlier profiles; 0 without profiles.
    pose : Pose2
        The robot now, in the frame of the first profile.
    """

    motion: Pose2
    covariance: FloatArray
    profiles: int
    agreement: float
    pose: Pose2

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", read_only(self.covariance))


@dataclass(frozen=True, slots=True, eq=False)
class _Profile:
    """Inverse range in each direction, smoothed along the things seen; 1/m, 1/m^2 and 1/m a step."""

    inverse: FloatArray
    variance: FloatArray
    slope: FloatArray
    worth: float
    thing: npt.NDArray[np.int64]
    things: int

    @classmethod
    def smooth(cls, inverse: FloatArray, std: FloatArray) -> _Profile:
        raw = std**2
        value, variance, slope = np.empty((3, len(inverse)))
        range_profile.smooth(inverse, raw, _REACH, value, variance, slope)
        known = np.isfinite(value)
        worth = float(np.mean(variance[known] / raw[known])) if known.any() else 1.0
        thing = np.empty(len(inverse), dtype=np.int64)
        things = range_profile.part(value, variance, thing)
        return cls(value, variance, slope, worth, thing, things)


class EgoMotion:
    """Follows the robot's motion frame by frame; one object a robot.

    Parameters
    ----------
    bearings : int
        Number J of directions of a profile; direction j is at 2 pi j / J in the robot frame.
    profiles : int
        Number k of earlier profiles that the present one is compared with.
    spacing : int
        Of the earlier frames, each so-manieth is taken: what moves shows better against frames farther back.

    Raises
    ------
    ArgumentError
        If one of them is too small.
    """

    def __init__(self, bearings: int, profiles: int = 5, spacing: int = 1) -> None:
        if bearings < 8 or profiles < 1 or spacing < 1:
            raise ArgumentError(
                f"bearings must be at least 8, profiles and spacing at least 1, got {bearings}, {profiles}, {spacing}"
            )
        self.bearings = bearings
        angle = np.arange(bearings) * (math.tau / bearings)
        self._rays = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        self._spacing = spacing
        self._past: deque[tuple[float, FloatArray, FloatArray, FloatArray, npt.NDArray[np.int64]]] = deque(maxlen=(profiles - 1) * spacing + 1)
        self._pose = Pose2(0.0, 0.0, 0.0)

    def forget(self) -> None:
        """Begin anew: the next profile is the first."""
        self._past.clear()
        self._pose = Pose2(0.0, 0.0, 0.0)

    def update(
        self,
        inverse_range_per_m: npt.ArrayLike,
        std_per_m: npt.ArrayLike,
        odometry: Pose2,
        odometry_covariance: npt.ArrayLike,
        t_s: float,
    ) -> Motion:
        """Take the profile of a frame.

        Parameters
        ----------
        inverse_range_per_m : (J,) float
            Inverse range of the nearest thing in each direction, 1/m; NaN or 0 where there is none.
        std_per_m : float or (J,) float
            Its standard deviation, 1/m.
        odometry : Pose2
            The motion since the frame before as the wheels tell it, in the robot frame then.
        odometry_covariance : (3, 3) float
            Of that, m, m, rad.

        Raises
        ------
        ArgumentError
            If a size is wrong, a standard deviation is not positive, or the covariance is not positive definite.
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
        if not np.all(std[np.isfinite(inverse)] > 0.0):
            raise ArgumentError(f"std_per_m must be positive, got {np.min(std)}")
        if covariance.shape != (3, 3) or not np.all(np.linalg.eigvalsh(covariance) > 0.0):
            raise ArgumentError("odometry_covariance must be (3, 3) and positive definite")
        profile = _Profile.smooth(inverse, std)
        motion = self._fit(profile, odometry, covariance, t_s) if self._past else None
        if motion is None:
            motion = Motion(odometry, covariance, 0, 0.0, self._pose.compose(odometry))
        self._pose = motion.pose
        self._past.append((t_s, *self._in_frame_of_first(profile)))
        return motion

    def _in_frame_of_first(
        self, profile: _Profile
    ) -> tuple[FloatArray, FloatArray, FloatArray, npt.NDArray[np.int64]]:
        """Points (J, 2), m; the variance of their range (J,), m^2; whether they may move (J,), and their things (J,)."""
        range_m = 1.0 / profile.inverse
        xy = self._pose.transform(self._rays * range_m[:, None])
        width = np.empty(profile.things)
        range_profile.widths(xy, profile.thing, profile.things, width)
        may_move = np.append(np.where(width < _MOVER_M, 1.0, 0.0), 0.0)[profile.thing]
        return xy, profile.variance * range_m**4, may_move, profile.thing

    def _fit(self, profile: _Profile, odometry: Pose2, covariance: FloatArray, t_s: float) -> Motion | None:
        chosen = list(self._past)[:: -self._spacing]
        past = (
            np.stack([xy for _, xy, _, _, _ in chosen]),
            np.stack([spread for _, _, spread, _, _ in chosen]),
            np.stack([may * (_MOVER_MPS * (t_s - then)) ** 2 for then, _, _, may, _ in chosen]),
            np.stack([thing for _, _, _, _, thing in chosen]),
        )
        seen = profile.inverse, profile.variance, profile.slope
        before, predicted = self._pose, self._pose.compose(odometry)
        c, s = math.cos(before.theta_rad), math.sin(before.theta_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        information = turn @ np.linalg.inv(covariance) @ turn.T
        normal = np.empty((3, 3))

        def refine(pose: FloatArray) -> tuple[int, float]:
            result = range_profile.refine(
                *seen, *past, pose, predicted.array, information, _GATES, _LEAST_SHARE, profile.worth, normal
            )
            return int(result[1]), float(result[2])

        pose = predicted.array
        used, share = refine(pose)
        if share < _AGREED_SHARE:
            pose = self._search(seen, past, predicted, turn @ covariance @ turn.T)
            used, share = refine(pose)
        if not used:
            return None
        now = Pose2(*pose)
        return Motion(before.inverse().compose(now), turn.T @ np.linalg.inv(normal) @ turn, used, share, now)

    def _search(self, seen, past, predicted, covariance):
        axis = np.linspace(-_SEARCH_SIGMAS, _SEARCH_SIGMAS, _CANDIDATES)
        grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
        poses = predicted.array + grid @ np.linalg.cholesky(covariance).T
        poses = poses[np.argsort(np.sum(grid**2, axis=1), kind="stable")]
        thin = [np.ascontiguousarray(p[:, ::4]) for p in past]
        return poses[range_profile.search(*seen, *thin, poses, 2.0 * _GATE_SIGMAS)].copy()
