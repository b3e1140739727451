"""The landmark map: positions with covariances, appearances from 36 directions, and numbers of observations.

It is saved as one .npz file with a format number. `MapIndex` finds the landmarks that a camera may see without a search
of the whole map.
"""

from __future__ import annotations

import math
import zipfile
import zlib
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError, FileError
from robocup_vision.arrays import Float32Array, FloatArray, Int64Array, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.kernels.algebra.pinhole import PinholeView
from robocup_vision.kernels.landmarks.index import FloorPlan, InView, views_in_frustum
from robocup_vision.landmarks.features import from_bytes
from robocup_vision.landmarks.pose_fit import project, to_camera

FORMAT = 1
DIRECTIONS = 36
# change of the viewing direction over which SIFT's descriptors can be matched
VIEW_REACH_RAD = math.radians(20.0)
# landmarks farther away are not expected
_FARTHEST_M = 40.0


@dataclass(frozen=True, eq=False)
class LandmarkMap:
    """L landmarks with V views: a view is the appearance of one landmark from one direction.

    Parameters
    ----------
    positions_m : (L, 3) float64
        Field frame, z up from the floor.
    covariances : (L, 3, 3) float64
        Covariances of the positions, m^2, without the error common to neighbours, which is in `trajectory_cov`.
    noise : (L,) float64
        Standard deviation of each one's pixels, as a multiple of the paper's 0.5 * d_s.
    seen, missed : (L,) int64
        How often each was expected and observed (the paper's m), and expected but not observed (l).
    view_landmark : (V,) int64
        Index of each view's landmark.
    view_direction : (V,) int64
        Direction of the line of sight in the field frame, 0 to 35: multiples of 10 degrees from +x counter-clockwise.
    view_descriptors : (V, D) uint8
        Packed by `features.to_bytes`.
    view_contrast : (V,) float64
        SIFT's contrast ``|D|`` of the keypoint.
    view_size_m : (V,) float64
        Diameter of the keypoint's described region, metres.
    view_spacing_m : (V,) float64
        Sample spacing d_s of the keypoint's octave at the landmark's distance, metres.
    trajectory : (F, 3) float64
        x, y, theta of the robot at the frames from which the map was made.
    trajectory_cov : (F, 3, 3) float64
        Covariances of these poses, as the map's possible drift there.
    """

    positions_m: FloatArray
    covariances: FloatArray
    noise: FloatArray
    seen: Int64Array
    missed: Int64Array
    view_landmark: Int64Array
    view_direction: Int64Array
    view_descriptors: UInt8Array
    view_contrast: FloatArray
    view_size_m: FloatArray
    view_spacing_m: FloatArray
    trajectory: FloatArray
    trajectory_cov: FloatArray

    def __post_init__(self) -> None:
        count, views = len(self.positions_m), len(self.view_landmark)
        shapes = {
            "positions_m": (count, 3),
            "covariances": (count, 3, 3),
            "noise": (count,),
            "seen": (count,),
            "missed": (count,),
            "view_landmark": (views,),
            "view_direction": (views,),
            "view_descriptors": (views, self.view_descriptors.shape[-1]),
            "view_contrast": (views,),
            "view_size_m": (views,),
            "view_spacing_m": (views,),
            "trajectory": (len(self.trajectory), 3),
            "trajectory_cov": (len(self.trajectory), 3, 3),
        }
        for name, shape in shapes.items():
            array: npt.NDArray[np.generic] = getattr(self, name)
            if array.shape != shape:
                raise ArgumentError(f"{name} must have shape {shape}, got {array.shape}")
            if not np.isfinite(array).all():
                raise ArgumentError(f"{name} must be finite")
            array.flags.writeable = False
        if views and not (self.view_landmark.min() >= 0 and self.view_landmark.max() < count):
            raise ArgumentError(f"view_landmark must be within 0 to {count - 1}")
        if views and not (self.view_direction.min() >= 0 and self.view_direction.max() < DIRECTIONS):
            raise ArgumentError(f"view_direction must be within 0 to {DIRECTIONS - 1}")
        if (self.seen < 0).any() or (self.missed < 0).any():
            raise ArgumentError("seen and missed must not be negative")
        for name in ("noise", "view_size_m", "view_spacing_m"):
            if not (getattr(self, name) > 0).all():
                raise ArgumentError(f"{name} must be positive")
        if count and np.linalg.eigvalsh(self.covariances).min() <= 0:
            raise ArgumentError("covariances must be positive definite")

    def __len__(self) -> int:
        return len(self.positions_m)

    def drift(self, pose: FloatArray) -> FloatArray:
        """Return the covariance (3, 3) of the map's drift around a pose (3,): that of the nearest frame of its run."""
        if not len(self.trajectory):
            return np.zeros((3, 3))
        apart = self.trajectory - pose
        turn = np.remainder(apart[:, 2] + math.pi, math.tau) - math.pi
        # a radian counts as a metre: poses within both see about the same part of the map
        nearest = int(np.argmin(np.hypot(apart[:, 0], apart[:, 1]) + np.abs(turn)))
        return np.asarray(self.trajectory_cov[nearest])

    @property
    def success(self) -> FloatArray:
        """(L,) float64: smoothed detection rate of each landmark, (m + 0.5) / (m + l + 2).

        The paper prints m / (m + n) and means m / (m + l). Without smoothing, landmarks seen once would rank first.
        """
        return np.asarray((self.seen + 0.5) / (self.seen + self.missed + 2.0))

    @cached_property
    def view_unit(self) -> Float32Array:
        """(V, D) float32: the views' descriptors as unit vectors."""
        return from_bytes(self.view_descriptors)


