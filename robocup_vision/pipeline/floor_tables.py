"""The parts that measure the floor with a pinhole camera, and their tables for its different orientations.

Making the tables takes as long as ten looks. They are made for steps of the orientation, and kept; within a step they
are adapted: the samples of the same places on the floor move in the picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.balls.projection import PinholeBallProjection
from robocup_vision.perception.floor_view import FloorView, sees_floor
from robocup_vision.perception.free_space import FREE_RATIO, FloorMarking, FreeSpaceGrid
from robocup_vision.perception.polar_view import BEARINGS

# steps of tilt and roll (half a step moves the picture's border no more than a walking body does), and of the
# logarithms of height and focal length
_STEP_RAD, _STEP_LOG = math.radians(2.0), 0.02
# a camera beside the robot's centre moves around it when the head pans: steps of its place
_STEP_M = 0.004
# number of tables kept for a camera of known orientation (a head that looks all around needs some forty pans, which
# share most of their tables; one that nods by 20 degrees up and down some sixty tilts and rolls), and of unknown
# orientation (for the body's sway)
_MAX_TABLES, _MAX_TABLES_UNKNOWN_TILT = 128, 5

_Steps = tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class FloorTables:
    """The parts that measure the floor, for one orientation of the camera."""

    camera: PinholeCamera
    view: FloorView
    grid: FreeSpaceGrid
    marking: FloorMarking
    balls: PinholeBallProjection

    def held(self, camera: PinholeCamera, sway_std_rad: tuple[float, float] | None = None) -> FloorTables:
        """Return the parts for a frame in which neck and body hold the camera in the orientation of `camera`.

        Parameters
        ----------
        sway_std_rad : (float, float), optional
            Standard deviations of its tilt and roll, if they were measured in the frame.
        """
        held = self.camera.held_as(camera)
        # the tables keep their own height
        view = self.view.held(self.camera.with_orientation(camera.pan_rad, camera.tilt_rad, camera.roll_rad))
        grid, marking = self.grid.held(view), self.marking.held(view)
        return FloorTables(held, view, grid, marking, self.balls.held(held, sway_std_rad))

    def panned(self, pan_rad: float) -> FloorTables:
        """Return the parts for another pan; only what depends on the robot frame is computed again."""
        camera = self.camera.with_orientation(pan_rad, self.camera.tilt_rad, self.camera.roll_rad)
        view = self.view.panned(camera)
        grid = FreeSpaceGrid(view, self.grid.directions, self.grid.rings, self.grid.threshold)
        return FloorTables(camera, view, grid, self.marking, self.balls)


class FloorTableCache:
    """Makes the parts that measure the floor, and keeps the most recently used ones.

    Parameters
    ----------
    mask : (H, W) uint8 or None
        Non-zero pixels are never used.
    directions, rings, free_ratio
        Settings of the free space: directions, rings and threshold of `FreeSpaceGrid`.
    """

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        mask: UInt8Array | None,
        directions: int,
        rings: int | tuple[float, ...],
        free_ratio: float = FREE_RATIO,
    ) -> None:
        self._field = field
        self._camera = camera
        self._mask = mask
        self._directions, self._rings, self._free_ratio = directions, rings, free_ratio
        reach_m = math.hypot(*camera.offset_m)
        self._pan_step_rad = _STEP_M / reach_m if reach_m else math.inf
        self._made: dict[_Steps, FloorTables | None] = {}

    def for_camera(self, camera: PinholeCamera) -> FloorTables | None:
        """Return the parts for the step of this orientation, to be adapted with `held`; None: no floor is visible.

        Parameters
        ----------
        camera : PinholeCamera
            The file's camera with a frame's mounting; if the file leaves the tilt open, the focal length may also
            differ.
        """
        steps = self._steps(camera)
        made = self._made.pop(steps) if steps in self._made else self._make(steps)
        self._made[steps] = made
        if len(self._made) > (_MAX_TABLES if self._camera.known_orientation else _MAX_TABLES_UNKNOWN_TILT):
            del self._made[next(iter(self._made))]
        return made

    def _steps(self, camera: PinholeCamera) -> _Steps:
        pan = round((camera.pan_rad or 0.0) / self._pan_step_rad)
        file = self._camera
        tilt = (camera.tilt_rad or 0.0) - (file.tilt_rad or 0.0)
        roll = (camera.roll_rad or 0.0) - (file.roll_rad or 0.0)
        height, focal = camera.height_m / file.height_m, camera.focal_px[0] / file.focal_px[0]
        logs = (round(math.log(ratio) / _STEP_LOG) for ratio in (height, focal))
        return (pan, *(round(angle / _STEP_RAD) for angle in (tilt, roll)), *logs)

    def _make(self, steps: _Steps) -> FloorTables | None:
        # for a camera at the robot's centre all pans have the same tables
        pan_rad = steps[0] * self._pan_step_rad if steps[0] else 0.0
        for other, made in self._made.items():
            if other[1:] == steps[1:]:
                return None if made is None else made.panned(pan_rad)
        file = self._camera
        camera = file.with_orientation(pan_rad, file.tilt_rad, file.roll_rad)
        if not file.known_orientation or any(steps[1:]):
            tilt, roll, height, focal = steps[1:]
            scale = math.exp(_STEP_LOG * focal)
            focal_px = file.focal_px[0] * scale, file.focal_px[1] * scale
            height_m = file.height_m * math.exp(_STEP_LOG * height)
            tilt_rad, roll_rad = (file.tilt_rad or 0.0) + _STEP_RAD * tilt, (file.roll_rad or 0.0) + _STEP_RAD * roll
            camera = camera.as_fitted(tilt_rad, roll_rad, height_m, focal_px)
        if not sees_floor(camera):
            return None
        view = FloorView(camera, max(BEARINGS, 2 * self._directions), self._mask)
        return FloorTables(
            camera,
            view,
            FreeSpaceGrid(view, self._directions, self._rings, self._free_ratio),
            FloorMarking(view, self._field.line_width_m, 2 * self._field.robot_radius_m),
            PinholeBallProjection(camera, self._field.ball_radius_m),
        )
