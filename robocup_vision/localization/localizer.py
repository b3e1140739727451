"""The interface of every localiser: the evidence of one frame and a prior in, one shape of answer out."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

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
    """Evidence of one frame for a localiser; a tuple, as one is made in each frame.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR, black under the mask.
    camera : OmniCamera or PinholeCamera
        As it is mounted on the robot in this frame, a head's pan included.
    table : ColorTable or None
        Classifies the frame's colours; None where they are not known.
    view : PolarView, FloorView or None
        Where the floor samples lie; None where the camera's tilt is not known.
    edge_px : (K,) float64
        The floor's edge at each of the view's bearings, as its `radius_px`; NaN where none.
    floor_column : (K,) int64
        Each bearing's outermost floor sample; -1 where none.
    marks : (K, M) uint8 or None
        Class of each sample: 0 blocked, 1 floor, 2 line; None where it is not computed before the pose.
    t_s : float or None
        When the frame was taken.
    may_search : bool
        Whether a robot that is not where the prior has it may be searched for elsewhere, which takes long.
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


class Localization(NamedTuple):
    """A localiser's answer; a tuple, as one is made in each frame.

    Parameters
    ----------
    pose : PoseEstimate or NotLocated
        The robot on the field.
    camera : OmniCamera or PinholeCamera
        The camera as this frame shows it to be mounted on the robot: tilt and roll refined where they were fitted.
    wall_px : (K,) float64 or None
        Where the pose puts the walls, as `edge_px`; None where the localiser does not give it.
    measurement : callable or None
        Returns, now or later, the estimate by the frame without the prior, where `pose` includes the prior as a factor.
        The filter uses this one, so that the prior does not count twice. None where `pose` does not include the prior.
    edge_points : EdgePoints, callable or None
        Where edges of the field were predicted and what the frame shows there, or what returns that, now or later;
        None: the localiser predicts none.
    held_covariance : (4, 4) float64 or None
        Of the camera's tilt and roll (rad), height (m) and the logarithm of its focal length, where the frame
        shows them; None: it does not.
    tells_half : bool
        Whether the frame itself shows which half of the field it is. Else each candidate's half turn is one, too.
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
            Of one frame.
        prior : PoseEstimate or Pose2, optional
            Where the robot probably is, field frame; a `Pose2` states no covariance.
        """
        ...

    def forget(self) -> None:
        """Forget the frames before: the next one stands alone."""
        ...


class FrameByFrame:
    """A localiser to which each frame stands alone: there is nothing to forget."""

    def forget(self) -> None:
        """See `Localizer.forget`."""
