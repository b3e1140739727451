"""Simulated overhead vision: detections with noise and hidden balls, the geometry, and saved images."""

from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.closing import Closing
from robocup_vision.evaluation.result_files import prepare_folder
from robocup_vision.files.images import write_png
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.geometry import wrap_angle
from robocup_vision.ssl.field import geometry_from_field
from robocup_vision.ssl.protocol.mapping import encode
from robocup_vision.ssl.values.detection import DetectionBall, DetectionFrame, DetectionRobot, Source, VisionPacket
from robocup_vision.ssl.values.geometry import BallModels, BouncingBall, CameraCalibration, Geometry, RollingBall
from robocup_vision.ssl.values.simulation import Team
from sim2d.network.overhead_view import Mounting, OverheadCamera, OverheadView, camera_mounting, camera_rig
from sim2d.network.realism import Realism
from sim2d.network.world import SIDES, LeagueState
from sim2d.world.ball_physics import GRAVITY_MPS2, ROLLS_RATIO, BallSettings, Flight
from sim2d.world.state import RobotState

MAX_PACKET_BYTES = 1024
TABLE = "images.csv"
COLUMNS = ("image", "camera_id", "frame_number", "t_capture_s")
# points of a ball's disc at which visibility is tested: its centre and two rings, each for an equal area
_RINGS = ((1, 0.0, 0.0), (6, 0.58, 0.0), (12, 0.88, math.pi / 12))
_PROBES = tuple(
    (radius * math.cos(phase + k * math.tau / count), radius * math.sin(phase + k * math.tau / count))
    for count, radius, phase in _RINGS
    for k in range(count)
)


