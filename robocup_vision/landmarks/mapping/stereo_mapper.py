"""Builds the landmark map from a run with three cameras (Ogawa et al. 2011, section 2), with bounded drift.

The paper tracks each frame against the map and adds new landmarks. In addition, poses and landmarks of the last frames
are adjusted jointly, and those of the whole run when a loop closes and at the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.landmarks.features import KNOWN_RATIO, Extractor, Features, SiftExtractor, match, near
from robocup_vision.landmarks.landmark_map import LandmarkMap, direction_of, expect
from robocup_vision.landmarks.mapping.draft import DraftMap
from robocup_vision.landmarks.mapping.refinement import Observations, refine
from robocup_vision.landmarks.mapping.run_files import TrinocularRig
from robocup_vision.landmarks.mapping.stereo import StereoPoints, correspond
from robocup_vision.landmarks.pose_fit import CHI2_3DOF, PoseFit, fit_stereo, to_world, world_to_camera

# pixels are those of an image 320 wide, and are scaled with the width
# half the paper's window, along u and v, around a landmark's pixel by the predicted pose
_GATE_PX = (40.0, 20.0)
_WIDER = 2.0  # factor on the window for a second attempt after too few inliers
# greatest factor between a stereo point's depth and the expected one: the stereo error at 5 m
_DEPTH_RATIO = 1.25
_KNOWN_GATE_PX = 6.0  # half the window after the pose has been fitted
# a pose has three unknowns, and each landmark gives three numbers: eight are redundant enough to reject a wrong pose
_MIN_INLIERS = 8
_MIN_INLIER_RATIO = 0.4  # least inlier ratio of the matches
# number of moments whose poses and landmarks are adjusted jointly, and number of moments between adjustments
_WINDOW = 12
_REFINE_EVERY = 4
# a loop closes when this number of landmarks is seen again after being out of view for this number of moments
_AWAY_FRAMES = 30
_MIN_RETURNED = 12


@dataclass(frozen=True, slots=True)
class MapStep:
    """Result of adding one moment to the map."""

    pose: PoseEstimate | NotLocated  #: pose of the robot; a moment without one is left out of the map
    stereo_points: int  #: number of features seen by all three cameras
    matched: int  #: number of these that are known landmarks
    closes_loop: bool = False  #: whether landmarks were seen again after a long time


class StereoMapper:
    """Makes a landmark map, moment by moment; a moment is one image of each of the three cameras.

    Parameters
    ----------
    start : Pose2
        Pose of the robot at the first moment, field frame.
    bound_drift : bool
        Adjust poses and landmarks jointly; without it, as in the paper, errors add up along the run.
    extractor : Extractor, optional
        Finds the features of all three cameras; SIFT by default.
    """

    def __init__(
        self,
        rig: TrinocularRig,
        start: Pose2,
        *,
        bound_drift: bool = True,
        extractor: Extractor | None = None,
    ) -> None:
        self.rig = rig
        self._start = start
        self._bound_drift = bound_drift
        self._extractor = extractor or SiftExtractor(rig.right)
        self._draft = DraftMap()
        self._poses: list[FloatArray] = []
        self._pose_covariances: list[FloatArray] = []
        self._lost_motion = Pose2(0.0, 0.0, 0.0)
        self._last_closure = 0

    @property
    def poses(self) -> tuple[Pose2, ...]:
        """Estimates of the robot's pose at every moment of the map."""
        return tuple(Pose2(*(float(v) for v in pose)) for pose in self._poses)

    def __len__(self) -> int:
        return len(self._draft)

    def add(self, right: UInt8Array, left: UInt8Array, top: UInt8Array, odometry: Pose2 | None = None) -> MapStep:
        """Add the images of one moment.

        Parameters
        ----------
        right, left, top : (H, W, 3) uint8
            BGR images of the rig's cameras.
        odometry : Pose2, optional
            The robot's motion since the moment before, in its frame then. By default the last motion is repeated.

        Raises
        ------
        FrameError
            If an image has another size or type.
        """
        features = [self._extractor.extract(image) for image in (right, left, top)]
        points = correspond(self.rig, features[0], features[1], features[2])
        if not self._poses:
            self._poses.append(self._start.array)
            self._pose_covariances.append(np.zeros((3, 3)))
            self._extend(points, np.arange(len(points)))
            return MapStep(PoseEstimate(self._start, np.diag([1e-12] * 3), 1.0, 0.0), len(points), 0)
        predicted = self._predict(odometry)
        fit = self._track(points, predicted)
        if fit is None:
            self._lost_motion = self._lost_motion.compose(odometry or Pose2(0.0, 0.0, 0.0))
            return MapStep(NotLocated("too few of the map's landmarks are seen"), len(points), 0)
        self._lost_motion = Pose2(0.0, 0.0, 0.0)
        self._poses.append(fit.pose)
        self._pose_covariances.append(fit.covariance)
        matched, returned = self._update(features[0], points)
        closes = returned >= _MIN_RETURNED and len(self._poses) - self._last_closure > _AWAY_FRAMES
        if self._bound_drift:
            if closes:
                self._refine(0)
            elif len(self._poses) % _REFINE_EVERY == 0:
                self._refine(max(len(self._poses) - _WINDOW, 0))
        if closes:
            self._last_closure = len(self._poses)
        residual = math.sqrt(float(fit.squared[fit.inliers].mean()) / 3) if fit.inliers.any() else 0.0
        pose = PoseEstimate(self.poses[-1], fit.covariance, float(fit.inliers.mean()), residual)
        return MapStep(pose, len(points), matched, closes)

    def finish(self) -> LandmarkMap:
        """Merge duplicates, adjust the whole run, drop landmarks seen only once, and return the map.

        Raises
        ------
        ArgumentError
            If no landmark was seen twice.
        """
        draft = self._draft
        draft.merge_duplicates()
        if self._bound_drift and len(self._poses) > 1:
            self._refine(0, iterations=10)
            draft.merge_duplicates()
            # again with each landmark's own noise, which the first adjustment estimates
            self._refine(0, iterations=5, by_noise=True)
        twice = np.bincount(draft.observations.landmark, minlength=len(draft)) >= 2
        if not twice.any():
            raise ArgumentError("no landmark was seen twice: the run gives no map")
        draft.keep(twice)
        return draft.finished(np.array(self._poses), np.array(self._pose_covariances))

    def _predict(self, odometry: Pose2 | None) -> FloatArray:
        last = self.poses[-1]
        if odometry is not None:
            return last.compose(self._lost_motion).compose(odometry).array
        if len(self._poses) < 2:
            return last.array
        return last.compose(self.poses[-2].inverse().compose(last)).array

    def _track(self, points: StereoPoints, predicted: FloatArray) -> PoseFit | None:
        """Fit the pose with the paper's gates, and again with wider gates if too few matches agree."""
        camera = self.rig.right
        scale = camera.size_px[0] / 320
        for widen in (1.0, _WIDER):
            expected = expect(self._draft, camera, predicted)
            gate = (_GATE_PX[0] * scale * widen, _GATE_PX[1] * scale * widen)
            allowed = near(expected.pixels, expected.size_px, points.features, gate)
            ratio = np.log(expected.depth_m)[:, None] - np.log(points.points_m[:, 0])[None, :]
            allowed &= np.abs(ratio) <= math.log(_DEPTH_RATIO) * widen
            rows, partners = match(self._draft.view_descriptors[expected.view], points.features.descriptors, allowed)
            if len(rows) < _MIN_INLIERS:
                continue
            of = expected.landmark[rows]
            fit = fit_stereo(
                camera,
                predicted,
                self._draft.positions_m[of],
                self._draft.covariances[of],
                points.points_m[partners],
                points.covariances[partners],
            )
            if fit.inliers.sum() >= _MIN_INLIERS and fit.inliers.mean() > _MIN_INLIER_RATIO:
                return fit
        return None

    def _update(self, right: Features, points: StereoPoints) -> tuple[int, int]:
        """Match again at the fitted pose, and update and extend the map.

        Returns the numbers of landmarks that were updated, and of these that had been out of view for long.
        """
        draft, camera, pose = self._draft, self.rig.right, self._poses[-1]
        frame = len(self._poses) - 1
        expected = expect(draft, camera, pose)
        gate = _KNOWN_GATE_PX * camera.size_px[0] / 320
        allowed = near(expected.pixels, expected.size_px, right, (gate, gate))
        rows, partners = match(
            draft.view_descriptors[expected.view],
            right.descriptors,
            allowed,
            ratio=KNOWN_RATIO,
            best_claim_wins=True,
        )
        draft.seen[expected.landmark[rows]] += 1
        unseen = np.ones(len(expected), dtype=bool)
        unseen[rows] = False
        draft.missed[expected.landmark[unseen]] += 1

        stereo_of = np.full(len(right), -1)
        stereo_of[points.index] = np.arange(len(points))
        in_all = stereo_of[partners] >= 0
        landmarks, which = expected.landmark[rows[in_all]], stereo_of[partners[in_all]]
        turn = world_to_camera(camera, pose[2]).T
        measured = to_world(camera, pose, points.points_m[which])
        noise = turn @ points.covariances[which] @ turn.T
        gain = draft.covariances[landmarks] @ np.linalg.inv(draft.covariances[landmarks] + noise)
        offset = measured - draft.positions_m[landmarks]
        squared = np.einsum("ni,nij,nj->n", offset, np.linalg.inv(draft.covariances[landmarks] + noise), offset)
        good = squared < 2 * CHI2_3DOF  # twice, because the pose has an error, too
        landmarks, which, gain, offset = landmarks[good], which[good], gain[good], offset[good]
        returned = int((draft.last_frame[landmarks] < frame - _AWAY_FRAMES).sum())
        draft.positions_m[landmarks] += np.einsum("nij,nj->ni", gain, offset)
        left_over = np.eye(3) - gain
        updated = left_over @ draft.covariances[landmarks]
        draft.covariances[landmarks] = (updated + updated.transpose(0, 2, 1)) / 2
        self._note(landmarks, points, which)
        known = np.zeros(len(points), dtype=bool)
        known[stereo_of[partners[in_all]]] = True
        self._extend(points, np.flatnonzero(~known))
        return len(landmarks), returned

    def _extend(self, points: StereoPoints, which: npt.NDArray[np.intp]) -> None:
        camera, pose = self.rig.right, self._poses[-1]
        turn = world_to_camera(camera, pose[2]).T
        landmarks = self._draft.add(
            to_world(camera, pose, points.points_m[which]),
            turn @ points.covariances[which] @ turn.T,
            len(self._poses) - 1,
        )
        self._note(landmarks, points, which)

    def _note(self, landmarks: Int64Array, points: StereoPoints, which: npt.NDArray[np.intp] | Int64Array) -> None:
        camera, pose = self.rig.right, self._poses[-1]
        part = points.take(which)
        per_px = part.points_m[:, 0] / math.sqrt(camera.focal_px[0] * camera.focal_px[1])
        directions = direction_of(camera, pose, to_world(camera, pose, part.points_m))
        self._draft.note_views(landmarks, directions, part.features, per_px)
        self._draft.note_observations(landmarks, part, len(self._poses) - 1)

    def _refine(self, first: int, *, iterations: int = 4, by_noise: bool = False) -> None:
        """Adjust the poses from index `first` on, but never the first one, and all landmarks seen from them."""
        draft = self._draft
        everything = draft.observations
        involved = np.zeros(len(draft), dtype=bool)
        involved[everything.landmark[everything.frame >= first]] = True
        part = everything.take(involved[everything.landmark])
        number = np.cumsum(involved) - 1
        noise = draft.noise[involved] if by_noise else np.ones(int(involved.sum()))
        landmark = number[part.landmark]
        part = Observations(part.frame, landmark, part.measured_px, part.std_px * noise[landmark])
        fixed = np.arange(len(self._poses)) < max(first, 1)
        refined = refine(
            self.rig, np.array(self._poses), draft.positions_m[involved], part, fixed, iterations=iterations
        )
        self._poses = list(refined.poses)
        if first == 0 and not by_noise:
            # a window's covariances leave out the uncertainty of older poses, and those by the landmarks' own noise are
            # too small, because a landmark's errors in successive moments are correlated
            self._pose_covariances = list(refined.pose_covariances)
        draft.positions_m[involved] = refined.landmarks_m
        draft.covariances[involved] = refined.covariances
        draft.noise[involved] = noise * refined.noise
