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

# longest time for which free space is used without a new frame: others may then have moved by a robot's width
_MAX_CARRIED_S = 0.5
# assumed time between frames that have no times
_USUAL_STEP_S = 1 / 30
NO_FRAME = "no frame: the camera gave none this time"
BGR, RGB = CHANNELS = ("bgr", "rgb")


@dataclass(frozen=True, slots=True)
class FloorEdgeSettings:
    """Thresholds for finding the floor's end on a bearing."""

    certain_nats: float = 3.0  #: mean log-likelihood ratio from which a run of samples is floor: 20 to 1
    #: sum of the log-likelihood ratios from which a strip behind a line is floor, even if it is only two samples long
    strip_nats: float = 5.0
    line_gap_columns: int = 3  #: greatest number of columns that a painted line may interrupt the floor
    min_contrast: float = 5.0  #: smallest colour difference of an edge, in standard deviations of the noise


class _CarriedFloor(NamedTuple):
    """Free space of the last frame moved to now, that frame's time, and the number of frames dropped since."""

    free_space: FreeSpace
    frame_s: float | None
    dropped: int


def _measured_in_both_halves(measurement: Callable[[], PoseEstimate], near: Pose2 | None = None) -> PoseEstimate:
    return in_both_halves(measurement(), near)


def to_bgr(frame: UInt8Array, channels: str) -> UInt8Array:
    """Return a frame (H, W, 3) as a plain BGR array; the frame itself if it is one."""
    if channels == BGR:
        return plain_frame(frame)
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(frame), cv2.COLOR_RGB2BGR), dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class FrameOptions:
    """The options of a pipeline of any camera; parameters as those of `Vision`."""

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
        Width and height of the frames.
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
            # a copy, since the caller may change the array
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
        """Forget learnt colours, the last pose and the last floor: the next frame is the first one again."""
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
        """Return the balls that are on the floor by a known pose; all balls if no walls or boards bound the floor."""
        if not balls or pose is None or not self.field.is_bounded:
            return balls
        return tuple(ball for ball in balls if self._is_on_floor(ball, pose))

    def _near_floor_nats(self, llr: npt.NDArray[np.int8], view: PolarView | FloorView) -> float:
        """Return the mean log-likelihood ratio of floor, nats, of the nearest third of the sample columns."""
        return float(free_ranges.sum_near(llr, llr.shape[1] // 3)) * LLR_PER_UNIT / view.near_count

    def _is_on_floor(self, ball: Ball, pose: Pose2) -> bool:
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        return self.field.is_on_floor(pose.x_m + c * ball.x_m - s * ball.y_m, pose.y_m + s * ball.x_m + c * ball.y_m)

    def _last_floor(self, llr: npt.NDArray[np.int8], view: PolarView | FloorView) -> npt.NDArray[np.int64]:
        """Return each bearing's outermost column of floor, (K,) int64; -1 if there is none."""
        columns = np.empty(view.bearings, dtype=np.int64)
        settings = self.edge_settings
        certain, strip = int(settings.certain_nats / LLR_PER_UNIT), int(settings.strip_nats / LLR_PER_UNIT)
        polar.outer_boundary(llr, view.valid, certain, settings.line_gap_columns, strip, columns)
        return columns

    def _keep_floor(self, free_space: FreeSpace, t_s: float | None) -> None:
        """Keep a frame's free space, for the case that the next frames are dropped."""
        self._carried = _CarriedFloor(free_space, t_s, 0)

    def _carry(self, odometry: Pose2 | None, t_s: float | None) -> FreeSpace | None:
        """Return the last frame's free space moved by the odometry; None if there is none, or it is too old."""
        kept = self._carried
        # without odometry the pose at the next frame is not known
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
        """Return an answer with candidates in both halves, the prior's first, if the frame does not decide the half."""
        pose, field = answer.pose, self.field
        if isinstance(pose, NotLocated) or field.is_half or (answer.tells_half and field.shows_half):
            return answer
        both, measurement = in_both_halves(pose, pose_of(prior)), answer.measurement
        if measurement is not None:
            measurement = partial(_measured_in_both_halves, measurement, both.pose)
        return answer._replace(pose=both, measurement=measurement)

    def _unless_swapped(self, pose: PoseEstimate | NotLocated) -> PoseEstimate | NotLocated:
        """Correct a pose whose half depends on colours, if red and blue may be swapped.

        If swapping is certain, the result is `SwappedChannels`; if it is suspected, both halves are candidates.
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
        """Apply `_unless_swapped` to the estimate without the prior, which is computed when it is first read."""
        if measurement is None or not self.field.shows_half:
            return measurement
        if self._channel_order.reason:
            return None
        if self._channel_order.is_suspected:
            return partial(_measured_in_both_halves, measurement)
        return measurement

    def _warnings(self, pose: PoseEstimate | NotLocated) -> tuple[str, ...]:
        """Return the warnings about the frames that have not been given yet."""
        reason = pose.reason if isinstance(pose, SwappedChannels) else self._channel_order.reason
        if self._has_warned or not reason:
            return ()
        self._has_warned = True
        return (reason,)

    def checked(self, frame: UInt8Array) -> UInt8Array:
        """Return a frame as plain BGR array with black under the mask; raise FrameError for a wrong size or type."""
        # kernels are compiled for plain arrays: for a flipped view, or bytes from a message, they would compile again
        plain = to_bgr(as_frame(frame, self._size_px), self._options.channels)
        if self._keep is None:
            return plain
        # masked pixels are black, so that no stage can read them
        return np.asarray(cv2.copyTo(plain, self._keep), dtype=np.uint8)
