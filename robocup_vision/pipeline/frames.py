"""The steps common to every camera's pipeline: check and mask the frame, learn and keep the floor's colour."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arguments import as_frame
from robocup_vision.arrays import UInt8Array, plain_frame
from robocup_vision.avoidance.recent_free_space import carry_free_space
from robocup_vision.estimates import NotLocated, PoseEstimate, SwappedChannels, pose_of
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor import free_ranges, polar
from robocup_vision.localization.field_half import in_both_halves
from robocup_vision.localization.localizer import Localization
from robocup_vision.localization.methods import Method
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.color_memory import ColorMemory
from robocup_vision.perception.color_table import LLR_PER_UNIT, Colors
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.free_space import FREE_RATIO, FreeSpace
from robocup_vision.perception.markings.finder import MarkingFinder
from robocup_vision.perception.obstacles import ObstacleFinder
from robocup_vision.perception.polar_view import PolarView
from robocup_vision.pipeline.channel_order import ChannelOrder

# time for which free space is carried on without a frame: others may have moved by a robot's width by then
_MAX_CARRIED_S = 0.5
# assumed between frames without times
_USUAL_STEP_S = 1 / 30
NO_FRAME = "no frame: the camera gave none this time"
BGR, RGB = CHANNELS = ("bgr", "rgb")


@dataclass(frozen=True, slots=True)
class FloorEdgeSettings:
    """Thresholds by which the floor's end on a bearing is found."""

    certain_nats: float = 3.0  #: mean log-likelihood ratio that makes a run of samples floor: 20 to 1
    #: sum of the log-likelihood ratios that a strip of floor behind a line needs: it may be two samples long
    strip_nats: float = 5.0
    line_gap_columns: int = 3  #: columns that a painted line may hide
    min_contrast: float = 5.0  #: smallest colour difference of an edge, in standard deviations of the noise


class _CarriedFloor(NamedTuple):
    """Free space of the last frame moved to now, when that frame was taken, and how many have been dropped since.

    A tuple, as one is made in each frame.
    """

    free_space: FreeSpace
    frame_s: float | None
    dropped: int


def _measured_in_both_halves(measurement: Callable[[], PoseEstimate], near: Pose2 | None = None) -> PoseEstimate:
    return in_both_halves(measurement(), near)


def to_bgr(frame: UInt8Array, channels: str) -> UInt8Array:
    """Return a frame (H, W, 3) as a plain array of blue, green, red: itself where it is one."""
    if channels == BGR:
        return plain_frame(frame)
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(frame), cv2.COLOR_RGB2BGR), dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class FrameOptions:
    """How frames are looked at, whichever camera gives them; parameters as those of `Vision`."""

    method: Method
    colors: Colors | None
    mask: UInt8Array | None
    directions: int
    rings: int | tuple[float, ...]
    channels: str
    free_ratio: float = FREE_RATIO


