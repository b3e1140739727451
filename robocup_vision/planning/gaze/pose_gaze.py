"""Chooses the pan of the head at which the next frames measure the pose best (Miura and Shirai 2004, section 6.1).

Each landmark in view adds information about the pose. The planner takes the pan with the least expected uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.checks import require_not_negative, require_positive
from robocup_vision.disc import Disc
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.planning.gaze.field_landmarks import Kind, field_landmarks
from robocup_vision.planning.gaze.uncertainty import clear_probability, sigma_points

Criterion = Literal["position", "volume"]

# number of pans compared: over half a turn they are 5 degrees apart, a tenth of a usual field of view
PANS = 37
# A landmark within this fraction of the picture's width from its border is not counted: the picture cuts it off.
_BORDER_RATIO = 0.03
# pans whose criterion differs by less than this fraction count as equal. Then the head moves least.
_AS_GOOD_RATIO = 0.02
_MIN_LANDMARKS = 0.5  # expected landmarks in view from which a pan is worth planning
_MAX_MISSES = 2  # frames in a row without a pose, taken at the planned pan, after which the head sweeps
_ARRIVED_RAD = 0.15  # largest difference from the planned pan at which a frame counts as taken there
# keeps a covariance invertible, m^2 and rad^2
_MIN_VARIANCE = 1e-12


@dataclass(frozen=True, slots=True)
class Detector:
    """How well landmarks of one kind are detected."""

    std_px: float  #: standard deviation along u and v, pixels of the camera's own picture
    detection_probability: float  #: probability that a landmark in view is found
    max_range_m: float  #: beyond this range it is not found
    #: probability that a goal's post is found while the other post is not in view; None: `detection_probability`
    alone_probability: float | None = None


# Posts as measured by the goal localiser, and crossings by the line localiser, in rendered 208 x 160 pictures
# (benchmarks/planning/gaze_pose.py measures them again). Kinds that were not measured have the values of whole goals.
DETECTORS: Mapping[Kind, Detector] = {
    "post": Detector(0.3, 0.92, 6.0, alone_probability=0.5),
    "goal corner": Detector(0.3, 0.92, 6.0),
    "beacon": Detector(0.3, 0.92, 6.0),
    "crossing": Detector(1.2, 0.9, 2.5),
}
# the landmarks that the goal localiser uses
GOAL_DETECTORS: Mapping[Kind, Detector] = {"post": DETECTORS["post"]}


@dataclass(frozen=True, slots=True)
class Neck:
    """The limits and the error of a head's pan."""

    limit_rad: float = math.pi / 2  #: greatest pan to either side
    speed_rps: float = 8.0  #: turning rate
    #: standard deviation of the camera's direction on a walking robot, about the vertical and the horizontal axis. All
    #: landmarks of a frame have this error in common.
    std_rad: float = 0.01

    def __post_init__(self) -> None:
        require_positive(self, "limit_rad", "speed_rps")
        require_not_negative(self, "std_rad")

    def sweep(self, t_s: float, period_s: float = 1.5) -> float:
        """Return the pan of a head that turns from one side to the other and back, once in a period."""
        return self.limit_rad * math.sin(math.tau * t_s / period_s)

    def turned(self, pan_rad: float, wanted_rad: float, seconds: float) -> float:
        """Return the pan that a head has reached after `seconds` on its way to a wanted pan."""
        step = self.speed_rps * seconds
        wanted = max(-self.limit_rad, min(self.limit_rad, wanted_rad))
        return pan_rad + max(-step, min(step, wanted - pan_rad))


@dataclass(frozen=True, slots=True)
class Gaze:
    """A chosen pan."""

    pan_rad: float  #: from straight ahead, positive to the left
    planned: bool  #: False: a sweep, since nothing can be planned
    #: expected uncertainty of the position: square root of the covariance's trace; infinite for a sweep
    position_std_m: float
    landmarks: float  #: number of landmarks expected in a frame
    reason: str  #: the reason, as text