class OverheadVision:
    """A vision system over a field."""

    def __init__(self, field: Field, realism: Realism, rng: np.random.Generator) -> None:
        self.field, self.realism = field, realism
        self.cameras = camera_rig(field, realism.camera_columns, realism.camera_rows, realism.camera_overlap_m)
        self._rng = rng
        self._frame_numbers = [0] * len(self.cameras)
        mounting_stds = realism.camera_position_std_m, realism.camera_rotation_std_rad
        self._is_misplaced = any(mounting_stds)
        self.views = tuple(
            OverheadView(field, camera, camera_mounting(rng, *mounting_stds) if self._is_misplaced else Mounting())
            for camera in self.cameras
        )

    @property
    def frame_numbers(self) -> tuple[int, ...]:
        """The number of each camera's last frame."""
        return tuple(self._frame_numbers)

    def geometry_packets(self, flight: Flight) -> list[bytes]:
        """Return packets with field, ball models and cameras, each small enough for a client with a small buffer."""
        carpet = BallSettings()
        slide_mps2, roll_mps2 = carpet.sliding_friction * GRAVITY_MPS2, carpet.rolling_friction * GRAVITY_MPS2
        rolling = RollingBall(-slide_mps2, -roll_mps2, ROLLS_RATIO)
        bouncing = BouncingBall(flight.first_floor_ratio, flight.later_floor_ratio, flight.up_ratio)
        geometry = geometry_from_field(self.field, (), BallModels(rolling, bouncing))
        return _geometry_packets(geometry, tuple(camera.calibration for camera in self.cameras))

    def capture(self, state: LeagueState, epoch_s: float) -> list[DetectionFrame]:
        """Return one frame of each camera; the simulation began `epoch_s` seconds after 1970."""
        return [self._frame(index, state, epoch_s + state.t_s) for index in range(len(self.cameras))]

    def _frame(self, index: int, state: LeagueState, t_s: float) -> DetectionFrame:
        camera, realism = self.cameras[index], self.realism
        seen = [robot for robot in state.robots if camera.covers(robot.pose.x_m, robot.pose.y_m)]
        noise = (
            self._rng.standard_normal((len(seen), 3)).tolist() if realism.robot_std_m + realism.robot_std_rad else ()
        )
        sides: dict[int, list[DetectionRobot]] = {side: [] for side in SIDES.values()}
        for place, robot in enumerate(seen):
            sides[robot.side].append(self._robot(index, robot, noise[place] if noise else (0.0, 0.0, 0.0)))
        ball = self._ball_in_view(index, state) if realism.finds_ball_in_images else self._ball(index, state)
        self._frame_numbers[index] += 1
        return DetectionFrame(
            self._frame_numbers[index],
            t_s,
            t_s + realism.processing_s,
            camera.camera_id,
            () if ball is None else (ball,),
            tuple(sides[SIDES[Team.YELLOW]]),
            tuple(sides[SIDES[Team.BLUE]]),
        )

    def _robot(self, index: int, robot: RobotState, noise: Sequence[float]) -> DetectionRobot:
        camera, realism, pose = self.cameras[index], self.realism, robot.pose
        x, y = pose.x_m + realism.robot_std_m * noise[0], pose.y_m + realism.robot_std_m * noise[1]
        u, v = camera.pixel(x, y, robot.height_m)
        if self._is_misplaced:
            # project into the image by the true camera pose, and back to the field by the calibration
            u, v = self.views[index].pixel(x, y, robot.height_m)
            x, y = self.views[index].on_field(u, v, robot.height_m)
        angle = wrap_angle(pose.theta_rad + realism.robot_std_rad * noise[2])
        return DetectionRobot(1.0, robot.number, x, y, angle, u, v, robot.height_m)

    def _ball_in_view(self, index: int, state: LeagueState) -> DetectionBall | None:
        """Return the ball as detected by its visible pixels in the image; None if it is not detected."""
        realism, view = self.realism, self.views[index]
        missing = self._rng.random()
        dx, dy = self._rng.standard_normal(2).tolist()
        seen = view.ball(state)
        if seen is None or missing < realism.missing_ball_ratio or seen.visible_ratio < realism.min_visible_ratio:
            return None
        # vision assumes that every ball lies on the floor
        x, y = view.on_field(seen.u_px, seen.v_px, self.field.ball_radius_m)
        if not self.cameras[index].covers(x, y):
            return None
        x, y = x + realism.ball_std_m * dx, y + realism.ball_std_m * dy
        return DetectionBall(seen.visible_ratio, x, y, seen.u_px, seen.v_px, seen.area_px)

    def _ball(self, index: int, state: LeagueState) -> DetectionBall | None:
        camera, realism, ball = self.cameras[index], self.realism, state.ball
        x, y, z = ball.x_m, ball.y_m, ball.z_m
        missing = self._rng.random()
        dx, dy, da = self._rng.standard_normal(3).tolist()
        floor_x, floor_y = camera.on_floor(x, y, z)
        if not camera.covers(floor_x, floor_y) or missing < realism.missing_ball_ratio:
            return None
        visible = visible_ratio(camera, state, self.field.ball_radius_m) if realism.hides_ball else 1.0
        if visible < realism.min_visible_ratio:
            return None
        if realism.floor_rays:
            x, y = floor_x, floor_y
        x, y = x + realism.ball_std_m * dx, y + realism.ball_std_m * dy
        radius_px = self.field.ball_radius_m * camera.focal_length_px / (camera.z_m - z)
        area = max(round(visible * math.pi * radius_px**2 + realism.ball_area_std_px * da), 1)
        height = z if z > 0 and not realism.floor_rays else None
        u, v = camera.pixel(x, y)
        if self._is_misplaced:
            u, v = self.views[index].pixel(x, y, 0.0)
            x, y = self.views[index].on_field(u, v, 0.0)
        return DetectionBall(visible, x, y, u, v, area, height)


