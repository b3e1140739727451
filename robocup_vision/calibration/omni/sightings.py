"""The points that a calibration keeps of a frame: the floor's edge and white lines, in pixels.

The frame itself is not kept, so that a folder of a thousand images needs no more memory than one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from field_models.errors import FrameError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.omni.fit import Points
from robocup_vision.calibration.omni.settings import FramePointSettings
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.perception.line_points import LineFinder
from robocup_vision.perception.polar_view import PolarView
from robocup_vision.vision import Vision


@dataclass(frozen=True, eq=False)
class Sighting:
    """The points of one frame."""

    index: int  #: number of the frame
    #: (K,) float64: image radius of the floor's edge at each bearing about the observer's centre; NaN where none
    radius_px: FloatArray
    boundary_px: FloatArray  #: (B, 2) float64: the same as pixels, without gaps
    line_px: FloatArray  #: (L, 2) float64: points on painted lines
    line_weight: FloatArray  #: (L,) float64: 1 with floor on both sides, less otherwise
    pose: Pose2 | None  #: the robot's pose by this frame and the observer's camera


class Observer:
    """Finds points in frames by a camera that may be wrong.

    Parameters
    ----------
    camera : OmniCamera
        Its centre and usable radii are used, and its curve for the width of lines.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    locate : bool
        Whether poses are estimated, too: they need a camera that is nearly right.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        mask: UInt8Array | None,
        *,
        locate: bool,
        settings: FramePointSettings = FramePointSettings(),
    ) -> None:
        self.field, self._settings = field, settings
        self._locate, self._size_px = locate, tuple(camera.size_px)
        by_outline = field.is_bounded and not locate
        self._vision = Vision(field, camera, method="floor" if by_outline else "field", mask=mask)
        self._finder = LineFinder(camera, field.line_width_m, mask)
        self.polar = PolarView(camera, mask=mask)
        self.floor_ratio = np.zeros(len(self.polar.radius_px))

    def look(self, index: int, frame: UInt8Array) -> Sighting:
        """Find a frame's points.

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
        self.floor_ratio += (view.marks > 0).mean(axis=0)
        lines = self._finder.find(frame)
        stride = -(-len(lines) // self._settings.max_line_points)
        chosen = np.arange(0, len(lines), max(stride, 1))
        boundary = view.boundary_px if self.field.is_bounded else np.empty((0, 2))
        seen = np.isfinite(boundary).all(axis=1)
        pose = view.pose.pose if self._locate and view.pose else None
        return Sighting(
            index, view.boundary_radius_px, boundary[seen], lines.pixels[chosen], lines.weight[chosen], pose
        )

    @property
    def inner_radius_px(self) -> float:
        """Image radius beyond which floor surrounds the robot in the frames so far."""
        enough = self._settings.min_floor_ratio * self.floor_ratio.max()
        return float(self.polar.radius_px[int(np.argmax(self.floor_ratio >= enough))])


def points_of(sightings: Sequence[Sighting]) -> Points:
    """Return all points of some sightings for a fit."""
    pixels, frame, is_line, weight = [], [], [], []
    for index, sighting in enumerate(sightings):
        boundary, lines = len(sighting.boundary_px), len(sighting.line_px)
        pixels += [sighting.boundary_px, sighting.line_px]
        frame.append(np.full(boundary + lines, index))
        is_line += [np.zeros(boundary, dtype=bool), np.ones(lines, dtype=bool)]
        weight += [np.ones(boundary), sighting.line_weight]
    return Points(np.vstack(pixels), np.concatenate(frame), np.concatenate(is_line), np.concatenate(weight))
