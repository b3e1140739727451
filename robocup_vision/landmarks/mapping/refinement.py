"""Joint adjustment of poses and landmarks of a run to all its measurements (bundle adjustment), which bounds drift.

Gauss-Newton on the three images' pixels with redescending weights. Landmarks are eliminated (Schur complement), so that
the size of the system to solve is that of the poses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import BoolArray, FloatArray, Int64Array
from robocup_vision.landmarks.mapping.run_files import TrinocularRig
from robocup_vision.landmarks.pose_fit import world_to_camera

# number of landmarks that are eliminated at a time, which bounds the memory
_CHUNK = 1500
# squared width of the weights, in variances of one coordinate
_WIDTH2 = 9.0
# greatest step of a pose (m and rad) at which the adjustment ends
_SETTLED_M = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """K observations of a landmark in a frame."""

    #: (K,) int64: index of the frame and of the landmark; each pair occurs once
    frame: Int64Array
    landmark: Int64Array
    measured_px: FloatArray  #: (K, 4) float64: u and v in the right image, u in the left, v in the upper
    std_px: FloatArray  #: (K,) float64: standard deviation of each coordinate

    def take(self, index: npt.NDArray[np.intp] | Int64Array | BoolArray) -> Observations:
        """Return some of them."""
        return Observations(self.frame[index], self.landmark[index], self.measured_px[index], self.std_px[index])


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """An adjusted run."""

    poses: FloatArray  #: (F, 3) float64: x, y, theta of the robot
    landmarks_m: FloatArray  #: (L, 3) float64: positions of the landmarks, field frame, metres
    #: (F, 3, 3) float64: covariances of the poses, which include the map's drift; 0 for fixed ones
    pose_covariances: FloatArray
    #: (L, 3, 3) float64: covariances of the landmarks for given poses, whose own errors are common to neighbours
    covariances: FloatArray
    noise: FloatArray  #: (L,) float64: standard deviation of each landmark's residuals in units of `std_px`


def refine(
    rig: TrinocularRig,
    poses: FloatArray,
    landmarks_m: FloatArray,
    observations: Observations,
    fixed: BoolArray,
    *,
    iterations: int,
) -> Refined:
    """Adjust poses and landmarks.

    Parameters
    ----------
    poses, landmarks_m : (F, 3), (L, 3) float64
        Start of the adjustment, field frame.
    observations : Observations
        Their indices refer to `poses` and `landmarks_m`.
    fixed : (F,) bool
        Whether each pose is fixed. At least one must be, because observations do not determine the map's place.
    iterations : int
        Greatest number of iterations.
    """
    poses, landmarks = np.array(poses), np.array(landmarks_m)
    order = np.argsort(observations.landmark, kind="stable")
    s = observations.take(order)
    slot = np.cumsum(~fixed) - 1  # index of each free pose among the unknowns
    for _ in range(iterations):
        system = _linearise(rig, poses, landmarks, s)
        reduced, gradient, _ = _reduce(system, s, slot, fixed, len(landmarks))
        unknowns = len(gradient)
        step = np.linalg.solve(reduced + 1e-9 * np.eye(unknowns), gradient) if unknowns else gradient
        moves = np.zeros_like(poses)
        moves[~fixed] = step.reshape(-1, 3)
        poses += moves
        landmarks += _back(system, s, moves, len(landmarks))
        if np.abs(moves).max(initial=0.0) < _SETTLED_M:
            break
    system = _linearise(rig, poses, landmarks, s)
    reduced, _, inverse = _reduce(system, s, slot, fixed, len(landmarks))
    pose_covariances = np.zeros((len(poses), 3, 3))
    free = np.flatnonzero(~fixed)
    if len(free):
        blocks = np.linalg.inv(reduced + 1e-9 * np.eye(len(reduced))).reshape(len(free), 3, len(free), 3)
        pose_covariances[free] = blocks[np.arange(len(free)), :, np.arange(len(free)), :]
    return Refined(poses, landmarks, pose_covariances, inverse, _noise(system, s, len(landmarks)))


@dataclass(frozen=True, slots=True, eq=False)
class _System:
    """Normal equations of K observations: pose, landmark and cross part (K, 3, 3), both gradients (K, 3), residuals."""

    pose: FloatArray
    landmark: FloatArray
    cross: FloatArray
    pose_gradient: FloatArray
    landmark_gradient: FloatArray
    squared: FloatArray


def _linearise(rig: TrinocularRig, poses: FloatArray, landmarks: FloatArray, s: Observations) -> _System:
    camera, b = rig.right, rig.baseline_m
    (fx, fy), (cu, cv) = camera.focal_px, camera.center_px
    turn = world_to_camera(camera, poses[:, 2])[s.frame]
    offset = landmarks[s.landmark].copy()
    offset[:, :2] -= poses[s.frame, :2]
    points = np.einsum("nij,nj->ni", turn, offset) - camera.viewpoint_m @ camera.camera_to_robot
    depth = np.maximum(points[:, 0], 0.05)
    su, sv = -points[:, 1] / depth, -points[:, 2] / depth
    u, v = cu + fx * su, cv + fy * sv
    predicted = np.stack([u, v, u + fx * b / depth, v + fy * b / depth], axis=-1)
    by_point = np.zeros((len(depth), 4, 3))
    by_point[:, 0, 0] = -fx * su / depth
    by_point[:, 2, 0] = -fx * (su + b / depth) / depth
    by_point[:, 1, 0] = -fy * sv / depth
    by_point[:, 3, 0] = -fy * (sv + b / depth) / depth
    by_point[:, (0, 2), 1] = (-fx / depth)[:, None]
    by_point[:, (1, 3), 2] = (-fy / depth)[:, None]
    by_landmark = by_point @ turn
    by_pose = np.empty_like(by_landmark)
    by_pose[:, :, :2] = -by_landmark[:, :, :2]
    # turning the robot by dtheta moves an offset (x, y) by (y, -x) dtheta as seen in the field frame
    by_pose[:, :, 2] = by_landmark[:, :, 0] * offset[:, None, 1] - by_landmark[:, :, 1] * offset[:, None, 0]
    residual = s.measured_px - predicted
    variance = s.std_px**2
    squared = (residual**2).sum(axis=1) / (4 * variance)
    weight = 1.0 / (1.0 + squared / _WIDTH2) ** 2 / variance
    weighted_pose = by_pose.transpose(0, 2, 1) * weight[:, None, None]
    weighted_landmark = by_landmark.transpose(0, 2, 1) * weight[:, None, None]
    return _System(
        weighted_pose @ by_pose,
        weighted_landmark @ by_landmark,
        weighted_pose @ by_landmark,
        (weighted_pose @ residual[:, :, None])[:, :, 0],
        (weighted_landmark @ residual[:, :, None])[:, :, 0],
        4 * squared,
    )


def _sum_by(index: Int64Array, values: FloatArray, count: int) -> FloatArray:
    flat = values.reshape(len(values), -1)
    columns = [np.bincount(index, weights=column, minlength=count) for column in flat.T]
    total: FloatArray = np.stack(columns, axis=-1).astype(np.float64)
    return total.reshape(count, *values.shape[1:])


def _landmark_inverses(system: _System, s: Observations, count: int) -> FloatArray:
    normal = _sum_by(s.landmark, system.landmark, count)
    # a landmark without observations, or with outliers only, stays where it is
    return np.asarray(np.linalg.inv(normal + 1e-3 * np.eye(3)))


def _blocks(
    system: _System, s: Observations, slot: Int64Array, fixed: BoolArray, count: int
) -> list[tuple[int, int, FloatArray]]:
    """Return the cross parts of landmarks `low` to `high` as dense matrices (3 * free poses, 3 * landmarks)."""
    free = int((~fixed).sum())
    starts = np.searchsorted(s.landmark, np.arange(0, count + _CHUNK, _CHUNK))
    blocks = []
    for k, low in enumerate(range(0, count, _CHUNK)):
        part = np.arange(starts[k], starts[k + 1])
        part = part[~fixed[s.frame[part]]]
        high = min(low + _CHUNK, count)
        dense = np.zeros((free, 3, high - low, 3))
        dense[slot[s.frame[part]], :, s.landmark[part] - low, :] = system.cross[part]
        blocks.append((low, high, dense.reshape(3 * free, -1)))
    return blocks


def _reduce(
    system: _System, s: Observations, slot: Int64Array, fixed: BoolArray, count: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the reduced normal matrix and gradient of the free poses, and the landmarks' inverse normal matrices."""
    free = int((~fixed).sum())
    moving = ~fixed[s.frame]
    own = _sum_by(slot[s.frame[moving]], system.pose[moving], free)
    gradient = _sum_by(slot[s.frame[moving]], system.pose_gradient[moving], free).reshape(-1)
    spread = np.zeros((free, 3, free, 3))
    spread[np.arange(free), :, np.arange(free), :] = own
    reduced: FloatArray = spread.reshape(3 * free, 3 * free)
    inverse = _landmark_inverses(system, s, count)
    landmark_gradient = _sum_by(s.landmark, system.landmark_gradient, count)
    for low, high, dense in _blocks(system, s, slot, fixed, count):
        halved = np.einsum("alj,ljk->alk", dense.reshape(3 * free, -1, 3), inverse[low:high]).reshape(3 * free, -1)
        reduced -= halved @ dense.T
        gradient -= halved @ landmark_gradient[low:high].reshape(-1)
    return reduced, gradient, inverse


def _back(system: _System, s: Observations, moves: FloatArray, count: int) -> FloatArray:
    """Return the best steps of the landmarks for steps of the poses."""
    own = system.landmark_gradient - np.einsum("nij,ni->nj", system.cross, moves[s.frame])
    return np.asarray(np.einsum("lij,lj->li", _landmark_inverses(system, s, count), _sum_by(s.landmark, own, count)))


def _noise(system: _System, s: Observations, count: int) -> FloatArray:
    """Return the root mean square of each landmark's residuals, shrunk towards 1 by one pseudo-observation."""
    # an observation has four coordinates; a landmark has three unknowns
    numbers = np.maximum(4.0 * np.bincount(s.landmark, minlength=count) - 3.0, 0.0)
    total = np.bincount(s.landmark, weights=system.squared, minlength=count)
    return np.asarray(np.sqrt((4.0 + total) / (4.0 + numbers)))