@dataclass(frozen=True, slots=True)
class PoseGazeSettings:
    """How `PoseGaze` compares pans.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    #: what is minimised: the trace of the position's covariance, or the determinant of the pose's
    criterion: Criterion = "position"
    #: time ahead in which frames are counted. A pan far from the present one leaves time for fewer.
    horizon_s: float = 0.5
    frame_s: float = 1 / 30  #: time between frames

    def __post_init__(self) -> None:
        if self.criterion not in ("position", "volume"):
            raise ArgumentError(f"criterion must be 'position' or 'volume', got {self.criterion!r}")
        if not 0 < self.frame_s <= self.horizon_s < math.inf:
            raise ArgumentError(
                f"frame_s must be positive and within horizon_s, got {self.frame_s} and {self.horizon_s}"
            )


class PoseGaze:
    """Chooses pans for one robot; one object per head.

    Parameters
    ----------
    field : Field
        The pitch, with its landmarks.
    camera : PinholeCamera
        The camera on the head; its pan is ignored, an unknown tilt or roll counts as 0.
    detectors : mapping of kind to Detector
        The kinds of landmarks that are detected, and how well.

    Notes
    -----
    With P grown by `drift` over the horizon, n frames left after the head has turned to psi, v_i the probability that
    landmark i is in view, found and not hidden, and I_i its information on (x, y, theta), the paper's sum becomes

        Lambda(psi)^-1 = P^-1 + n * (sum_i v_i(psi) I_i - the part lost by the neck's error, which all I_i contain)

    once for each sigma point of the pose, since other landmarks may be in view from there. The mean is the expectation.
    """

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        neck: Neck | None = None,
        *,
        detectors: Mapping[Kind, Detector] = DETECTORS,
        settings: PoseGazeSettings = PoseGazeSettings(),
    ) -> None:
        self.neck = neck = Neck() if neck is None else neck
        self._settings = settings
        self._camera = camera.with_orientation(0.0, camera.tilt_rad or 0.0, camera.roll_rad or 0.0)
        marks = [mark for mark in field_landmarks(field) if mark.kind in detectors]
        self._marks = np.array([[m.x_m, m.y_m, m.height_m] for m in marks]).reshape(-1, 3)
        self._std_rad = np.array([detectors[m.kind].std_px / camera.focal_px[0] for m in marks])
        self._found = np.array([detectors[m.kind].detection_probability for m in marks])
        alone = [detectors[m.kind].alone_probability for m in marks]
        self._alone = np.array([f if a is None else a for a, f in zip(alone, self._found, strict=True)])
        # the partner of a post's end is the same end of the goal's other post, that of another landmark itself
        index = {(m.kind, m.x_m, m.y_m, m.height_m): i for i, m in enumerate(marks)}
        partner = [index.get(("post", m.x_m, -m.y_m, m.height_m), i) for i, m in enumerate(marks)]
        self._partner = np.array([p if marks[i].kind == "post" else i for i, p in enumerate(partner)], dtype=np.intp)
        self._max_range_m = np.array([detectors[m.kind].max_range_m for m in marks])
        self._pans = np.linspace(-neck.limit_rad, neck.limit_rad, PANS)
        self._misses = 0
        # pan of the last plan
        self._wanted: float | None = None

    def observe(self, found: bool, pan_rad: float) -> None:
        """Update with whether a frame gave a pose, and the pan at which it was taken.

        After two successive frames without a pose at the planned pan, the head sweeps until a frame gives one.
        """
        if found:
            self._misses = 0
        elif self._wanted is not None and abs(pan_rad - self._wanted) < _ARRIVED_RAD:
            self._misses += 1

    def choose(
        self,
        belief: PoseEstimate | NotLocated,
        t_s: float,
        pan_rad: float = 0.0,
        blockers: Sequence[Disc] = (),
        drift: FloatArray | None = None,
    ) -> Gaze:
        """Choose where to look.

        Parameters
        ----------
        belief : PoseEstimate or NotLocated
            Estimated pose of the robot.
        t_s : float
            Now; a sweep depends on it.
        blockers : sequence of Disc
            Robots that may hide landmarks.
        drift : (3, 3) float64, optional
            Growth of the pose's covariance in a second without frames, field frame.

        Raises
        ------
        ArgumentError
            The drift is not (3, 3), or an argument is not finite.
        """
        if not (math.isfinite(t_s) and math.isfinite(pan_rad)):
            raise ArgumentError(f"time and pan must be finite, got {t_s} s and {pan_rad} rad")
        self._wanted = None
        if not belief:
            return self._sweep(t_s, "the pose is not known")
        if self._misses >= _MAX_MISSES:
            return self._sweep(t_s, f"{self._misses} frames in a row had no pose")
        assert isinstance(belief, PoseEstimate)
        growth = np.zeros((3, 3)) if drift is None else np.asarray(drift, dtype=np.float64)
        if growth.shape != (3, 3) or not np.isfinite(growth).all():
            raise ArgumentError(f"drift must be a finite (3, 3) array, got {drift!r}")
        visible = self._visible(belief.pose, belief.covariance, blockers)
        prior = belief.covariance + growth * self._settings.horizon_s + _MIN_VARIANCE * np.eye(3)
        posterior = self._posterior(prior, belief.pose, visible, pan_rad)
        is_by_position = self._settings.criterion == "position"
        score = posterior[:, 0, 0] + posterior[:, 1, 1] if is_by_position else np.linalg.det(posterior)
        counts = visible.sum(axis=2).mean(axis=0)
        if not counts.max(initial=0.0) > _MIN_LANDMARKS:
            return self._sweep(t_s, "no landmark can be in view")
        as_good = np.flatnonzero(score <= score.min() * (1 + _AS_GOOD_RATIO))
        best = int(as_good[np.argmin(np.abs(self._pans[as_good] - pan_rad))])
        std = math.sqrt(float(posterior[best, 0, 0] + posterior[best, 1, 1]))
        before = math.sqrt(float(prior[0, 0] + prior[1, 1]))
        reason = f"{counts[best]:.1f} landmarks there leave {std:.3f} m of {before:.3f} m"
        self._wanted = float(self._pans[best])
        return Gaze(self._wanted, True, std, float(counts[best]), reason)

    def _sweep(self, t_s: float, why: str) -> Gaze:
        return Gaze(self.neck.sweep(t_s), False, math.inf, 0.0, f"sweep: {why}")

    def _visible(self, pose: Pose2, covariance: FloatArray, blockers: Sequence[Disc]) -> FloatArray:
        """Return the probability (S, P, L) that a landmark is found, for each sigma point of the pose and each pan."""
        points = sigma_points(pose, covariance)
        heading = points[:, 2, None] + self._pans
        c, s = np.cos(points[:, 2]), np.sin(points[:, 2])
        forward, left = self._camera.offset_m
        eyes = points[:, :2] + np.column_stack([c * forward - s * left, s * forward + c * left])
        way = self._marks[None, :, :2] - eyes[:, None]
        c, s = np.cos(heading)[..., None], np.sin(heading)[..., None]
        x, y = way[:, None, :, 0], way[:, None, :, 1]
        up = np.broadcast_to(self._marks[:, 2] - self._camera.height_m, (*heading.shape, len(self._marks)))
        pixels = self._camera.ray_to_pixel(np.stack([c * x + s * y, c * y - s * x, up], axis=-1))
        width, height = self._camera.size_px
        border = _BORDER_RATIO * width
        with np.errstate(invalid="ignore"):
            inside = (pixels[..., 0] >= border) & (pixels[..., 0] <= width - 1 - border)
            inside &= (pixels[..., 1] >= border) & (pixels[..., 1] <= height - 1 - border)
        inside &= (np.hypot(way[..., 0], way[..., 1]) < self._max_range_m)[:, None]
        eye = pose.transform(self._camera.offset_m)
        clear = clear_probability((*eye, self._camera.height_m), self._marks, blockers)
        both = (inside & inside[..., self._partner]) * clear[self._partner]
        return np.asarray(clear * (self._alone * inside + (self._found - self._alone) * both))

    def _posterior(self, prior: FloatArray, pose: Pose2, visible: FloatArray, pan_rad: float) -> FloatArray:
        """Return the covariance (P, 3, 3) expected at the horizon for each pan, the mean over the sigma points."""
        waits = np.abs(self._pans - pan_rad) / self.neck.speed_rps
        frames = np.maximum((self._settings.horizon_s - waits) / self._settings.frame_s, 1.0)
        rows = self._rows(pose)
        information = np.tensordot(visible, np.einsum("lki,lkj->lij", rows, rows), 1)
        # the error that a frame's landmarks have in common is one more unknown, which the Schur complement eliminates
        weight = 1 / self._std_rad
        by_neck = np.tensordot(visible, rows * weight[:, None, None], 1)
        freedom = 1 / max(self.neck.std_rad, 1e-6) ** 2 + visible @ weight**2
        information -= np.swapaxes(by_neck, -1, -2) @ by_neck / freedom[..., None, None]
        return np.asarray(np.linalg.inv(np.linalg.inv(prior) + frames[:, None, None] * information).mean(axis=0))

    def _rows(self, pose: Pose2) -> FloatArray:
        """Return the derivatives (L, 2, 3) of each landmark's bearing and elevation by the pose, over their std."""
        forward, left = self._camera.offset_m
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        arm = np.array([-s * forward - c * left, c * forward - s * left])
        way = self._marks[:, :2] - (pose.x_m + c * forward - s * left, pose.y_m + s * forward + c * left)
        away = np.maximum(np.hypot(way[:, 0], way[:, 1]), 0.05)
        up = self._marks[:, 2] - self._camera.height_m
        rows = np.empty((len(self._marks), 2, 3))
        rows[:, 0, 0], rows[:, 0, 1] = way[:, 1] / away**2, -way[:, 0] / away**2
        rows[:, 1, :2] = (up / (away**2 + up**2) / away)[:, None] * way
        rows[..., 2] = rows[..., :2] @ arm
        rows[:, 0, 2] -= 1.0
        return np.asarray(rows / self._std_rad[:, None, None])
