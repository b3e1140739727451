"""Moving objects over time: Kalman filters in track-splitting trees (Miura 2004, section 2.4).

Where a return inside known free space may belong to one object or to another, or to none, every feasible association
is followed as a branch of that object's tree until likelihood parts them; the branches of all trees are chosen
together. An object not seen is more likely where something hides it, and is followed there. Each is reported once
there is enough evidence against clutter, and then while it is more likely than not where the report says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.belief import Track
from robocup_vision.geometry import Pose2
from robocup_vision.tracking.branches import Branches
from robocup_vision.tracking.detections import Detection, in_field
from robocup_vision.tracking.joint_choice import choose_together
from robocup_vision.tracking.shadows import Shadows

# log odds that a detection which nothing explains is a new object, at which one is believed in, and is given up
_FIRST, _CONFIRMED, _DELETED = -3.0, 4.0, -3.0
# unseen: an object is gone after so long on average, and its velocity forgotten
_LIFETIME_S, _STEADY_S = 100.0, 1.5
# a report is right within this share of the object's width
_NEAR_SHARE = 2 / 3


@dataclass(slots=True)
class _Tree:
    frames: int = 1
    detections: int = 1
    confirmed: bool = False


@dataclass(slots=True)
class MovingObjects:
    """Follows what moves on the field; one object a robot, called once a frame.

    Parameters
    ----------
    acceleration_mps2 : float
        How hard the objects accelerate: standard deviation of the white acceleration that the filters allow.
    speed_mps : float
        How fast they may be at first sight: standard deviation.
    detection_probability : float
        Share of the frames in which an object is detected that nothing hides.
    clutter_per_m2 : float
        False detections a frame and square metre.
    min_frames : int
        Objects are reported after this many detections at the earliest.
    coast_s : float
        Objects not seen for longer than this are given up.
    width_m : float
        Of the objects: what they hide, and what is seen of one in several pieces.
    max_branches : int
        Branches kept of each object's tree.

    Raises
    ------
    ArgumentError
        If one of them is out of range.
    """

    acceleration_mps2: float = 1.5
    speed_mps: float = 0.7
    detection_probability: float = 0.8
    clutter_per_m2: float = 0.2
    min_frames: int = 3
    coast_s: float = 3.0
    width_m: float = 0.18
    max_branches: int = 12
    _trees: dict[int, _Tree] = field(default_factory=dict, init=False, repr=False)
    _branches: Branches = field(init=False, repr=False)
    _t_s: float | None = field(default=None, init=False, repr=False)
    _next: int = field(default=1, init=False, repr=False)
    _detections: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        positive = ("acceleration_mps2", "speed_mps", "clutter_per_m2", "coast_s", "width_m")
        for name in (*positive, "min_frames", "max_branches"):
            if not getattr(self, name) > 0:
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)}")
        if not 0 < self.detection_probability < 1:
            raise ArgumentError(f"detection_probability must be within 0 to 1, got {self.detection_probability}")
        nothing = np.empty(0, dtype=np.int64)
        self._branches = Branches.initiated(
            nothing, np.empty((0, 2)), np.empty((0, 2, 2)), self.speed_mps, 0.0, nothing
        )

    def update(
        self, t_s: float, detections: Sequence[Detection], robot: Pose2, robot_covariance: FloatArray | None = None
    ) -> tuple[Track, ...]:
        """Take the detections of a frame.

        Parameters
        ----------
        t_s : float
            When it was taken; later than the frame before.
        detections : sequence of Detection
            What was seen inside known free space.
        robot : Pose2
            The robot in the field frame then.
        robot_covariance : (3, 3) float64, optional
            Of that; adds to each detection's own.

        Returns
        -------
        tuple of Track
            The objects believed in, by their numbers.

        Raises
        ------
        ArgumentError
            If time does not advance.
        """
        if self._t_s is not None and not t_s > self._t_s:
            raise ArgumentError(f"t_s must advance, got {t_s} after {self._t_s}")
        seconds = 0.0 if self._t_s is None else t_s - self._t_s
        self._t_s = t_s
        places, spreads = in_field(detections, robot, robot_covariance)
        numbers = self._detections + np.arange(len(places))
        self._detections += len(places)
        branches = self._branches.predicted(seconds, self.acceleration_mps2, _STEADY_S, _LIFETIME_S)
        view = Shadows(robot.array[:2], places, 0.5 * self.width_m)
        branches = branches.split(places, spreads, numbers, self.detection_probability, self.clutter_per_m2, view)
        chosen = choose_together(branches)
        now = branches.select(chosen)
        lost = self._keep_score(now)
        branches = branches.pruned(chosen, self.max_branches)
        branches = branches.select(np.flatnonzero(~np.isin(branches.tree, list(lost))))
        now = now.select(np.flatnonzero(~np.isin(now.tree, list(lost))))
        for number in lost:
            del self._trees[number]
        fresh = self._unexplained(now, places, numbers)
        trees = self._next + np.arange(len(fresh))
        self._next += len(fresh)
        for number in trees.tolist():
            self._trees[number] = _Tree()
        initiated = Branches.initiated(trees, places[fresh], spreads[fresh], self.speed_mps, _FIRST, numbers[fresh])
        self._branches = branches.concatenate(initiated)
        return tuple(self._tracks(now))

    def _unexplained(self, now: Branches, places_m: FloatArray, numbers: Int64Array) -> Int64Array:
        """Return detections that no tree has and no object believed in covers: one may be seen in several pieces."""
        confirmed = np.array([self._trees[number].confirmed for number in now.tree.tolist()], dtype=bool)
        away = np.linalg.norm(places_m[:, None] - now.mean[confirmed, :2], axis=-1)
        apart = (away > self.width_m).all(axis=1)
        return np.flatnonzero(~np.isin(numbers, now.history[:, 0]) & apart)

    def _keep_score(self, now: Branches) -> set[int]:
        """Bring the trees up to date by their branches of this frame; which of them are lost."""
        lost = set(self._trees) - set(now.tree.tolist())
        for index, number in enumerate(now.tree.tolist()):
            tree, odds = self._trees[number], float(now.odds[index])
            tree.frames += 1
            tree.detections += int(now.missed[index] == 0)
            tree.confirmed |= odds >= _CONFIRMED and tree.detections >= self.min_frames
            if odds < _DELETED or now.coasted_s[index] > self.coast_s:
                lost.add(number)
        return lost

    def _tracks(self, now: Branches) -> list[Track]:
        tracks = []
        for index, number in enumerate(now.tree.tolist()):
            tree, covariance = self._trees[number], now.covariance[index]
            area = math.sqrt(covariance[0, 0] * covariance[1, 1] - covariance[0, 1] ** 2)
            near = 1 - math.exp(-((_NEAR_SHARE * self.width_m) ** 2) / (2 * area))
            probability = near / (1 + math.exp(-float(now.odds[index])))
            if tree.confirmed and probability > 0.5:
                x, y, vx, vy = now.mean[index].tolist()
                missed = int(now.missed[index])
                tracks.append(Track(number, x, y, vx, vy, covariance, probability, tree.frames, missed))
        return tracks
