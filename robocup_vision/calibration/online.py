"""Follows centre and tilt of a mirror camera while a robot plays: a knock or a warm mount moves them.

Every few frames the points of the current frame are kept, one frame per place and heading. The joint fit of
`calibration.omni` is run over them with a fixed curve. The camera in use approaches the result step by step, within a
bound about the camera file. The state reports when it reaches the bound.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.omni.fit import FieldShape, JointFit, Points
from robocup_vision.calibration.omni.model import CENTER, TILT, CameraModel
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.line_points import LineFinder
from robocup_vision.view import View


@dataclass(frozen=True, slots=True)
class OnlineSettings:
    """Settings of `OnlineCalibration`.

    Parameters
    ----------
    max_center_px, max_tilt_rad : float
        Bounds of the centre's change in either coordinate, and of the tilt's about either axis: the effect of a knock
        on a mount.
    every : int
        Only every so many frames is used: it costs some milliseconds, and a fit some tens, after which the tables of
        the new camera are made.
    window, min_frames : int, int
        Largest and smallest number of frames that a fit uses: fewer do not separate centre and tilt.
    frames_between : int
        New frames between two fits: fewer hardly change the result.
    same_place_m, same_heading_rad : float
        Of frames closer together only the newest is kept: they carry the same information.
    min_inlier_ratio : float
        Frames whose pose fits worse are not used.
    min_points, max_points : int
        Points that a frame must show, and points of each kind that are kept: neighbours err together.
    scales_px : tuple of float
        Widths of the weights, from the first iterations to the last.
    max_center_std_px : float
        A fit is used if the centre's standard deviation is at most this, pixels of an image 220 high.
    gain : float
        Fraction of the way to the fit that one step goes: noise of a single fit is averaged.
    min_step_px : float
        Smaller steps are not worth new tables.
    """

    max_center_px: float = 3.0
    max_tilt_rad: float = math.radians(1.0)
    every: int = 5
    window: int = 20
    min_frames: int = 6
    frames_between: int = 4
    same_place_m: float = 0.1
    same_heading_rad: float = math.radians(15.0)
    min_inlier_ratio: float = 0.5
    min_points: int = 40
    max_points: int = 80
    scales_px: tuple[float, ...] = (2.0, 1.0, 0.7)
    max_center_std_px: float = 0.6
    gain: float = 0.5
    min_step_px: float = 0.03

    def __post_init__(self) -> None:
        for name, value in (("max_center_px", self.max_center_px), ("max_tilt_rad", self.max_tilt_rad)):
            if not 0 < value < math.inf:
                raise ArgumentError(f"{name} must be positive, got {value}")
        if self.every < 1:
            raise ArgumentError(f"every must be at least 1, got {self.every}")
        if self.window < self.min_frames:
            raise ArgumentError(f"window must be at least {self.min_frames}, got {self.window}")


@dataclass(frozen=True, slots=True)
class OnlineState:
    """State of an online calibration.

    Parameters
    ----------
    center_px, tilt_rad : (float, float)
        Now in use.
    moved_px : float
        Distance of the centre from the camera file's.
    tilted_rad : float
        Difference of the tilt from the camera file's.
    at_bound : bool
        Whether the fit lies at the bound: then calibrate again, or look for a loose mount.
    steps : int
        Number of changes so far.
    """

    center_px: tuple[float, float]
    tilt_rad: tuple[float, float]
    moved_px: float
    tilted_rad: float
    at_bound: bool
    steps: int

    def __str__(self) -> str:
        moved = f"centre moved by {self.moved_px:.2f} px, tilt by {math.degrees(self.tilted_rad):.2f} deg"
        return moved + (", at the bound: calibrate again" if self.at_bound else "")


@dataclass(frozen=True, eq=False)
class _Seen:
    pose: Pose2
    boundary_px: FloatArray
    line_px: FloatArray


class OnlineCalibration:
    """Refines a camera by the frames of a `Vision`; pass it to that `Vision` as `online`.

    Parameters
    ----------
    field : Field
        The pitch.
    camera : OmniCamera
        Start, and centre of the bounds.
    mask : (H, W) uint8, optional
        As for the `Vision`.
    settings : OnlineSettings
        Bounds, and how often the camera is fitted.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        mask: UInt8Array | None = None,
        settings: OnlineSettings = OnlineSettings(),
    ) -> None:
        self.camera = camera
        self._field, self.settings = field, settings
        self._shape = FieldShape(field)
        self._finder = LineFinder(camera, field.line_width_m, mask)
        self._model = CameraModel(camera, "kept")
        self._start = self._model.vector(camera)
        self._now = self._start.copy()
        self._reach = np.zeros(self._model.size)
        self._reach[CENTER], self._reach[TILT] = settings.max_center_px, settings.max_tilt_rad
        self._seen: list[_Seen] = []
        self._count, self._new, self._steps = 0, 0, 0
        self._at_bound = False
        self._warm_up()

    @property
    def state(self) -> OnlineState:
        """Current state."""
        moved = np.abs(self._now - self._start)
        return OnlineState(
            (float(self._now[0]), float(self._now[1])),
            (float(self._now[2]), float(self._now[3])),
            float(np.hypot(*moved[CENTER])),
            float(np.hypot(*moved[TILT])),
            self._at_bound,
            self._steps,
        )

    def follow(self, frame: UInt8Array, view: View) -> OmniCamera | None:
        """Take in a frame (H, W, 3) uint8 and its view; return a better camera, or None."""
        self._count += 1
        if self._count % self.settings.every or not self._note(frame, view):
            return None
        self._new += 1
        if len(self._seen) < self.settings.min_frames or self._new < self.settings.frames_between:
            return None
        self._new = 0
        return self._step()

    def _note(self, frame: UInt8Array, view: View) -> bool:
        """Keep a frame's points if it is usable; return whether it is."""
        estimate, settings = view.pose, self.settings
        if not isinstance(estimate, PoseEstimate) or estimate.inlier_ratio < settings.min_inlier_ratio:
            return False
        boundary = view.boundary_px if self._field.is_bounded else np.empty((0, 2))
        boundary = boundary[np.isfinite(boundary).all(axis=1)]
        lines = self._finder.find(frame).pixels
        seen = _Seen(estimate.pose, _thinned(boundary, settings.max_points), _thinned(lines, settings.max_points))
        if len(seen.boundary_px) + len(seen.line_px) < settings.min_points:
            return False
        others = [other for other in self._seen if not self._is_same_place(other.pose, seen.pose)]
        self._seen = others[1 - settings.window :]
        self._seen.append(seen)
        return True

    def _is_same_place(self, pose: Pose2, other: Pose2) -> bool:
        distance_m, angle_rad = pose.error_to(other)
        return distance_m < self.settings.same_place_m and angle_rad < self.settings.same_heading_rad

    def _step(self) -> OmniCamera | None:
        settings = self.settings
        low, high = self._start - self._reach, self._start + self._reach
        points = _points(self._seen)
        joint = JointFit(self._shape, points)
        poses = np.array([seen.pose.array for seen in self._seen])
        fit = joint.solve(
            self._model, self._now, poses, settings.scales_px, self._start, (low, high), repeats=2, most=4
        )
        std = np.sqrt(np.diag(joint.covariance(fit)))[CENTER].max()
        self._seen = [
            dataclasses.replace(seen, pose=Pose2(*pose.tolist()))
            for seen, pose in zip(self._seen, fit.poses, strict=True)
        ]
        on_edge = np.minimum(fit.vector - low, high - fit.vector)
        self._at_bound = bool(on_edge.min() < 1e-9)
        # at its bound a fit has a large standard deviation; the bound itself limits the error there
        if std > settings.max_center_std_px * min(self.camera.size_px) / 220 and not self._at_bound:
            return None
        if _shift_px(self._model.camera(self._now), fit.camera) < settings.min_step_px:
            return None
        self._now = self._now + settings.gain * (fit.vector - self._now)
        self._steps += 1
        self.camera = self._model.camera(self._now)
        return self.camera

    def _warm_up(self) -> None:
        """Compile, or load from the disk's cache, what a fit needs, so that no frame pays for it."""
        width, height = self.camera.size_px
        self._finder.find(np.zeros((height, width, 3), dtype=np.uint8))
        pixels = self.camera.polar_to_pixel([0.0, 1.0], self.camera.usable_radius_px[0])
        points = Points(pixels, np.zeros(2, dtype=np.int64), np.ones(2, dtype=bool), np.ones(2))
        JointFit(self._shape, points).residuals(self.camera, np.zeros((1, 3)))


def _thinned(pixels: FloatArray, max_points: int) -> FloatArray:
    return pixels[:: max(1, -(-len(pixels) // max_points))]


def _shift_px(camera: OmniCamera, other: OmniCamera) -> float:
    """Greatest distance between the images of the same floor through two cameras."""
    inner, outer = camera.usable_radius_px
    pixels = camera.polar_to_pixel(np.arange(0.0, math.tau, 0.5)[:, None], np.linspace(inner, 0.8 * outer, 4))
    moved = other.floor_to_pixel(camera.pixel_to_floor(pixels.reshape(-1, 2))) - pixels.reshape(-1, 2)
    return float(np.nanmax(np.hypot(moved[:, 0], moved[:, 1])))


def _points(sightings: list[_Seen]) -> Points:
    pixels, frame, is_line = [], [], []
    for index, seen in enumerate(sightings):
        for some, lines in ((seen.boundary_px, False), (seen.line_px, True)):
            pixels.append(some)
            frame.append(np.full(len(some), index))
            is_line.append(np.full(len(some), lines))
    count = sum(map(len, pixels))
    return Points(np.vstack(pixels), np.concatenate(frame), np.concatenate(is_line), np.ones(count))
