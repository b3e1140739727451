"""Looks at a frame again that confirms no pose, or next to none: for lines of other widths, and in smaller copies.

A line may be two tapes side by side, or worn. A blurred one is a slope as wide as the blur: a search of a few pixels
sees too little of the step, and takes its border for something other than carpet. In a smaller copy the blur is
shorter by the same factor.
"""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import EdgePoints, NotLocated, PoseEstimate
from robocup_vision.localization.model_edges.follower import EdgeFollower, FollowedCamera, FollowerState
from robocup_vision.localization.model_edges.settings import EdgeSettings


class SecondLook:
    """Follows where the first look does not: bright bands of any width may be lines, in smaller copies, too.

    No copy is narrower than `EdgeSettings.min_copy_px`: a small frame has no copy but itself.
    """

    def __init__(self, field: Field, camera: PinholeCamera, settings: EdgeSettings) -> None:
        self._field, self._camera = field, camera
        self._settings = settings.for_doubted_frames()
        self._factors = [k for k in settings.copy_factors if k == 1 or camera.size_px[0] >= k * settings.min_copy_px]
        self._followers: dict[int, EdgeFollower] = {}
        self._last: EdgeFollower | None = None

    def hold(self, camera: PinholeCamera) -> None:
        """See `EdgeFollower.hold`."""
        self._camera = self._camera.held_as(camera)
        for follower in self._followers.values():
            follower.hold(camera)

    def follow(
        self,
        frame: UInt8Array,
        prior: PoseEstimate,
        dt_s: float,
        before: FollowerState,
        first: FollowedCamera | NotLocated = NotLocated("not asked for"),
        *,
        may_compare: bool = False,
    ) -> FollowedCamera | NotLocated:
        """Locate the camera by the frame, or by the largest copy of it that confirms a pose.

        Parameters
        ----------
        before : FollowerState
            Of the follower of whole frames, before this frame.
        first : FollowedCamera or NotLocated
            Of the first look: an answer must leave the position clearly less open.
        may_compare : bool
            Whether smaller copies are examined, too, while an accepted answer leaves the position open.
        """
        settings = self._settings
        answer: FollowedCamera | NotLocated = NotLocated("no second look at the frame confirms a pose")
        open_m = settings.less_open * first.evidence.position_std_m if first else math.inf
        for factor in self._factors:
            follower = self._made_follower(factor)
            follower.state = before
            found = follower.follow(copy_of(frame, follower.camera.size_px), prior, dt_s)
            if not found or found.evidence.position_std_m >= open_m:
                continue
            self._last = follower
            residual_px = factor * found.estimate.residual_px
            answer = replace(found, estimate=replace(found.estimate, residual_px=residual_px), file_camera=self._camera)
            open_m = settings.less_open * found.evidence.position_std_m
            if not may_compare or found.evidence.position_std_m < settings.open_m:
                break
        return answer

    @property
    def state(self) -> FollowerState:
        """State after the last answer."""
        assert self._last is not None
        return self._last.state

    def edge_points(self) -> EdgePoints:
        """Return where the last answer predicts the field's edges, in pixels of the whole frame."""
        assert self._last is not None
        return edge_points_in(self._camera.size_px, self._last)

    def _made_follower(self, factor: int) -> EdgeFollower:
        if factor not in self._followers:
            self._followers[factor] = EdgeFollower(self._field, smaller_camera(self._camera, factor), self._settings)
        return self._followers[factor]


def edge_points_in(size_px: tuple[int, int], follower: EdgeFollower) -> EdgePoints:
    """Return the edges that a follower of copies predicted last, in pixels of the whole frame."""
    points, per_px = follower.edge_points(), np.divide(size_px, follower.camera.size_px)
    return EdgePoints((points.pixels + 0.5) * per_px - 0.5, points.state)


def copy_of(frame: UInt8Array, size_px: tuple[int, int]) -> UInt8Array:
    """Return a copy of a frame in another size, or the frame itself if it has that size."""
    if frame.shape[1::-1] == size_px:
        return frame
    return np.asarray(cv2.resize(frame, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def smaller_camera(camera: PinholeCamera, factor: int) -> PinholeCamera:
    """Return the camera whose frames are this many times smaller."""
    size_px = (camera.size_px[0] // factor, camera.size_px[1] // factor)
    across, down = camera.size_px[0] / size_px[0], camera.size_px[1] / size_px[1]
    return replace(
        camera,
        size_px=size_px,
        focal_px=(camera.focal_px[0] / across, camera.focal_px[1] / down),
        center_px=((camera.center_px[0] + 0.5) / across - 0.5, (camera.center_px[1] + 0.5) / down - 0.5),
        focal_std_px=camera.focal_std_px / factor,
    )
