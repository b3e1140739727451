"""Locates a robot by a landmark map frame after frame; each pose is the prior of the next."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arguments import as_frame
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.landmarks.landmark_map import LandmarkMap
from robocup_vision.landmarks.locate import LandmarkMatch, LandmarkPoseEstimator
from robocup_vision.landmarks.selection import Selection

_MIN_WIDTH = 640
_GOOD, _BAD, _UNSEEN = (80, 220, 80), (60, 60, 255), (200, 160, 60)


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkView:
    """The pose by one frame and a landmark map.

    Parameters
    ----------
    pose : PoseEstimate or NotLocated
        Pose of the robot on the field.
    match : LandmarkMatch
        The landmarks by which it was estimated.
    timings_s : mapping of str to float
        Seconds of each stage, and ``total``.
    camera : PinholeCamera
        The camera on the robot.
    t_s : float or None
        Time of the frame, as given to `look`.
    """

    pose: PoseEstimate | NotLocated
    match: LandmarkMatch
    timings_s: Mapping[str, float]
    camera: PinholeCamera
    t_s: float | None = None

    @property
    def camera_pose(self) -> PoseEstimate | NotLocated:
        """Pose of the camera on the field: its foot on the floor, and the heading of its optical axis."""
        if isinstance(self.pose, NotLocated):
            return self.pose
        return self.pose.seen_from(self.camera.camera_in_robot)


class LandmarkVision:
    """Turns camera frames into views by a landmark map; one object for each camera and thread.

    Parameters
    ----------
    landmarks : LandmarkMap
        From `load_map`, or made by a `StereoMapper`.
    camera : PinholeCamera
        As mounted on the robot; its tilt must be known. With offset and pan 0 the pose is the camera's own.
    selection, limit_s, regions
        See `LandmarkPoseEstimator`.
    mask : (H, W) uint8, optional
        Non-zero pixels are never used.
    """

    def __init__(
        self,
        landmarks: LandmarkMap,
        camera: PinholeCamera,
        *,
        selection: Selection | None = None,
        limit_s: float | None = None,
        regions: bool = False,
        mask: UInt8Array | None = None,
    ) -> None:
        if mask is not None and mask.shape != (camera.size_px[1], camera.size_px[0]):
            raise ArgumentError(f"mask must be as large as the camera's images, got {mask.shape}")
        self.estimator = LandmarkPoseEstimator(
            landmarks,
            camera,
            selection=selection,
            limit_s=limit_s,
            regions=regions,
        )
        # the first frame has no prior; its tables are built here
        prepare("landmarks")
        self.estimator.prepare()
        self.camera = camera
        self._hidden = None if mask is None else mask != 0
        self._last: Pose2 | None = None

    def look(
        self,
        frame: UInt8Array,
        t_s: float | None = None,
        odometry: Pose2 | None = None,
        prior: PoseEstimate | Pose2 | None = None,
    ) -> LandmarkView:
        """Locate the robot by a frame.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR, of the camera's size.
        t_s : float, optional
            Time of the frame, for the view.
        odometry : Pose2, optional
            The robot's motion since the frame before, in its frame then.
        prior : PoseEstimate or Pose2, optional
            Probable pose of the robot. By default it is the last pose, moved by the odometry; if there is none, the
            whole map is searched.

        Raises
        ------
        FrameError
            If the frame has another size or type.
        """
        started = time.perf_counter()
        as_frame(frame, self.camera.size_px)
        if self._hidden is not None:
            frame = frame.copy()
            frame[self._hidden] = 0
        if prior is None and self._last is not None:
            prior = self._last if odometry is None else self._last.compose(odometry)
        match = self.estimator.look(frame, prior)
        if match.pose:
            self._last = match.pose.pose
        elif self._last is not None:
            # the next prior is dead reckoning; the whole map is searched if that fails
            self._last = None if odometry is None else self._last.compose(odometry)
        timings_s = {**match.timings_s, "total": time.perf_counter() - started}
        return LandmarkView(match.pose, match, timings_s, self.camera, t_s)

    def forget(self) -> None:
        """Forget the last pose, so that the next frame has no prior."""
        self._last = None


def draw_landmarks(view: LandmarkView, frame: UInt8Array) -> UInt8Array:
    """Draw a view over its frame: inliers as green circles, outliers as red ones, landmarks not found as blue ones.

    Returns
    -------
    (s H, s W, 3) uint8
        A new picture, a whole number s times as large as the frame.
    """
    scale = max(1, math.ceil(_MIN_WIDTH / frame.shape[1]))
    canvas = np.asarray(cv2.resize(frame, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    match = view.match

    def place(pixel: npt.NDArray[np.float64]) -> tuple[int, int]:
        u, v = (pixel + 0.5) * scale - 0.5
        return round(float(u)), round(float(v))

    found = np.zeros(len(match.expected), dtype=bool)
    found[match.matched] = True
    for pixel in match.expected.pixels[~found]:
        cv2.circle(canvas, place(pixel), 4, _UNSEEN, 1, cv2.LINE_AA)
    for pixel, is_inlier in zip(match.pixels, match.inliers, strict=True):
        cv2.circle(canvas, place(pixel), 4, _GOOD if is_inlier else _BAD, 2, cv2.LINE_AA)
    if not isinstance(view.pose, NotLocated):
        pose, std = view.pose.pose, view.pose.std
        text = (
            f"{pose.x_m:+.3f} {pose.y_m:+.3f} m {math.degrees(pose.theta_rad):+.2f} deg, "
            f"+- {1e3 * std[0]:.0f} {1e3 * std[1]:.0f} mm"
        )
    else:
        text = view.pose.reason
    for color, thickness in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(canvas, text, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, color, thickness, cv2.LINE_AA)
    return canvas