class Views(Protocol):
    """The arrays by which landmarks are predicted in an image, of a `LandmarkMap` or a `DraftMap`."""

    @property
    def positions_m(self) -> FloatArray: ...  # noqa: D102
    @property
    def view_landmark(self) -> Int64Array: ...  # noqa: D102
    @property
    def view_direction(self) -> Int64Array: ...  # noqa: D102
    @property
    def view_size_m(self) -> FloatArray: ...  # noqa: D102
    @property
    def view_spacing_m(self) -> FloatArray: ...  # noqa: D102


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """Landmarks that are predicted in an image from a pose, one view of each."""

    view: Int64Array  #: (N,) int64: index of the view from the nearest direction
    landmark: Int64Array  #: (N,) int64: index of its landmark
    pixels: FloatArray  #: (N, 2) float64: expected ideal pixels
    depth_m: FloatArray  #: (N,) float64: distance along the optical axis
    #: (N,) float64, (N,) float64: diameter and sample spacing of the keypoint in the image
    size_px: FloatArray
    spacing_px: FloatArray

    def __len__(self) -> int:
        return len(self.view)

    def take(self, index: npt.NDArray[np.intp] | Int64Array | npt.NDArray[np.bool_]) -> Expected:
        """Return some of them, in this order."""
        return Expected(*(getattr(self, f.name)[index] for f in fields(self)))


def expect(landmarks: Views, camera: PinholeCamera, pose: FloatArray) -> Expected:
    """Predict all landmarks in the view frustum at a robot's pose (3,), each by its view nearest in direction."""
    points = to_camera(camera, pose, landmarks.positions_m)
    pixels = project(camera, points)
    width, height = camera.size_px
    with np.errstate(invalid="ignore"):
        inside = (pixels >= 0).all(axis=1) & (pixels[:, 0] <= width - 1) & (pixels[:, 1] <= height - 1)
    inside &= (points[:, 0] > 0.1) & (points[:, 0] < _FARTHEST_M)
    views = np.flatnonzero(inside[landmarks.view_landmark])
    of = landmarks.view_landmark[views]
    return nearest_views(landmarks, camera, pose, views, pixels[of], points[of, 0])


def nearest_views(
    landmarks: Views,
    camera: PinholeCamera,
    pose: FloatArray,
    views: npt.NDArray[np.intp] | Int64Array,
    pixels: FloatArray,
    depth_m: FloatArray,
) -> Expected:
    """Return the view nearest to the line of sight of each landmark, if it is within 20 degrees, from views (N,).

    Parameters
    ----------
    landmarks, camera, pose
        As in `expect`.
    views : (N,) int64
        Views of landmarks in the frustum.
    pixels, depth_m : (N, 2), (N,) float64
        Expected ideal pixel and depth of each view's landmark.
    """
    of = landmarks.view_landmark[views]
    eye = viewpoint_in_field(camera, pose)
    ahead = np.arctan2(landmarks.positions_m[of, 1] - eye[1], landmarks.positions_m[of, 0] - eye[0])
    turn = ahead - landmarks.view_direction[views] * (math.tau / DIRECTIONS)
    turn = np.abs(np.remainder(turn + math.pi, math.tau) - math.pi)
    order = np.lexsort((turn, of))
    order = order[turn[order] <= VIEW_REACH_RAD + math.pi / DIRECTIONS]
    first = np.ones(len(order), dtype=bool)
    first[1:] = of[order][1:] != of[order][:-1]
    chosen = order[first]
    views, of, depth = views[chosen], of[chosen], depth_m[chosen]
    per_m = math.sqrt(camera.focal_px[0] * camera.focal_px[1]) / depth
    return Expected(
        views, of, pixels[chosen], depth, landmarks.view_size_m[views] * per_m, landmarks.view_spacing_m[views] * per_m
    )


def viewpoint_in_field(camera: PinholeCamera, pose: FloatArray) -> FloatArray:
    """Centre of projection (3,) in the field frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y, z = camera.viewpoint_m
    return np.array([pose[0] + c * x - s * y, pose[1] + s * x + c * y, z])


def direction_of(camera: PinholeCamera, pose: FloatArray, points_m: FloatArray) -> Int64Array:
    """Return in which of the 36 directions (N,) points (N, 3) of the field frame are seen from a robot's pose (3,)."""
    eye = viewpoint_in_field(camera, pose)
    bearing = np.arctan2(points_m[:, 1] - eye[1], points_m[:, 0] - eye[0])
    return np.asarray(np.rint(bearing * (DIRECTIONS / math.tau)).astype(np.int64) % DIRECTIONS)


