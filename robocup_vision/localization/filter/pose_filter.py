"""Filter that fuses the poses of single frames and odometry to one estimate over time.

The state is a Gaussian mixture over the pose. The history of the last second is stored: a late frame is inserted at its
own time, and later steps are repeated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arguments import as_pose
from robocup_vision.arrays import FloatArray
from robocup_vision.belief import Hypothesis
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.errors import FrameErrors, OdometryNoise
from robocup_vision.localization.filter.hypothesis import PoseMode
from robocup_vision.localization.filter.mixture import Mixture
from robocup_vision.localization.filter.settings import Half, PoseFilterSettings

__all__ = ["FrameErrors", "Hypothesis", "OdometryNoise", "PoseFilter", "PoseFilterSettings"]

_ORIGIN = Pose2(0.0, 0.0, 0.0)
# distance past the floor's edge, inwards, to which a point is moved
_INSIDE_M = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class _Moment:
    """A step of odometry or a frame, with the mixture after it.

    `odometry_pose` is by odometry alone; `is_motion_unknown`: whether the motion up to here is unknown.
    """

    t_s: float
    odometry_pose: Pose2
    estimate: PoseEstimate | None
    mixture: Mixture
    is_motion_unknown: bool = False

    @property
    def key(self) -> tuple[float, ...]:
        """Key that sorts frames of one time, so that the order of their arrival does not matter."""
        if self.estimate is None:
            return ()
        return tuple(value for pose in self.estimate.candidates for value in (pose.x_m, pose.y_m, pose.theta_rad))


class FloorBound:
    """Moves modes beyond the walls to the nearest floor, because walls and boards stop a robot."""

    def __init__(self, field: Field) -> None:
        self._field = field if field.is_bounded else None
        first = field.floor_polygon
        self._first, self._edge = first, np.roll(first, -1, axis=0) - first

    def nearest(self, x_m: float, y_m: float) -> FloatArray | None:
        """Return the nearest place (2,) on the floor; None if the place is on it."""
        field = self._field
        if field is None or field.is_on_floor(x_m, y_m):
            return None
        point = np.array([x_m, y_m])
        along = ((point - self._first) * self._edge).sum(axis=1) / (self._edge**2).sum(axis=1)
        feet = self._first + np.clip(along, 0.0, 1.0)[:, None] * self._edge
        foot = feet[int(np.argmin(np.hypot(*(feet - point).T)))]
        # inwards from a side or a corner, in the first direction that leads to the floor
        for angle in np.arange(8) * (np.pi / 4):
            inside = foot + _INSIDE_M * np.array([np.cos(angle), np.sin(angle)])
            if field.is_on_floor(*inside.tolist()):
                return np.asarray(inside)
        return np.asarray(foot)

    def keep(self, mode: PoseMode) -> PoseMode:
        """Return the mode moved onto the floor; its covariance grows by the square of the distance moved."""
        place = self.nearest(mode.pose.x_m, mode.pose.y_m)
        if place is None:
            return mode
        off = place - (mode.pose.x_m, mode.pose.y_m)
        covariance = mode.covariance.copy()
        covariance[:2, :2] += np.outer(off, off)
        pose = Pose2(float(place[0]), float(place[1]), mode.pose.theta_rad)
        return replace(mode, pose=pose, covariance=covariance)


class PoseFilter:
    """Estimates the robot's pose from frames and odometry; one object for each robot.

    Parameters
    ----------
    odometry : OdometryNoise, optional
        Errors of the robot's odometry.
    frames : FrameErrors, optional
        Errors of its frames.
    settings : PoseFilterSettings, optional
        Gates and modes.
    field : Field, optional
        Field whose walls or boards bound the poses.
    half : {"own"}, optional
        The half in which the robot is known to start: its own, x < 0. By default it is unknown, so that frames that
        look alike from both halves leave them equally probable.

    Raises
    ------
    ArgumentError
        If `half` has another value.

    Notes
    -----
    Call `predict` at each control step, and `update` after each frame with the time it was taken. A late frame is
    inserted into the history of the last second, and later steps are repeated, so that the order of arrival does not
    matter.

    The state is a mixture of Gaussians over the pose, the slip (`OdometryNoise`) and the bias that successive frames
    share (`FrameErrors`). The bias is a first-order Gauss-Markov process in the distance driven, so that the covariance
    does not shrink below the shared error. Each mode stands for both halves of a symmetric field. A frame that allows
    both poses corrects the mode; a frame with one candidate also names the half, and Bayes' rule weighs it by the rate
    of wrong halves. `hypotheses` lists both halves of all modes.

    A frame that matches no mode adds a new one. Its prior weight is the probability of a shove or a kidnapping since
    the last frame, relative to that of an outlier; later frames decide. A near miss also corrects the mode, with a
    weight that decreases with the distance.
    """

    def __init__(
        self,
        *,
        odometry: OdometryNoise | None = None,
        frames: FrameErrors | None = None,
        settings: PoseFilterSettings = PoseFilterSettings(),
        field: Field | None = None,
        half: Half | None = None,
    ) -> None:
        if half not in (None, "own"):
            raise ArgumentError(f"half must be 'own', for a robot that begins at x < 0, or None, got {half!r}")
        self.settings, self.half = settings, half
        self._bound = None if field is None else FloorBound(field)
        self.odometry_noise = odometry or OdometryNoise()
        self.frame_errors = frames or FrameErrors()
        self._expected: Pose2 | None = None
        self._moments: list[_Moment] = []
        # time of the last odometry; None before the first
        self._now_s: float | None = None

    def expect(self, pose: Pose2) -> None:
        """Set the pose where the robot probably starts, which selects the nearest candidate of the first frame."""
        self._expected = as_pose("pose", pose)

    @property
    def expected(self) -> Pose2 | None:
        """The pose set by `expect`."""
        return self._expected

    @property
    def is_bounded(self) -> bool:
        """Whether poses stay within walls."""
        return self._bound is not None

    @property
    def is_fresh(self) -> bool:
        """Whether there has been no odometry and no frame yet."""
        return not self._moments

    def predict(self, odometry: Pose2, t_s: float) -> None:
        """Predict the estimate by odometry.

        Parameters
        ----------
        odometry : Pose2
            Motion since the previous call, in the robot's frame then; for the first call since the last frame. A motion
            faster than any robot (`PoseFilterSettings`) is not used: the estimate stays, and its covariance grows.
        t_s : float
            The present time, seconds; not earlier than before.

        Raises
        ------
        ArgumentError
            The odometry is not finite, or time runs backwards.
        """
        if not isinstance(odometry, Pose2):
            as_pose("odometry", odometry)
        if not all(map(math.isfinite, (odometry.x_m, odometry.y_m, odometry.theta_rad, t_s))):
            raise ArgumentError(f"odometry and its time must be finite, got {odometry} at {t_s!r} s")
        if self._now_s is not None and t_s < self._now_s:
            raise ArgumentError(
                f"time must not run backwards, got {t_s!r} s after {self._now_s!r} s: forget() begins a run anew"
            )
        if not self._moments:
            # nothing to move yet
            self._moments.append(_Moment(t_s, _ORIGIN, None, self._mixture))
        else:
            if self._now_s is None:
                # the clock starts with the first odometry: a later frame counts as present
                self._moments = [replace(moment, t_s=min(moment.t_s, t_s)) for moment in self._moments]
            last = self._moments[-1]
            is_possible = self.can_move(odometry, t_s)
            odometry_pose = last.odometry_pose.compose(odometry) if is_possible else last.odometry_pose
            self._moments.append(self._after(last, _Moment(t_s, odometry_pose, None, last.mixture, not is_possible)))
            gone = next(
                index for index, moment in enumerate(self._moments) if moment.t_s >= t_s - self.settings.history_s
            )
            del self._moments[:gone]
        self._now_s = t_s

    def can_move(self, odometry: Pose2, t_s: float) -> bool:
        """Whether a robot can have moved so far since the last `predict` or the first frame."""
        if not self._moments:
            return True
        since_s = self._moments[-1].t_s if self._now_s is None else self._now_s
        return self.settings.is_possible(odometry, max(t_s - since_s, 0.0))

    def update(self, estimate: PoseEstimate | NotLocated, t_s: float) -> None:
        """Update with the pose of a frame.

        Parameters
        ----------
        estimate : PoseEstimate or NotLocated
            Pose of the robot; NotLocated changes nothing.
        t_s : float
            Time of the frame. A frame after the last odometry counts as present; one before the history (1 s) changes
            nothing.
        """
        if not isinstance(estimate, (PoseEstimate, NotLocated)):
            raise ArgumentError(f"update takes a PoseEstimate or NotLocated, got {type(estimate).__name__}")
        if isinstance(estimate, NotLocated) or not math.isfinite(t_s):
            return
        if self._now_s is not None:
            t_s = min(t_s, self._now_s)
        if not self._moments:
            mixture = self._mixture.update(estimate, t_s, self.odometry_noise, self.frame_errors)
            self._moments.append(_Moment(t_s, _ORIGIN, estimate, mixture))
            return
        odometry_pose = self._odometry_pose(t_s)
        if odometry_pose is None:
            return
        at = len(self._moments)
        new = _Moment(t_s, odometry_pose, estimate, self._mixture)
        while at > 1 and (self._moments[at - 1].t_s, self._moments[at - 1].key) > (t_s, new.key):
            at -= 1
        later = self._moments[at:]
        del self._moments[at:]
        # a frame divides the motion around it; if that was unknown, both parts are
        new = replace(new, is_motion_unknown=bool(later) and later[0].is_motion_unknown)
        for moment in (new, *later):
            self._moments.append(self._after(self._moments[-1], moment))

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Possible present poses, most probable first; empty while the robot is not located."""
        return self._mixture.hypotheses

    @property
    def belief(self) -> PoseEstimate | NotLocated:
        """Present pose; further candidates are hypotheses with a probability of at least a tenth."""
        modes, hypotheses = self._mixture.modes, self.hypotheses
        if not hypotheses:
            if self._mixture.frame_s == -math.inf:
                return NotLocated("no frame has had a pose yet")
            return NotLocated("no frame has confirmed the pose for too long")
        best, *others = hypotheses
        candidates = (
            best.pose,
            *(other.pose for other in others if other.probability >= self.settings.min_candidate_probability),
        )
        return PoseEstimate(best.pose, best.covariance, modes[0].inlier_ratio, modes[0].residual_px, candidates)

    def prior(self, t_s: float) -> Pose2 | None:
        """Return the pose at a time as prior for its frame; None if unknown, or if the last frame contradicted it.

        After a contradiction the next frame is located without a prior, to decide which is right. After a spell of
        errors (`FrameErrors.spell_s`) without a decision, the most probable pose is the prior again.
        """
        prior = self.prior_estimate(t_s)
        return None if prior is None else prior.pose

    def prior_estimate(self, t_s: float) -> PoseEstimate | None:
        """Return `prior` with its covariance."""
        mixture = self._mixture
        if mixture.is_contradicted and t_s - mixture.frame_s < self.frame_errors.spell_s:
            return None
        return self.belief_at(t_s)

    def belief_at(self, t_s: float) -> PoseEstimate | None:
        """Return the most probable pose at a time by measurements up to it; None if unknown or before the history.

        Moving the present pose back by odometry would instead add the uncertainty of the slip since then.
        """
        odometry_pose = self._odometry_pose(t_s) if self._moments and math.isfinite(t_s) else None
        if odometry_pose is None:
            return None
        at = len(self._moments)
        while self._moments[at - 1].t_s > t_s:
            at -= 1
        then = self._moments[at - 1]
        if at < len(self._moments) and then.t_s < t_s:
            is_motion_unknown = self._moments[at].is_motion_unknown
            then = self._after(then, _Moment(t_s, odometry_pose, None, then.mixture, is_motion_unknown))
        if not then.mixture.modes:
            return None
        best = then.mixture.hypotheses[0]
        return PoseEstimate(best.pose, best.covariance, 1.0, 0.0)

    def motion_since(self, t_s: float) -> Pose2 | None:
        """Return the motion from a time to the present, in the robot's frame at that time; None before the history."""
        if not math.isfinite(t_s):
            return None
        if not self._moments:
            return _ORIGIN
        then = self._odometry_pose(t_s)
        return None if then is None else then.inverse().compose(self._moments[-1].odometry_pose)

    def forget(self) -> None:
        """Reset the filter."""
        self._moments.clear()
        self._now_s = None

    @property
    def _mixture(self) -> Mixture:
        return self._moments[-1].mixture if self._moments else self._nothing_known

    @property
    def _nothing_known(self) -> Mixture:
        return Mixture(near=self._expected, settings=self.settings, half=self.half)

    def _odometry_pose(self, t_s: float) -> Pose2 | None:
        """Return the pose by odometry alone at a time; None before the history."""
        later = self._moments[-1]
        if t_s >= later.t_s:
            return later.odometry_pose
        for before in reversed(self._moments):
            if before.t_s <= t_s:
                fraction = (t_s - before.t_s) / (later.t_s - before.t_s)
                step = before.odometry_pose.inverse().compose(later.odometry_pose)
                return before.odometry_pose.compose(
                    Pose2(fraction * step.x_m, fraction * step.y_m, fraction * step.theta_rad)
                )
            later = before
        return None

    def _after(self, before: _Moment, moment: _Moment) -> _Moment:
        """Return a moment after the previous one: first the motion up to it, then the update with its frame."""
        mixture, seconds = before.mixture, moment.t_s - before.t_s
        if seconds > 0.0 or moment.odometry_pose != before.odometry_pose:
            motion = before.odometry_pose.inverse().compose(moment.odometry_pose)
            mixture = mixture.move(motion, seconds, self.odometry_noise, self.frame_errors)
        if moment.is_motion_unknown:
            mixture = mixture.widen(seconds)
        if moment.estimate is not None:
            mixture = mixture.update(moment.estimate, moment.t_s, self.odometry_noise, self.frame_errors)
        if self._bound is not None:
            mixture = mixture.changed(self._bound.keep)
        return _Moment(moment.t_s, moment.odometry_pose, moment.estimate, mixture, moment.is_motion_unknown)
