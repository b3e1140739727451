"""One belief from many frames: the poses single frames tell, joined by odometry.

A Kalman filter over (x, y, theta), and beside it one rival: a place that frames name again and again while they
contradict the belief, as they do once a robot has been carried off.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import FloatArray, Pose2, compose_covariance, half_turn_covariance, wrap_angle

# odometry errs by this share of the way (slip, worn wheels), and, per root of a second, by pushes that no wheel feels
_ODOMETRY_SHARE = 0.2
_PUSH_M, _PUSH_RAD = 0.02, 0.05
# frames later than this are of no use
_HISTORY_S = 1.0
# squared Mahalanobis distance that one frame in a thousand exceeds, with 3 degrees of freedom
_GATE = 16.27
# a rival takes over once frames have named it for so long and so often
_RIVAL_S, _RIVAL_FRAMES = 0.4, 5
# frames that name the other half outweigh at most so many that named the believed one
_MOST_VOTES = 6
# a position less sure than this is no position
_LOST_STD_M = 0.5


@dataclass(slots=True)
class _Track:
    """A pose followed through time; `votes` counts frames that could tell the half of the field and named this one."""

    pose: Pose2
    covariance: FloatArray
    estimate: PoseEstimate
    votes: int
    since_s: float
    frames: int = 1

    def move(self, motion: Pose2, covariance: FloatArray) -> None:
        self.covariance = compose_covariance(self.pose, self.covariance, motion, covariance)
        self.pose = self.pose.compose(motion)

    def distance(self, pose: Pose2, covariance: FloatArray) -> float:
        """Squared Mahalanobis distance of a measured pose."""
        offset = _offset(pose, self.pose)
        return float(offset @ np.linalg.solve(self.covariance + covariance, offset))

    def absorb(self, pose: Pose2, covariance: FloatArray, estimate: PoseEstimate) -> None:
        gain = np.linalg.solve(self.covariance + covariance, self.covariance).T
        x, y, theta = (self.pose.array + gain @ _offset(pose, self.pose)).tolist()
        self.pose = Pose2(x, y, theta)
        rest = np.eye(3) - gain
        # Joseph's form, which stays symmetric and positive
        self.covariance = rest @ self.covariance @ rest.T + gain @ covariance @ gain.T
        self.estimate = estimate
        self.frames += 1

    def vote(self, count: int) -> None:
        self.votes = min(self.votes + count, _MOST_VOTES)
        if self.votes < 0:
            self.pose, self.covariance = self.pose.half_turn(), half_turn_covariance(self.covariance)
            self.votes = 1


@dataclass(frozen=True, slots=True)
class _Reading:
    """A pose that a frame allows, carried to the present; `votes` for the half it lies in, 0 where none is told."""

    pose: Pose2
    covariance: FloatArray
    votes: int


class PoseFilter:
    """Joins frames and odometry to a belief about where the robot is; one object a robot.

    Notes
    -----
    Call `predict` at each control step, `update` whenever a frame has been looked at, with the time it was taken: the
    odometry since then carries a late one to the present.

    A frame that allows several poses is taken for the one nearest to the belief, so the belief's half of a symmetric
    field is held. A frame whose goals tell that half votes for or against it; the belief turns over once the votes
    against it outnumber those for it, of which six are remembered.

    A frame that contradicts the belief changes nothing, but founds a rival. Frames that name the rival's place, moved
    by odometry, for 0.4 s, with none in between that agrees with the belief, make it the belief.
    """

    def __init__(self) -> None:
        self._track: _Track | None = None
        self._rival: _Track | None = None
        self._expected: Pose2 | None = None
        # (time, pose that odometry alone has led to)
        self._history: deque[tuple[float, Pose2]] = deque()

    def expect(self, pose: Pose2) -> None:
        """Say where the robot has probably been put: of what the first frame allows, the nearest is believed."""
        self._expected = pose

    def predict(self, odometry: Pose2, t_s: float) -> None:
        """Move the belief.

        Parameters
        ----------
        odometry : Pose2
            Motion since the call before, in the robot's frame then.
        t_s : float
            The present, seconds; never earlier than before.

        Raises
        ------
        ArgumentError
            The odometry is not finite, or time runs backwards.
        """
        if not all(map(math.isfinite, (odometry.x_m, odometry.y_m, odometry.theta_rad, t_s))):
            raise ArgumentError(f"odometry and its time must be finite, got {odometry} at {t_s!r} s")
        if not self._history:
            self._history.append((t_s, Pose2(0.0, 0.0, 0.0)))
            return
        before_s, place = self._history[-1]
        if t_s < before_s:
            raise ArgumentError(f"time must not run backwards, got {t_s!r} s after {before_s!r} s")
        self._history.append((t_s, place.compose(odometry)))
        while self._history[0][0] < t_s - _HISTORY_S:
            self._history.popleft()
        noise = _odometry_covariance(odometry, t_s - before_s)
        for track in (self._track, self._rival):
            if track is not None:
                track.move(odometry, noise)

    def update(self, estimate: PoseEstimate | NotLocated, t_s: float) -> None:
        """Take in what a frame tells.

        Parameters
        ----------
        estimate : PoseEstimate or NotLocated
            Of the robot; the latter tells nothing.
        t_s : float
            When the frame was taken. One from before the odometry that is remembered (1 s) tells nothing any more.
        """
        motion = self.motion_since(t_s)
        if not isinstance(estimate, PoseEstimate) or motion is None or not _is_finite(estimate):
            return
        now_s = self._history[-1][0] if self._history else t_s
        readings = _readings(estimate, motion, _odometry_covariance(motion, max(now_s - t_s, 0.0)))
        if self._track is None or self._is_lost:
            self._track, self._rival = _begin(self._likeliest(readings), estimate, now_s), None
        elif _follow(self._track, readings, estimate):
            self._rival = None
        elif self._rival is None or not _follow(self._rival, readings, estimate):
            self._rival = _begin(self._likeliest(readings), estimate, now_s)
        elif self._rival.frames >= _RIVAL_FRAMES and now_s - self._rival.since_s >= _RIVAL_S:
            self._track, self._rival = self._rival, None

    @property
    def belief(self) -> PoseEstimate | NotLocated:
        """Where the robot is now; with its half turn as second candidate while no frame has told the half."""
        track = self._track
        if track is None:
            return NotLocated("no frame has told a pose yet")
        if self._is_lost:
            return NotLocated("no frame has confirmed the pose for too long")
        candidates = (track.pose,) if track.votes else (track.pose, track.pose.half_turn())
        last = track.estimate
        return PoseEstimate(track.pose, track.covariance, last.inlier_share, last.residual_px, candidates)

    def prior(self, t_s: float) -> Pose2 | None:
        """Where the robot was at a time, to look at a frame of then; None where it is not known, or in doubt."""
        motion = self.motion_since(t_s)
        if self._track is None or self._is_lost or self._rival is not None or motion is None:
            return None
        return self._track.pose.compose(motion.inverse())

    def motion_since(self, t_s: float) -> Pose2 | None:
        """Motion from a time to the present, in the robot's frame of then; None before what is remembered."""
        if not math.isfinite(t_s):
            return None
        if not self._history or t_s >= self._history[-1][0]:
            return Pose2(0.0, 0.0, 0.0)
        later_s, later = self._history[-1]
        last = later
        for before_s, before in reversed(self._history):
            if before_s <= t_s:
                share = (t_s - before_s) / (later_s - before_s) if later_s > before_s else 0.0
                step = before.inverse().compose(later)
                then = before.compose(Pose2(share * step.x_m, share * step.y_m, share * step.theta_rad))
                return then.inverse().compose(last)
            later_s, later = before_s, before
        return None

    def forget(self) -> None:
        """Forget everything: the next frame founds a new belief."""
        self._track = self._rival = None
        self._history.clear()

    @property
    def _is_lost(self) -> bool:
        return (
            self._track is not None and max(self._track.covariance[0, 0], self._track.covariance[1, 1]) > _LOST_STD_M**2
        )

    def _likeliest(self, readings: list[_Reading]) -> _Reading:
        """Of what the frame allows, the nearest to where the robot was last believed; without that its first."""
        allowed = [reading for reading in readings if reading.votes >= 0]
        near = self._expected if self._track is None else self._track.pose
        return allowed[0] if near is None else min(allowed, key=lambda r: sum(r.pose.error_to(near)))


