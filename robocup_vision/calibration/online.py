"""Centre and tilt of a mirror camera, followed slowly while a robot plays: a knock or a warm mount is not the end.

Every few frames the points of the one just seen are kept, one frame per place and heading, and the same joint fit as in
`calibration.omni` is run over them with the curve held. What it says is approached step by step, never farther from the
camera file than a bound; at the bound it stays there, and says so.
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

# frames closer together than this tell the same: the newer one stays
_SAME_PLACE_M, _SAME_HEADING_RAD = 0.1, math.radians(15.0)
_MIN_SHARE = 0.5
# of each kind, in a frame
_MAX_POINTS = 80
_MIN_POINTS = 40
# frames that the first fit needs, and those a fit waits for after another
_MIN_FRAMES = 6
_FRAMES_BETWEEN = 4
_SCALES_PX = (2.0, 1.0, 0.7)
# a fit counts if it knows the centre this well, pixels of 220
_MIN_KNOWN_PX = 0.6
# the share of the way that one step goes, and what is too small to go, pixels
_GAIN = 0.5
_SMALLEST_STEP_PX = 0.03


@dataclass(frozen=True, slots=True)
class OnlineState:
    """What an online calibration has done so far.

    Parameters
    ----------
    center_px, tilt_rad : (float, float)
        Now in use.
    moved_px : float
        How far the centre has moved from the camera file's.
    tilted_rad : float
        How far the tilt has.
    at_bound : bool
        Whether it would go farther if it might: calibrate anew, or see what is loose.
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
        return moved + (", at the bound: calibrate anew" if self.at_bound else "")


@dataclass(frozen=True, eq=False)
class _Seen:
    pose: Pose2
    boundary_px: FloatArray
    line_px: FloatArray


class OnlineCalibration:
    """Refines a camera by the frames a `Vision` looks at; give it to that `Vision` as `online`.

    Parameters
    ----------
    field : Field
        The pitch.
    camera : OmniCamera
        Where it starts, and what the bounds are about.
    mask : (H, W) uint8, optional
        As for the `Vision`.
    max_center_px : float
        How far the centre may go, in either coordinate.
    max_tilt_rad : float
        How far the tilt may go, about either axis.
    every : int
        Only every so many frames is looked at: it costs some milliseconds, and a fit some tens, after which the tables
        of the new camera are made.
    window : int
        Frames that are kept.

    Raises
    ------
    ArgumentError
        If a bound is not positive or a number is below 1.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        mask: UInt8Array | None = None,
        *,
        max_center_px: float = 3.0,
        max_tilt_rad: float = math.radians(1.0),
        every: int = 5,
        window: int = 20,
    ) -> None:
        for name, value in (("max_center_px", max_center_px), ("max_tilt_rad", max_tilt_rad)):
            if not 0 < value < math.inf:
                raise ArgumentError(f"{name} must be positive, got {value}")
        if every < 1:
            raise ArgumentError(f"every must be at least 1, got {every}")
        if window < _MIN_FRAMES:
            raise ArgumentError(f"window must be at least {_MIN_FRAMES}, got {window}")
        self.camera = camera
        self._field, self._every, self._window = field, every, window
        self._shape = FieldShape(field)
        self._finder = LineFinder(camera, field.line_width_m, mask)
        self._model = CameraModel(camera, "kept")
        self._start = self._model.vector(camera)
        self._now = self._start.copy()
        self._reach = np.zeros(self._model.size)
        self._reach[CENTER], self._reach[TILT] = max_center_px, max_tilt_rad
        self._seen: list[_Seen] = []
        self._count, self._new, self._steps = 0, 0, 0
        self._at_bound = False
        self._warm_up()

    @property
    def state(self) -> OnlineState:
        """Where it stands."""
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
        """Take note of a frame (H, W, 3) uint8 and what was seen in it; return a camera that is better, if any."""
        self._count += 1
        if self._count % self._every or not self._note(frame, view):
            return None
        self._new += 1
        if len(self._seen) < _MIN_FRAMES or self._new < _FRAMES_BETWEEN:
            return None
        self._new = 0
        return self._step()

    def _note(self, frame: UInt8Array, view: View) -> bool:
        """Keep a frame's points, if they are worth it."""
        estimate = view.pose
        if not isinstance(estimate, PoseEstimate) or estimate.inlier_share < _MIN_SHARE:
            return False
        boundary = view.boundary_px if self._field.is_bounded else np.empty((0, 2))
        boundary = boundary[np.isfinite(boundary).all(axis=1)]
        lines = self._finder.find(frame).pixels
        seen = _Seen(estimate.pose, _thinned(boundary), _thinned(lines))
        if len(seen.boundary_px) + len(seen.line_px) < _MIN_POINTS:
            return False
        self._seen = [other for other in self._seen if not _same_place(other.pose, seen.pose)][1 - self._window :]
        self._seen.append(seen)
        return True

    def _step(self) -> OmniCamera | None:
        low, high = self._start - self._reach, self._start + self._reach
        points = _points(self._seen)
        joint = JointFit(self._shape, points)
        poses = np.array([seen.pose.array for seen in self._seen])
        fit = joint.solve(self._model, self._now, poses, _SCALES_PX, self._start, (low, high), repeats=2, most=4)
        std = np.sqrt(np.diag(joint.covariance(fit)))[CENTER].max()
        self._seen = [
            dataclasses.replace(seen, pose=Pose2(*pose.tolist()))
            for seen, pose in zip(self._seen, fit.poses, strict=True)
        ]
        on_edge = np.minimum(fit.vector - low, high - fit.vector)
        self._at_bound = bool(on_edge.min() < 1e-9)
        # at its bound a fit is as poor as the camera is far off: the bound itself protects then
        if std > _MIN_KNOWN_PX * min(self.camera.size_px) / 220 and not self._at_bound:
            return None
        if _shift_px(self._model.camera(self._now), fit.camera) < _SMALLEST_STEP_PX:
            return None
        self._now = self._now + _GAIN * (fit.vector - self._now)
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


def _thinned(pixels: FloatArray) -> FloatArray:
    return pixels[:: max(1, -(-len(pixels) // _MAX_POINTS))]


def _same_place(pose: Pose2, other: Pose2) -> bool:
    distance_m, angle_rad = pose.error_to(other)
    return distance_m < _SAME_PLACE_M and angle_rad < _SAME_HEADING_RAD


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
