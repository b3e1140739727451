"""Interface of all localisers: the evidence of one frame and a prior in, a localisation out."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import EdgePoints, NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.color_table import ColorTable
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.polar_view import PolarView

Camera = OmniCamera | PinholeCamera


class FrameEvidence(NamedTuple):
    """Evidence of one frame for a localiser; a tuple, because one is made in each frame.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR, black under the mask.
    camera : OmniCamera or PinholeCamera
        The camera as mounted on the robot in this frame, including a head's pan.
    table : ColorTable or None
        Classifies the frame's colours; None if they are not known.
    view : PolarView, FloorView or None
        Places of the floor samples; None if the camera's tilt is not known.
    edge_px : (K,) float64
        The floor's edge at each of the view's bearings, as its `radius_px`; NaN if there is none.
    floor_column : (K,) int64
        Outermost floor sample of each bearing; -1 if there is none.
    marks : (K, M) uint8 or None
        Class of each sample: 0 blocked, 1 floor, 2 line; None if it is not computed before the pose.
    t_s : float or None
        Time of the frame.
    may_search : bool
        Whether to search elsewhere, which takes long, if the robot is not at the prior.
    """

    frame: UInt8Array
    camera: Camera
    table: ColorTable | None
    view: PolarView | FloorView | None
    edge_px: FloatArray
    floor_column: Int64Array
    marks: UInt8Array | None = None
    t_s: float | None = None
    may_search: bool = True


def frame_alone(frame: UInt8Array, camera: PinholeCamera, t_s: float | None = None) -> FrameEvidence:
    """Return the evidence of a BGR frame (H, W, 3) of which nothing was measured before."""
    return FrameEvidence(frame, camera, None, None, np.empty(0), np.empty(0, np.int64), t_s=t_s)


class Localization(NamedTuple):
    """Result of a localiser; a tuple, because one is made in each frame.

    Parameters
    ----------
    pose : PoseEstimate or NotLocated
        The robot on the field.
    camera : OmniCamera or PinholeCamera
        The camera with tilt and roll as fitted to this frame, if they were.
    wall_px : (K,) float64 or None
        Predicted feet of walls, as `edge_px`; None if the localiser does not compute them.
    measurement : callable or None
        Returns, now or later, the estimate by the frame without the prior, if `pose` includes the prior as a factor;
        the filter uses it, so that the prior does not count twice. None if `pose` does not include the prior.
    edge_points : EdgePoints, callable or None
        Predicted edges of the field and their measurements in the frame, or a function that returns them, now or later;
        None if the localiser does not predict edges.
    held_covariance : (4, 4) float64 or None
        Covariance of the camera's tilt and roll (rad), height (m) and logarithm of the focal length by the frame; None
        if it does not determine them.
    tells_half : bool
        Whether the frame itself determines the half of the field. Otherwise the half turn of each candidate is one,
        too.
    """

    pose: PoseEstimate | NotLocated
    camera: Camera
    wall_px: FloatArray | None = None
    measurement: Callable[[], PoseEstimate] | None = None
    edge_points: EdgePoints | Callable[[], EdgePoints] | None = None
    held_covariance: FloatArray | None = None
    tells_half: bool = False


class Localizer(Protocol):
    """Estimates a robot's pose from one frame."""

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """Locate the robot.

        Parameters
        ----------
        evidence : FrameEvidence
            Evidence of one frame.
        prior : PoseEstimate or Pose2, optional
            Probable pose of the robot, field frame; a `Pose2` has no covariance.
        """
        ...

    def forget(self) -> None:
        """Forget the previous frames."""
        ...


class FrameByFrame:
    """A localiser without state."""

    def forget(self) -> None:
        """See `Localizer.forget`."""