def _readings(estimate: PoseEstimate, motion: Pose2, noise: FloatArray) -> list[_Reading]:
    """Every pose the frame allows; where it allows one alone, its half turn too, with a vote against that half."""
    turned = (estimate.pose.half_turn(), half_turn_covariance(estimate.covariance))
    if len(estimate.candidates) == 1:
        allowed = [(estimate.pose, estimate.covariance, 1), (*turned, -1)]
    else:
        allowed = [(estimate.pose, estimate.covariance, 0)]
        for pose in estimate.candidates[1:]:
            is_turned = sum(pose.error_to(turned[0])) < 1e-6
            allowed.append((pose, turned[1] if is_turned else estimate.covariance, 0))
    return [
        _Reading(pose.compose(motion), compose_covariance(pose, covariance, motion, noise), votes)
        for pose, covariance, votes in allowed
    ]


def _begin(reading: _Reading, estimate: PoseEstimate, now_s: float) -> _Track:
    return _Track(reading.pose, reading.covariance, estimate, max(reading.votes, 0), now_s)


def _follow(track: _Track, readings: list[_Reading], estimate: PoseEstimate) -> bool:
    """Take in the nearest of the readings, unless even that contradicts the track."""
    distance, index = min((track.distance(r.pose, r.covariance), index) for index, r in enumerate(readings))
    if not distance <= _GATE:
        return False
    nearest = readings[index]
    track.absorb(nearest.pose, nearest.covariance, estimate)
    track.vote(nearest.votes)
    return True


def _offset(pose: Pose2, reference: Pose2) -> FloatArray:
    return np.array(
        [pose.x_m - reference.x_m, pose.y_m - reference.y_m, wrap_angle(pose.theta_rad - reference.theta_rad)]
    )


def _odometry_covariance(motion: Pose2, seconds: float) -> FloatArray:
    way = (_ODOMETRY_SHARE * math.hypot(motion.x_m, motion.y_m)) ** 2 + _PUSH_M**2 * seconds
    turn = (_ODOMETRY_SHARE * motion.theta_rad) ** 2 + _PUSH_RAD**2 * seconds
    return np.diag([way, way, turn])


def _is_finite(estimate: PoseEstimate) -> bool:
    poses = np.array([pose.array for pose in estimate.candidates])
    return bool(np.isfinite(poses).all() and np.isfinite(estimate.covariance).all())