def save_map(landmarks: LandmarkMap, path: str | Path) -> None:
    """Write a map as one .npz file.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    arrays = {f.name: getattr(landmarks, f.name) for f in fields(landmarks)}
    with telling_write_errors(path), Path(path).open("wb") as stream:
        np.savez_compressed(stream, format=np.int64(FORMAT), **arrays)


def load_map(path: str | Path) -> LandmarkMap:
    """Read a map.

    Raises
    ------
    FileError
        If the file is missing, damaged, of another format, or its arrays contradict each other.
    """
    known = [f.name for f in fields(LandmarkMap)]
    try:
        # NumPy does not verify checksums
        with zipfile.ZipFile(path) as packed:
            torn = packed.testzip()
        if torn is not None:
            raise FileError(path, f"is damaged or no landmark map (checksum of {torn})")
        with np.load(path, allow_pickle=False) as archive:
            if "format" not in archive.files:
                raise FileError(path, "is missing, so this is no landmark map", key="format")
            version = archive["format"]
            if version.shape != () or version != FORMAT:
                raise FileError(path, f"must be {FORMAT}", key="format", value=version.tolist())
            for name in known:
                if name not in archive.files:
                    raise FileError(path, "is missing", key=name)
            arrays = {name: archive[name] for name in known}
    except FileNotFoundError:
        raise FileError(path, "does not exist") from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error, NotImplementedError) as error:
        raise FileError(path, f"is damaged or no landmark map ({error})") from None
    for f in fields(LandmarkMap):
        wanted = np.uint8 if f.type == "UInt8Array" else np.int64 if f.type == "Int64Array" else np.float64
        if arrays[f.name].dtype != wanted:
            problem = f"must be of type {np.dtype(wanted)}"
            raise FileError(path, problem, key=f.name, value=str(arrays[f.name].dtype))
    try:
        return LandmarkMap(**arrays)
    except ArgumentError as error:
        raise FileError(path, str(error)) from None


class MapIndex:
    """A map sorted by place.

    Parameters
    ----------
    cell_m : float
        Side of a cell of space.
    keep : int
        Number of views for each cell and direction: those of the highest success rate, then contrast.
    reach_m : float
        Greatest distance of a landmark.
    """

    def __init__(self, landmarks: LandmarkMap, *, cell_m: float = 0.25, keep: int = 3, reach_m: float = 15.0) -> None:
        if not (cell_m > 0 and keep >= 1 and reach_m > 0):
            raise ArgumentError(f"cell_m, keep and reach_m must be positive, got {cell_m}, {keep}, {reach_m}")
        self.landmarks = landmarks
        self._reach_m = reach_m
        of = landmarks.view_landmark
        places = landmarks.positions_m[of]
        corner = places.min(axis=0) - 1e-6 if len(places) else np.zeros(3)
        cell = ((places - corner) / cell_m).astype(np.int64)
        wide, deep, _ = cell.max(axis=0, initial=0) + 1
        column = cell[:, 1] * wide + cell[:, 0]
        box = (column * (cell[:, 2].max(initial=0) + 1) + cell[:, 2]) * DIRECTIONS + landmarks.view_direction
        order = np.lexsort((-landmarks.view_contrast, -landmarks.success[of], box))
        rank = np.arange(len(order)) - np.searchsorted(box[order], box[order])
        self._views = order[rank < keep].astype(np.int64)
        self._plan = FloorPlan(
            np.ascontiguousarray(places[self._views]),
            landmarks.view_direction[self._views] * (math.tau / DIRECTIONS),
            np.searchsorted(column[self._views], np.arange(wide * deep + 1)),
            (int(wide), int(deep)),
            corner,
            cell_m,
        )
        count = len(self._views)
        self._found = InView(np.empty(count, dtype=np.int64), np.empty((count, 2)), np.empty(count))

    def __len__(self) -> int:
        return len(self._views)

    def expect(self, camera: PinholeCamera, pose: FloatArray) -> Expected:
        """Predict landmarks as the function `expect` does, but only by the views of the index."""
        found = self._found
        count = views_in_frustum(
            pinhole_view(camera),
            camera.size_px,
            pose,
            self._plan,
            self._reach_m,
            VIEW_REACH_RAD + math.pi / DIRECTIONS,
            found,
        )
        views = self._views[found.number[:count]]
        return nearest_views(self.landmarks, camera, pose, views, found.pixels[:count], found.depth_m[:count])


def pinhole_view(camera: PinholeCamera) -> PinholeView:
    """Return a camera's parameters for the kernels."""
    return PinholeView(
        np.ascontiguousarray(camera.camera_to_robot.T),
        np.array(camera.viewpoint_m),
        np.array(camera.focal_px, dtype=np.float64),
        np.array(camera.center_px, dtype=np.float64),
    )
