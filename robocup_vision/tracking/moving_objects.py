"""Moving objects over time: Kalman filters in track-splitting trees (Miura 2004, section 2.4).

A detection may belong to one object, to another, or to none. Every feasible association is followed as a branch of that
object's tree until the likelihoods differ enough. The branches of all trees are chosen together. An object without a
detection is more likely where something hides it, and is followed there. An object is reported once there is enough
evidence against clutter, and then for as long as it is more likely than not near the reported position.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.belief import Track
from robocup_vision.geometry import Pose2
from robocup_vision.tracking.branches import MAX_STEPS, Branches, MovingObjectsSettings
from robocup_vision.tracking.detections import Detection, in_field

# greatest error of a correct position, in widths of an object, by which a track's probability is defined
_NEAR_RATIO = 2 / 3


@dataclass(slots=True)
class _Tree:
    frames: int = 1
    detections: int = 1
    confirmed: bool = False


class MovingObjects:
    """Tracks moving objects on the field; one instance for each robot, called once for each frame.

    Parameters
    ----------
    settings : MovingObjectsSettings, optional
        How objects move, how they are detected, and when one is reported.
    """

    def __init__(self, settings: MovingObjectsSettings = MovingObjectsSettings()) -> None:
        self.settings = settings
        self.forget()

    def forget(self) -> None:
        """Delete all tracks: the next frame is the first."""
        self._trees: dict[int, _Tree] = {}
        nothing = np.empty(0, dtype=np.int64)
        self._branches = Branches.initiated(nothing, np.empty((0, 2)), np.empty((0, 2, 2)), nothing, self.settings)
        self._t_s: float | None = None
        # numbers of the next track and of the next detection
        self._next = 1
        self._detections = 0

    def update(
        self, t_s: float, detections: Sequence[Detection], robot: Pose2, robot_covariance: FloatArray | None = None
    ) -> tuple[Track, ...]:
        """Update with the detections of a frame.

        Parameters
        ----------
        t_s : float
            Time of the frame; later than that of the frame before.
        detections : sequence of Detection
            Detections inside known free space.
        robot : Pose2
            Pose of the robot at that time, field frame.
        robot_covariance : (3, 3) float64, optional
            Covariance of the pose, which is added to that of each detection.

        Returns
        -------
        tuple of Track
            The confirmed objects that are probably near their estimated positions.

        Raises
        ------
        ArgumentError
            If time does not advance.
        """
        if self._t_s is not None and not t_s > self._t_s:
            raise ArgumentError(f"t_s must advance, got {t_s} after {self._t_s}: forget() begins a run anew")
        seconds = 0.0 if self._t_s is None else t_s - self._t_s
        self._t_s = t_s
        places, spreads = in_field(detections, robot, robot_covariance)
        numbers = self._detections + np.arange(len(places))
        self._detections += len(places)
        settings = self.settings
        branches = self._branches.split(seconds, places, spreads, numbers, robot.array[:2], settings)
        chosen = branches.choose_together(MAX_STEPS)
        now = branches.select(chosen)
        lost = self._keep_score(now)
        branches = branches.pruned(chosen)
        if lost:
            branches, now = branches.without(lost), now.without(lost)
            for number in lost:
                del self._trees[number]
        fresh = self._unexplained(now, places, numbers)
        if len(fresh):
            trees = self._next + np.arange(len(fresh))
            self._next += len(fresh)
            for number in trees.tolist():
                self._trees[number] = _Tree()
            initiated = Branches.initiated(trees, places[fresh], spreads[fresh], numbers[fresh], settings)
            branches = branches.concatenate(initiated)
        self._branches = branches
        return tuple(self._tracks(now))

    def _unexplained(self, now: Branches, places_m: FloatArray, numbers: Int64Array) -> Int64Array:
        """Return the indices of detections that begin new trees: without a tree, and apart from confirmed objects.

        One object may be detected in several pieces.
        """
        taken = set(now.history[:, 0].tolist())
        free = [index for index, number in enumerate(numbers.tolist()) if number not in taken]
        confirmed = [index for index, number in enumerate(now.tree.tolist()) if self._trees[number].confirmed]
        covered = now.mean[confirmed, :2].tolist()
        width_m, places = self.settings.width_m, places_m.tolist()
        fresh = [n for n in free if all(math.dist(places[n], place) > width_m for place in covered)]
        return np.array(fresh, dtype=np.int64)

    def _keep_score(self, now: Branches) -> set[int]:
        """Update the trees by their chosen branches in this frame; return the numbers of the trees to delete."""
        lost = set(self._trees) - set(now.tree.tolist())
        for index, number in enumerate(now.tree.tolist()):
            tree, odds = self._trees[number], float(now.odds[index])
            tree.frames += 1
            tree.detections += int(now.missed[index] == 0)
            tree.confirmed |= odds >= self.settings.confirmed_log_odds and tree.detections >= self.settings.min_frames
            if odds < self.settings.deleted_log_odds or now.coasted_s[index] > self.settings.coast_s:
                lost.add(number)
        return lost

    def _tracks(self, now: Branches) -> list[Track]:
        tracks = []
        for index, number in enumerate(now.tree.tolist()):
            tree, covariance = self._trees[number], now.covariance[index]
            area = math.sqrt(covariance[0, 0] * covariance[1, 1] - covariance[0, 1] ** 2)
            near = 1 - math.exp(-((_NEAR_RATIO * self.settings.width_m) ** 2) / (2 * area))
            probability = near / (1 + math.exp(-float(now.odds[index])))
            if tree.confirmed and probability > 0.5:
                x, y, vx, vy = now.mean[index].tolist()
                missed = int(now.missed[index])
                tracks.append(Track(number, x, y, vx, vy, covariance, probability, tree.frames, missed))
        return tracks
