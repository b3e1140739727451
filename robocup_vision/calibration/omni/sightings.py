"""What a calibration keeps of a frame: where the floor's edge and white lines were seen, in pixels, and nothing else.

The frame itself is forgotten, so that a folder of a thousand images needs no more memory than one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from field_models.errors import FrameError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.omni.fit import Points
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.perception.line_points import LineFinder
from robocup_vision.perception.polar_view import PolarView
from robocup_vision.vision import Vision

# a frame is of use with so many points of either kind
MIN_BOUNDARY_POINTS, MIN_LINE_POINTS = 25, 40
# floor is all around where it fills this share of what it fills at best: before that the robot's body is in the way
_ALL_AROUND = 0.9
# more line points than this are thinned out: they are neighbours of one another
_MAX_LINE_POINTS = 500


@dataclass(frozen=True, eq=False)
class Sighting:
    """The points of one frame.

    Parameters
    ----------
    index : int
        Number of the frame.
    radius_px : (K,) float64
        Image radius of the floor's edge at each bearing about the centre it was looked at from; NaN where none.
    boundary_px : (B, 2) float64
        The same as pixels, without gaps.
    line_px : (L, 2) float64
        Points on painted lines.
    line_weight : (L,) float64
        1 with floor on both sides, less otherwise.
    pose : Pose2 or None
        Where the frame puts the robot through the camera it was looked at with.
    """

    index: int
    radius_px: FloatArray
    boundary_px: FloatArray
    line_px: FloatArray
    line_weight: FloatArray
    pose: Pose2 | None


class Observer:
    """Takes points from frames through one camera, however wrong.

    Parameters
    ----------
    field : Field
        The pitch.
    camera : OmniCamera
        Its centre, usable radii and, for how wide lines look, its curve count.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    locate : bool
        Whether the camera is good enough for poses to be worth the time.
    """

    def __init__(self, field: Field, camera: OmniCamera, mask: UInt8Array | None, *, locate: bool) -> None:
        self.field = field
        self._locate, self._size_px = locate, tuple(camera.size_px)
        by_outline = field.is_bounded and not locate
        self._vision = Vision(field, camera, method="floor" if by_outline else "field", mask=mask)
        self._finder = LineFinder(camera, field.line_width_m, mask)
        self.polar = PolarView(camera, mask=mask)
        self.floor_share = np.zeros(len(self.polar.radius_px))

    def look(self, index: int, frame: UInt8Array) -> Sighting:
        """Take a frame's points.

        Raises
        ------
        FrameError
            If the frame has another size or type than the camera says.
        """
        if isinstance(frame, np.ndarray) and frame.ndim == 3 and frame.shape[1::-1] != self._size_px:
            width, height = self._size_px
            raise FrameError(f"is {frame.shape[1]}x{frame.shape[0]}, must be {width}x{height}")
        self._vision.forget()
        view = self._vision.look(frame)
        self.floor_share += (view.marks > 0).mean(axis=0)
        lines = self._finder.find(frame)
        stride = -(-len(lines) // _MAX_LINE_POINTS)
        chosen = np.arange(0, len(lines), max(stride, 1))
        boundary = view.boundary_px if self.field.is_bounded else np.empty((0, 2))
        seen = np.isfinite(boundary).all(axis=1)
        pose = view.pose.pose if self._locate and view.pose else None
        return Sighting(
            index, view.boundary_radius_px, boundary[seen], lines.pixels[chosen], lines.weight[chosen], pose
        )

    @property
    def inner_radius_px(self) -> float:
        """Image radius beyond which floor surrounds the robot in the frames looked at."""
        return float(self.polar.radius_px[int(np.argmax(self.floor_share >= _ALL_AROUND * self.floor_share.max()))])


def points_of(sightings: Sequence[Sighting]) -> Points:
    """All points of some sightings, as a fit wants them."""
    pixels, frame, is_line, weight = [], [], [], []
    for index, sighting in enumerate(sightings):
        boundary, lines = len(sighting.boundary_px), len(sighting.line_px)
        pixels += [sighting.boundary_px, sighting.line_px]
        frame.append(np.full(boundary + lines, index))
        is_line += [np.zeros(boundary, dtype=bool), np.ones(lines, dtype=bool)]
        weight += [np.ones(boundary), sighting.line_weight]
    return Points(np.vstack(pixels), np.concatenate(frame), np.concatenate(is_line), np.concatenate(weight))
