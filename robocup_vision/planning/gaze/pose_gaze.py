"""Where to turn the head so that the next frames tell the pose best (Miura and Shirai 2004, section 6.1).

Each landmark in view adds information about the pose; the pan that leaves the least uncertainty behind is taken.
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
from robocup_vision.disc import Disc
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.planning.gaze.field_landmarks import Kind, field_landmarks
from robocup_vision.planning.gaze.sight_lines import clear_probability
from robocup_vision.planning.gaze.sigma_points import sigma_points

Criterion = Literal["position", "volume"]

# a landmark so near the picture's border is not counted on, as a share of the width
_BORDER_SHARE = 0.03
# frames in a row that told nothing although they should have, before the head sweeps
_MAX_MISSES = 2
# a pose is never known better: m^2 and rad^2
_MIN_VARIANCE = 1e-12
# a head so near to where it shall look is there
_ARRIVED_RAD = 0.15
# pans whose outcome differs by less than this share are equally good: then the head moves least
_AS_GOOD = 0.02


@dataclass(frozen=True, slots=True)
class Detector:
    """How well landmarks of one kind are seen.

    Parameters
    ----------
    std_px : float
        Standard deviation along u and v, pixels of the camera's own picture.
    detection_probability : float
        How often it is found where it is in view.
    max_range_m : float
        Beyond, it is not found.
    alone_probability : float, optional
        How often a goal's post is found where the other one is not in view; without it as often as with it.
    """

    std_px: float
    detection_probability: float
    max_range_m: float
    alone_probability: float | None = None


# as the goal localiser sees posts, and the line localiser crossings, in rendered 208 x 160 pictures
# (benchmarks/planning/gaze_pose.py measures them anew); what this project has no detector for is taken
# to be seen as whole goals are
DETECTORS: Mapping[Kind, Detector] = {
    "post": Detector(0.3, 0.92, 6.0, alone_probability=0.5),
    "goal corner": Detector(0.3, 0.92, 6.0),
    "beacon": Detector(0.3, 0.92, 6.0),
    "crossing": Detector(1.2, 0.9, 2.5),
}
# what the goal localiser goes by
GOAL_DETECTORS: Mapping[Kind, Detector] = {"post": DETECTORS["post"]}


@dataclass(frozen=True, slots=True)
class Neck:
    """How a head pans.

    Parameters
    ----------
    limit_rad : float
        Farthest pan to either side.
    speed_rps : float
        How fast it turns.
    std_rad : float
        How well the camera's direction on a walking robot is known, about the upright and the level axis. All landmarks
        of a frame share that error.
    """

    limit_rad: float = math.pi / 2
    speed_rps: float = 8.0
    std_rad: float = 0.01

    def __post_init__(self) -> None:
        for name in ("limit_rad", "speed_rps"):
            if not 0 < getattr(self, name) < math.inf:
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)}")
        if not 0 <= self.std_rad < math.inf:
            raise ArgumentError(f"std_rad must not be negative, got {self.std_rad}")

    def sweep(self, t_s: float, period_s: float = 1.5) -> float:
        """Pan of a head that swings from one side to the other and back, once in a period."""
        return self.limit_rad * math.sin(math.tau * t_s / period_s)

    def turned(self, pan_rad: float, wanted_rad: float, seconds: float) -> float:
        """Pan that a head reaches in some time on its way to a wanted one; command no more and it is always known."""
        step = self.speed_rps * seconds
        wanted = max(-self.limit_rad, min(self.limit_rad, wanted_rad))
        return pan_rad + max(-step, min(step, wanted - pan_rad))


@dataclass(frozen=True, slots=True)
class Gaze:
    """Where to look.

    Parameters
    ----------
    pan_rad : float
        From straight ahead, positive to the left.
    planned : bool
        False: a sweep, since nothing can be planned.
    position_std_m : float
        What is expected to be left of the position's uncertainty: root of its trace; infinite for a sweep.
    landmarks : float
        Number of landmarks expected in a frame.
    reason : str
        Why, in words.
    """

    pan_rad: float
    planned: bool
    position_std_m: float
    landmarks: float
    reason: str


class PoseGaze:
    """Chooses pans for one robot; one object a head.

    Parameters
    ----------
    field : Field
        The pitch, with its landmarks.
    camera : PinholeCamera
        On the head; its pan counts for nothing, an unknown tilt or roll as 0.
    neck : Neck, optional
        How the head pans.
    criterion : {"position", "volume"}
        What to make small: the trace of the position's covariance, or the determinant of the pose's.
    horizon_s : float
        How far ahead frames are counted. A pan far from the present one leaves time for fewer.
    frame_s : float
        Time between frames.
    pans : int
        How many are compared.
    detectors : mapping of kind to Detector
        Which landmarks are seen, and how well.

    Notes
    -----
    With P grown by `drift` over the horizon, n frames left after the head has turned to psi, v_i the chance that
    landmark i is in view, found and not hidden, and I_i its information on (x, y, theta), the paper's sum becomes

        Lambda(psi)^-1 = P^-1 + n * (sum_i v_i(psi) I_i - what the neck's error, which all I_i share, takes away)

    once for each sigma point of the pose, from which other landmarks may be in view; their mean is what is expected.
    """

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        neck: Neck | None = None,
        *,
        criterion: Criterion = "position",
        horizon_s: float = 0.5,
        frame_s: float = 1 / 30,
        pans: int = 37,
        detectors: Mapping[Kind, Detector] = DETECTORS,
    ) -> None:
        if criterion not in ("position", "volume"):
            raise ArgumentError(f"criterion must be 'position' or 'volume', got {criterion!r}")
        if not 0 < frame_s <= horizon_s < math.inf:
            raise ArgumentError(f"frame_s must be positive and within horizon_s, got {frame_s} and {horizon_s}")
        if pans < 3:
            raise ArgumentError(f"pans must be at least 3, got {pans}")
        self.neck = neck = Neck() if neck is None else neck
        self._criterion = criterion
        self._horizon_s, self._frame_s = horizon_s, frame_s
        self._camera = camera.with_orientation(0.0, camera.tilt_rad or 0.0, camera.roll_rad or 0.0)
        marks = [mark for mark in field_landmarks(field) if mark.kind in detectors]
        self._marks = np.array([[m.x_m, m.y_m, m.height_m] for m in marks]).reshape(-1, 3)
        self._std_rad = np.array([detectors[m.kind].std_px / camera.focal_px[0] for m in marks])
        self._found = np.array([detectors[m.kind].detection_probability for m in marks])
        alone = [detectors[m.kind].alone_probability for m in marks]
        self._alone = np.array([f if a is None else a for a, f in zip(alone, self._found, strict=True)])
        # a post's ends find their partners at the goal's other post
        index = {(m.kind, m.x_m, m.y_m, m.height_m): i for i, m in enumerate(marks)}
        partner = [index.get(("post", m.x_m, -m.y_m, m.height_m), i) for i, m in enumerate(marks)]
        self._partner = np.array([p if marks[i].kind == "post" else i for i, p in enumerate(partner)], dtype=np.intp)
        self._max_range_m = np.array([detectors[m.kind].max_range_m for m in marks])
        self._pans = np.linspace(-neck.limit_rad, neck.limit_rad, pans)
        self._misses = 0
        # where the plan has the head look
        self._wanted: float | None = None

    def observe(self, found: bool, pan_rad: float) -> None:
        """Say whether a frame told anything of the pose, and at which pan it was taken.

        After two in a row that told nothing from where the plan had the head look, the head sweeps until one does.
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
            Where the robot is believed to be.
        t_s : float
            Now; a sweep goes by it.
        pan_rad : float
            Where the head is.
        blockers : sequence of Disc
            Robots that may hide landmarks.
        drift : (3, 3) float64, optional
            How the pose's covariance grows in a second without frames, field frame.

        Raises
        ------
        ArgumentError
            The drift is not (3, 3), or something is not finite.
        """
        if not (math.isfinite(t_s) and math.isfinite(pan_rad)):
            raise ArgumentError(f"time and pan must be finite, got {t_s} s and {pan_rad} rad")
        self._wanted = None
        if not belief:
            return self._sweep(t_s, "the pose is not known")
        if self._misses >= _MAX_MISSES:
            return self._sweep(t_s, f"{self._misses} frames in a row told nothing")
        assert isinstance(belief, PoseEstimate)
        growth = np.zeros((3, 3)) if drift is None else np.asarray(drift, dtype=np.float64)
        if growth.shape != (3, 3) or not np.isfinite(growth).all():
            raise ArgumentError(f"drift must be a finite (3, 3) array, got {drift!r}")
        shares = self._shares(belief.pose, belief.covariance, blockers)
        prior = belief.covariance + growth * self._horizon_s + _MIN_VARIANCE * np.eye(3)
        left = self._left(prior, belief.pose, shares, pan_rad)
        score = left[:, 0, 0] + left[:, 1, 1] if self._criterion == "position" else np.linalg.det(left)
        counts = shares.sum(axis=2).mean(axis=0)
        if not counts.max(initial=0.0) > 0.5:
            return self._sweep(t_s, "no landmark can be in view")
        as_good = np.flatnonzero(score <= score.min() * (1 + _AS_GOOD))
        best = int(as_good[np.argmin(np.abs(self._pans[as_good] - pan_rad))])
        std = math.sqrt(float(left[best, 0, 0] + left[best, 1, 1]))
        before = math.sqrt(float(prior[0, 0] + prior[1, 1]))
        reason = f"{counts[best]:.1f} landmarks there leave {std:.3f} m of {before:.3f} m"
        self._wanted = float(self._pans[best])
        return Gaze(self._wanted, True, std, float(counts[best]), reason)

    def _sweep(self, t_s: float, why: str) -> Gaze:
        return Gaze(self.neck.sweep(t_s), False, math.inf, 0.0, f"sweep: {why}")

    def _shares(self, pose: Pose2, covariance: FloatArray, blockers: Sequence[Disc]) -> FloatArray:
        """Chance (S, P, L) that each pan shows each landmark, from each sigma point of the pose."""
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
        border = _BORDER_SHARE * width
        with np.errstate(invalid="ignore"):
            inside = (pixels[..., 0] >= border) & (pixels[..., 0] <= width - 1 - border)
            inside &= (pixels[..., 1] >= border) & (pixels[..., 1] <= height - 1 - border)
        inside &= (np.hypot(way[..., 0], way[..., 1]) < self._max_range_m)[:, None]
        eye = pose.transform(self._camera.offset_m)
        clear = clear_probability((*eye, self._camera.height_m), self._marks, blockers)
        both = (inside & inside[..., self._partner]) * clear[self._partner]
        return np.asarray(clear * (self._alone * inside + (self._found - self._alone) * both))

    def _left(self, prior: FloatArray, pose: Pose2, shares: FloatArray, pan_rad: float) -> FloatArray:
        """Covariance (P, 3, 3) that each pan is expected to leave at the horizon, the mean over the sigma points."""
        waits = np.abs(self._pans - pan_rad) / self.neck.speed_rps
        frames = np.maximum((self._horizon_s - waits) / self._frame_s, 1.0)
        rows = self._rows(pose)
        told = np.tensordot(shares, np.einsum("lki,lkj->lij", rows, rows), 1)
        # an error that a frame's landmarks share is one more unknown, and the sum is what is left when it is taken out
        weight = 1 / self._std_rad
        by_neck = np.tensordot(shares, rows * weight[:, None, None], 1)
        freedom = 1 / max(self.neck.std_rad, 1e-6) ** 2 + shares @ weight**2
        told -= np.swapaxes(by_neck, -1, -2) @ by_neck / freedom[..., None, None]
        return np.asarray(np.linalg.inv(np.linalg.inv(prior) + frames[:, None, None] * told).mean(axis=0))

    def _rows(self, pose: Pose2) -> FloatArray:
        """How bearing and elevation of each landmark change with (x, y, theta), in standard deviations (L, 2, 3)."""
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