class FramePipeline:
    """The steps of `Vision` that every camera needs.

    Parameters
    ----------
    size_px : (int, int)
        Of the frames.
    strongest_cast : float
        See `ColorMemory`.
    """

    def __init__(
        self,
        field: Field,
        size_px: tuple[int, int],
        options: FrameOptions,
        strongest_cast: float = math.inf,
    ) -> None:
        if options.channels not in CHANNELS:
            raise ArgumentError(f"channels must be 'bgr' or 'rgb', got {options.channels!r}")
        self.field = field
        self.edge_settings = FloorEdgeSettings()
        self._size_px = size_px
        self._has_warned = False
        self._channel_order = ChannelOrder(field)
        self._obstacle_finder = ObstacleFinder(field)
        width, height = size_px
        mask = options.mask
        if mask is not None:
            # a copy: the caller's array may be a view, or change
            mask = np.array(mask)
            if mask.shape != (height, width) or mask.dtype != np.uint8:
                raise ArgumentError(f"mask must be ({height}, {width}) uint8, got {mask.shape} {mask.dtype}")
        self._mask, self._options = mask, replace(options, mask=mask)
        self._marking_finder = MarkingFinder(field, mask)
        self._keep = None if mask is None else (mask == 0).astype(np.uint8)
        self._color_memory = ColorMemory(field, options.colors, strongest_cast)
        self._last_pose: Pose2 | None = None
        self._carried: _CarriedFloor | None = None

    def forget(self) -> None:
        """Forget learnt colours, the last pose and floor: the next frame stands alone."""
        self._has_warned = False
        self._channel_order.forget()
        self._carried = None
        self._color_memory.forget()
        self._last_pose = None

    @property
    def colors(self) -> Colors | None:
        """The colours in use, None before the first frame."""
        return self._color_memory.colors

    @property
    def swapped_channels_nats(self) -> float:
        """See `Vision.swapped_channels_nats`."""
        return self._channel_order.nats

    def on_floor(self, balls: tuple[Ball, ...], pose: Pose2 | None) -> tuple[Ball, ...]:
        """Return those of the balls that a known pose puts on the floor, where walls or boards bound it."""
        if not balls or pose is None or not self.field.is_bounded:
            return balls
        return tuple(ball for ball in balls if self._is_on_floor(ball, pose))

    def _near_floor_nats(self, llr: npt.NDArray[np.int8], view: PolarView | FloorView) -> float:
        """Mean log-likelihood ratio of the floor in the nearest third of the columns of samples (K, M)."""
        return float(free_ranges.sum_near(llr, llr.shape[1] // 3)) * LLR_PER_UNIT / view.near_count

    def _is_on_floor(self, ball: Ball, pose: Pose2) -> bool:
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        return self.field.is_on_floor(pose.x_m + c * ball.x_m - s * ball.y_m, pose.y_m + s * ball.x_m + c * ball.y_m)

    def _last_floor(self, llr: npt.NDArray[np.int8], view: PolarView | FloorView) -> npt.NDArray[np.int64]:
        """(K,) int64: each bearing's outermost column of floor, -1 where none."""
        columns = np.empty(view.bearings, dtype=np.int64)
        settings = self.edge_settings
        certain, strip = int(settings.certain_nats / LLR_PER_UNIT), int(settings.strip_nats / LLR_PER_UNIT)
        polar.outer_boundary(llr, view.valid, certain, settings.line_gap_columns, strip, columns)
        return columns

    def _keep_floor(self, free_space: FreeSpace, t_s: float | None) -> None:
        """Keep a frame's free space, for frames that are dropped after it."""
        self._carried = _CarriedFloor(free_space, t_s, 0)

    def _carry(self, odometry: Pose2 | None, t_s: float | None) -> FreeSpace | None:
        """Return the last frame's free space moved by the odometry; None if there is none, or it is too old."""
        kept = self._carried
        # without odometry it is not known where the robot is at the next frame
        known = self._last_pose if odometry is not None else None
        self._last_pose = None if known is None or odometry is None else known.compose(odometry)
        if kept is None:
            return None
        dropped = kept.dropped + 1
        free_space = kept.free_space if odometry is None else carry_free_space(kept.free_space, odometry)
        self._carried = _CarriedFloor(free_space, kept.frame_s, dropped)
        seconds = dropped * _USUAL_STEP_S if t_s is None or kept.frame_s is None else t_s - kept.frame_s
        return free_space if seconds <= _MAX_CARRIED_S else None

    def _in_open_halves(self, answer: Localization, prior: PoseEstimate | Pose2 | None) -> Localization:
        """Return a localiser's answer, in both halves where its frame does not tell them apart: the prior's first."""
        pose, field = answer.pose, self.field
        if isinstance(pose, NotLocated) or field.is_half or (answer.tells_half and field.shows_half):
            return answer
        both, measurement = in_both_halves(pose, pose_of(prior)), answer.measurement
        if measurement is not None:
            measurement = partial(_measured_in_both_halves, measurement, both.pose)
        return answer._replace(pose=both, measurement=measurement)

    def _unless_swapped(self, pose: PoseEstimate | NotLocated) -> PoseEstimate | NotLocated:
        """Return a pose as far as it holds where red and blue may be swapped, and goals or beacons give the half.

        There is no pose where swapping is reported, and one in both halves where it is suspected.
        """
        if not pose or not self.field.shows_half:
            return pose
        reason = self._channel_order.reason
        if reason:
            self._last_pose = None
            return SwappedChannels(reason)
        return in_both_halves(pose) if self._channel_order.is_suspected else pose

    def _measurement_unless_swapped(
        self, measurement: Callable[[], PoseEstimate] | None
    ) -> Callable[[], PoseEstimate] | None:
        """Apply `_unless_swapped` to the estimate by the frame alone, which is computed when it is asked for."""
        if measurement is None or not self.field.shows_half:
            return measurement
        if self._channel_order.reason:
            return None
        if self._channel_order.is_suspected:
            return partial(_measured_in_both_halves, measurement)
        return measurement

    def _warnings(self, pose: PoseEstimate | NotLocated) -> tuple[str, ...]:
        """Return the warnings about the frames that a user has not had yet."""
        reason = pose.reason if isinstance(pose, SwappedChannels) else self._channel_order.reason
        if self._has_warned or not reason:
            return ()
        self._has_warned = True
        return (reason,)

    def checked(self, frame: UInt8Array) -> UInt8Array:
        """Return a frame of the right size and type as blue, green, red, black under the mask; else refuse it."""
        # kernels are compiled for plain arrays: a flipped view, or bytes from a message, would be compiled again
        plain = to_bgr(as_frame(frame, self._size_px), self._options.channels)
        if self._keep is None:
            return plain
        # masked pixels are black, so that no stage can read them
        return np.asarray(cv2.copyTo(plain, self._keep), dtype=np.uint8)