def visible_ratio(camera: OverheadCamera, state: LeagueState, ball_radius_m: float) -> float:
    """Return the fraction of the ball's disc that robots, upright cylinders, do not hide."""
    ball = state.ball
    # a robot hides the floor behind it up to where the ray over its rim reaches the floor
    near = [
        robot
        for robot in state.robots
        if robot.height_m > ball.z_m
        and math.hypot(robot.pose.x_m - ball.x_m, robot.pose.y_m - ball.y_m)
        < robot.radius_m
        + ball_radius_m
        + robot.height_m * math.hypot(ball.x_m - camera.x_m, ball.y_m - camera.y_m) / camera.z_m
    ]
    if not near:
        return 1.0
    hidden = sum(
        any(
            _is_behind(camera, robot, ball.x_m + ball_radius_m * px, ball.y_m + ball_radius_m * py, ball.z_m)
            for robot in near
        )
        for px, py in _PROBES
    )
    return 1.0 - hidden / len(_PROBES)


def _is_behind(camera: OverheadCamera, robot: RobotState, x: float, y: float, z: float) -> bool:
    """Return whether a robot is on the ray from a point to the camera, below the robot's height."""
    along = min((robot.height_m - z) / (camera.z_m - z), 1.0)
    dx, dy = (camera.x_m - x) * along, (camera.y_m - y) * along
    off_x, off_y = robot.pose.x_m - x, robot.pose.y_m - y
    length2 = dx * dx + dy * dy
    fraction = max(0.0, min(1.0, (off_x * dx + off_y * dy) / length2)) if length2 > 0 else 0.0
    return math.hypot(off_x - fraction * dx, off_y - fraction * dy) < robot.radius_m


def detection_packets(frame: DetectionFrame) -> list[bytes]:
    """Return a frame as packets that fit into every client's buffer; many robots need more than one packet."""
    data = encode(VisionPacket(frame, source=Source.OTHER))
    if len(data) <= MAX_PACKET_BYTES:
        return [data]
    half_y, half_b = len(frame.yellow) // 2, len(frame.blue) // 2
    first = dataclasses.replace(frame, yellow=frame.yellow[:half_y], blue=frame.blue[:half_b])
    second = dataclasses.replace(frame, balls=(), yellow=frame.yellow[half_y:], blue=frame.blue[half_b:])
    return detection_packets(first) + detection_packets(second)


def _geometry_packets(geometry: Geometry, cameras: tuple[CameraCalibration, ...]) -> list[bytes]:
    data = encode(VisionPacket(geometry=dataclasses.replace(geometry, cameras=cameras), source=Source.OTHER))
    if len(data) <= MAX_PACKET_BYTES or len(cameras) < 2:
        return [data]
    half = len(cameras) // 2
    return _geometry_packets(geometry, cameras[:half]) + _geometry_packets(geometry, cameras[half:])


class CameraImages(Closing):
    """Saves images of each overhead camera, and in images.csv the detection frame of each. Close it.

    Parameters
    ----------
    every : int
        One of this many frames of each camera is saved; a camera has 60 frames per second.

    Raises
    ------
    ArgumentError
        If `every` is not positive.
    FileError
        If the folder cannot be written to.
    """

    def __init__(self, folder: str | Path, every: int, seed: int = 0) -> None:
        if every < 1:
            raise ArgumentError(f"images are saved every so many frames, at least 1, got {every}")
        self.folder, self._every = Path(folder), every
        self._rng = np.random.default_rng([seed, 7])
        self.saved = 0
        prepare_folder(self.folder, (TABLE,))
        with telling_write_errors(self.folder / TABLE):
            self._file = (self.folder / TABLE).open("w", newline="", encoding="utf-8")
        self._rows = csv.writer(self._file, lineterminator="\n")
        self._rows.writerow(COLUMNS)

    def close(self) -> None:
        """Close the table."""
        self._file.close()

    def add(self, vision: OverheadVision, state: LeagueState, epoch_s: float) -> None:
        """Save the images of the frames that the cameras have just taken, if they are due."""
        for view, number in zip(vision.views, vision.frame_numbers, strict=True):
            if number % self._every:
                continue
            camera = view.camera.camera_id
            name = f"camera{camera}_{number:06d}.png"
            write_png(self.folder / name, view.render(state, self._rng))
            self._rows.writerow([name, camera, number, repr(epoch_s + state.t_s)])
            self._file.flush()
            self.saved += 1
