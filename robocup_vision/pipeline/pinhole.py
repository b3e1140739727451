"""The pipeline of a pinhole camera: pose, and the floor over the bearings in view.

Where the camera file has no tilt, each frame's pose gives it, and thereby where the image shows the floor.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int8Array, Int64Array, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import Mounting, PinholeCamera
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor import dark_feet
from robocup_vision.localization.localizer import Localization, frame_alone
from robocup_vision.localization.methods import calibrated_localizer, make_pinhole_localizer
from robocup_vision.localization.swapped_channels import (
    MIN_DISTANCE,
    goal_points,
    is_inside,
    log_ratios_at,
    swapped_nats,
)
from robocup_vision.localization.walls import tilt_by_walls, wall_px
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.balls.finder import BallFinder, has_patches
from robocup_vision.perception.balls.projection import BallFrame
from robocup_vision.perception.color_table import LLR_PER_UNIT, Colors, ColorTable
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.free_space import FreeSpace, FreeSpaceGrid
from robocup_vision.perception.hues import thumbnail_of
from robocup_vision.perception.markings.finder import MarkingSource
from robocup_vision.pipeline.floor_tables import FloorTableCache, FloorTables
from robocup_vision.pipeline.frames import NO_FRAME, FrameOptions, FramePipeline
from robocup_vision.view import View

# The largest log ratio between channels that coloured light gives to white. A view this narrow may show nothing white;
# stronger colours belong to a ball or a goal.
_MAX_LOG_CAST = math.log(2.0)
# every fourth pixel is enough for the picture's mean brightness
_LIGHT_STEP = 4
# a camera of unknown tilt is tried out at this tilt before the first frame, so that its kernels are compiled
_WARM_UP_TILT_RAD = -0.3


@dataclass(frozen=True, slots=True, eq=False)
class _FloorSamples:
    """A frame's floor samples, at K bearings and M radii.

    `colors` are the samples, `table` classifies them, `llr` (K, M) are their log-likelihood ratios of floor; `columns`
    (K,) is the index of each bearing's outermost floor sample, -1: none; `edge_px` (K,) is the floor boundary's radius.
    """

    colors: UInt8Array
    table: ColorTable | None
    llr: Int8Array
    columns: Int64Array
    edge_px: FloatArray


def _floors_of(field: Field, camera: PinholeCamera, mask: UInt8Array | None, options: FrameOptions) -> FloorTableCache:
    return FloorTableCache(field, camera, mask, options.directions, options.rings, options.free_ratio)


class PinholePipeline(FramePipeline):
    """Turns frames of a pinhole camera into views."""

    def __init__(self, field: Field, camera: PinholeCamera, options: FrameOptions) -> None:
        # before any loop is called, so that the progress report knows how many must be compiled
        prepare(f"pinhole_{options.method.loops}")
        if has_patches(field, camera):
            prepare("patterned_balls")
        super().__init__(field, camera.size_px, options, _MAX_LOG_CAST)
        method = options.method
        self.camera = camera
        panelled = [goal for goal in field.goals if goal.kind != "posts"]
        has_two_colors = len({goal.color for goal in panelled}) == 2
        self._goal_points = goal_points(field) if has_two_colors else (np.empty((0, 3)), np.empty(0))
        self._localizer = make_pinhole_localizer(method, field, camera)
        self._floors = _floors_of(field, camera, self._mask, options)
        # for the camera's orientation in the last frame
        self._floor = self._floors.for_camera(camera) if camera.known_orientation else None
        self._ball_finder = BallFinder(field, camera, self._mask)
        self._warm_up(camera if camera.known_orientation else camera.with_orientation(0.0, _WARM_UP_TILT_RAD, 0.0))
        self.forget()

    def with_camera(self, camera: PinholeCamera) -> PinholePipeline:
        """Return this pipeline with another calibration of its camera; colours and the last pose are kept.

        The next frame makes new tables of the floor.
        """
        other = copy(self)
        other.camera = camera
        other._floors = _floors_of(self.field, camera, self._mask, self._options)
        other._localizer = calibrated_localizer(self._localizer, self._options.method, self.field, camera)
        other._ball_finder = BallFinder(self.field, camera, self._mask)
        return other

    @property
    def polar(self) -> FloorView | None:
        """The floor samples of the last frame, before the first one those of the next; None: no floor is in view."""
        return None if self._floor is None else self._floor.view

    @property
    def grid(self) -> FreeSpaceGrid | None:
        """The cells of the free space, as `polar`."""
        return None if self._floor is None else self._floor.grid

    def _warm_up(self, camera: PinholeCamera) -> None:
        """Compile all loops that a frame needs, or load them from the disk's cache, so that no frame is delayed."""
        width, height = camera.size_px
        frame = np.full((height, width, 3), (50, 130, 45), dtype=np.uint8)
        self.look(frame)
        floor = self._floor or self._floors.for_camera(camera)
        if floor is not None:
            samples = self._sample(frame, floor.view)
            self._see_floor(self._ball_frame(frame, floor, samples, None), floor, samples, None, {})

    def forget(self) -> None:
        """See `FramePipeline.forget`."""
        super().forget()
        self._localizer.forget()
        self._ball_finder.forget()

    def look(
        self,
        frame: UInt8Array,
        t_s: float | None = None,
        odometry: Pose2 | None = None,
        prior: PoseEstimate | Pose2 | None = None,
        mounting: Mounting | None = None,
    ) -> View:
        """See `Vision.look`."""
        begin = perf_counter()
        frame = self.checked(frame)
        camera = self.camera if mounting is None else self.camera.held(mounting)
        if prior is None and odometry is not None and self._last_pose is not None:
            prior = self._last_pose.compose(odometry)
        return self.see(frame, camera, self.locate(frame, camera, t_s, prior), t_s, begin)

    def locate(
        self,
        frame: UInt8Array,
        camera: PinholeCamera,
        t_s: float | None,
        prior: PoseEstimate | Pose2 | None,
        *,
        may_search: bool = True,
    ) -> Localization:
        """Locate the robot by a frame, the first step of `look`.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            As `checked` returns it.
        camera : PinholeCamera
            The camera with its orientation in this frame.
        may_search : bool
            See `FrameEvidence`.
        """
        evidence = frame_alone(frame, camera, t_s)
        answer = self._localizer.locate(evidence if may_search else evidence._replace(may_search=False), prior)
        if isinstance(answer.pose, NotLocated):
            # a dark picture is a frequent cause
            light = f"mean brightness {frame[::_LIGHT_STEP, ::_LIGHT_STEP].mean():.0f} of 255"
            answer = answer._replace(pose=replace(answer.pose, reason=f"{answer.pose.reason} ({light})"))
        return self._in_open_halves(answer, prior)

    def see(
        self, frame: UInt8Array, camera: PinholeCamera, answer: Localization, t_s: float | None, begin: float
    ) -> View:
        """Return the view of a frame, given the answer of `locate`: the second step of `look`.

        Parameters
        ----------
        answer : Localization
            What `locate` returned.
        begin : float
            Start of the look, by `perf_counter`.
        """
        pose = answer.pose
        timings = {"pose": perf_counter() - begin}
        self._last_pose = pose.pose if pose else None
        made = self._floors.for_camera(camera) if camera.known_orientation else None
        if pose and not camera.known_orientation:
            made = self._floors.for_camera(_as_held(answer.camera))
        # the pose includes the camera's orientation in this frame
        held = _as_held(answer.camera) if pose else camera
        held_covariance = answer.held_covariance if pose else None
        if made is None:
            self._floor = None
        else:
            self._floor = made.held(held, _sway_std_rad(held_covariance))
        floor = self._floor
        if floor is None:
            self._carried = None
            # without a floor only patterned balls are found, which show the camera's tilt themselves
            balls = self._ball_finder.find(BallFrame(frame, camera))
            timings["total"] = perf_counter() - begin
            pose = self._unless_swapped(pose)
            view = self._without_floor(pose, answer.camera, timings, t_s)
            return replace(
                view,
                balls=balls,
                measurement=self._measurement_unless_swapped(answer.measurement),
                edge_points=answer.edge_points,
                warnings=self._warnings(pose),
            )
        robot = pose.pose if pose else None
        floor, samples = self._sample_to_walls(frame, floor, pose, timings)
        seen = self._ball_frame(frame, floor, samples, t_s)
        marks, balls, free_space = self._see_floor(seen, floor, samples, robot, timings)
        self._judge_channels(seen, floor.camera, balls, pose)
        reported_pose = self._unless_swapped(pose)
        self._keep_floor(free_space, t_s)
        walls = floor.view.no_edges_px
        if robot is not None and self.field.is_bounded:
            walls = wall_px(self.field.walls, robot, floor.view)
        timings["total"] = perf_counter() - begin
        return View(
            reported_pose,
            free_space,
            balls,
            timings,
            samples.edge_px,
            marks,
            walls,
            floor.view,
            answer.camera,
            floor.grid,
            t_s,
            measurement=self._measurement_unless_swapped(answer.measurement),
            edge_points=answer.edge_points,
            obstacle_finder=self._obstacle_finder,
            thumbnail=thumbnail_of(frame),
            warnings=self._warnings(reported_pose),
            marking_source=MarkingSource.of(self._marking_finder, frame, held, held_covariance),
        )

    def _ball_frame(
        self, frame: UInt8Array, floor: FloorTables, samples: _FloorSamples, t_s: float | None
    ) -> BallFrame:
        near = self._near_floor_nats(samples.llr, floor.view)
        return BallFrame(frame, floor.camera, floor.balls, samples.table, near, t_s)

    def _judge_channels(
        self, seen: BallFrame, camera: PinholeCamera, balls: tuple[Ball, ...], pose: PoseEstimate | NotLocated
    ) -> None:
        table = seen.table
        if table is None:
            return
        robot = pose.pose if pose else None

        def find_own() -> tuple[Ball, ...]:
            is_by_color = self._ball_finder.is_by_color
            return balls if is_by_color else self.on_floor(self._ball_finder.find_colored(seen), robot)

        def find_swapped() -> tuple[Ball, ...]:
            return self.on_floor(self._ball_finder.find_swapped(seen), robot)

        self._channel_order.judge(
            find_own, find_swapped, pose, lambda: self._goal_nats(seen.frame, camera, table.colors, robot)
        )

    def _is_on_floor(self, ball: Ball, pose: Pose2) -> bool:
        """Whether a ball lies on the floor, or would if it were one standard deviation nearer.

        A small error of the tilt moves a far ball by metres.
        """
        if super()._is_on_floor(ball, pose):
            return True
        place = np.array([ball.x_m, ball.y_m])
        away_m = float(np.hypot(*place))
        ahead = place / max(away_m, 1e-9)
        nearer_m = max(away_m - math.sqrt(float(ahead @ ball.covariance @ ahead)), 0.0)
        return super()._is_on_floor(replace(ball, x_m=nearer_m * ahead[0], y_m=nearer_m * ahead[1]), pose)

    def _goal_nats(self, frame: UInt8Array, camera: PinholeCamera, colors: Colors, robot: Pose2 | None) -> float:
        """Return the log-likelihood ratio of swapped red and blue, nats, by goals of two colours in view."""
        points, sides = self._goal_points
        if robot is None or not len(points) or colors.swap_distance < MIN_DISTANCE:
            return 0.0
        on_robot = np.column_stack([robot.inverse().transform(points[:, :2]), points[:, 2]])
        pixels = camera.point_to_pixel(on_robot)
        shown = is_inside(pixels, frame, self._mask)
        log_ratios = log_ratios_at(frame, pixels, shown)
        return swapped_nats(log_ratios, sides[shown] > 0, colors.goal_log_ratios)

    def drop(self, t_s: float | None = None, odometry: Pose2 | None = None) -> View:
        """Return the view of a frame that the camera did not give; see `Vision.look`."""
        begin = perf_counter()
        carried, floor = self._carry(odometry, t_s), self._floor
        camera = self.camera if floor is None else floor.camera
        view = self._without_floor(NotLocated(NO_FRAME), camera, {"total": perf_counter() - begin}, t_s)
        if carried is None:
            return view if floor is None else replace(view, free_space=_none_free(floor.grid))
        return replace(view, free_space=carried)

    @staticmethod
    def _without_floor(
        pose: PoseEstimate | NotLocated,
        camera: OmniCamera | PinholeCamera,
        timings: dict[str, float],
        t_s: float | None,
    ) -> View:
        """Return a view without a floor, with or without a pose."""
        nothing, none = np.empty(0), np.empty((0, 0), dtype=np.uint8)
        free_space = FreeSpace(nothing, np.empty(0))
        return View(pose, free_space, (), timings, nothing, none, np.empty(0), None, camera, None, t_s)

    def _sample(self, frame: UInt8Array, view: FloorView, timings: dict[str, float] | None = None) -> _FloorSamples:
        begin = perf_counter()
        colors = view.sample(frame)
        table, llr = self._color_memory.classify(colors, view)
        columns = np.full(view.bearings, -1) if table is None else self._last_floor(llr, view)
        if timings is not None:
            timings["colors"] = perf_counter() - begin
        edge_px = np.empty(view.bearings)
        dark_feet.foot_px(colors, view.valid, columns, view.radius_px, view.step_px, edge_px)
        return _FloorSamples(colors, table, llr, columns, edge_px)

    def _sample_to_walls(
        self, frame: UInt8Array, floor: FloorTables, pose: PoseEstimate | NotLocated, timings: dict[str, float]
    ) -> tuple[FloorTables, _FloorSamples]:
        """Sample the floor; sample again if the feet of walls, predicted by the pose, give a better tilt."""
        samples = self._sample(frame, floor.view, timings)
        # a tilt estimated together with the pose is better than one by walls
        has_own_tilt = not self.camera.known_orientation
        if not pose or has_own_tilt or not self.field.is_bounded or samples.table is None:
            return floor, samples
        tilt = tilt_by_walls(floor.view, samples.edge_px, self.field.walls, pose, floor.camera)
        if tilt is None:
            return floor, samples
        by_walls = floor.camera.with_orientation(floor.camera.pan_rad, tilt, floor.camera.roll_rad)
        floor = self._floor = floor.held(by_walls, floor.balls.sway_std_rad)
        return floor, self._sample(frame, floor.view, timings)

    def _see_floor(
        self,
        seen: BallFrame,
        floor: FloorTables,
        samples: _FloorSamples,
        robot: Pose2 | None,
        timings: dict[str, float],
    ) -> tuple[UInt8Array, tuple[Ball, ...], FreeSpace]:
        """Return the marks of the samples (K, M), and the balls and the free space, robot frame.

        Parameters
        ----------
        floor : FloorTables
            Tables for the camera's orientation in this frame.
        robot : Pose2 or None
            The robot's pose in the field frame.
        timings : dict
            Receives the time of each stage, seconds.
        """
        begin = perf_counter()
        balls: tuple[Ball, ...] = ()
        if samples.table is None:
            marks = np.zeros(samples.llr.shape, dtype=np.uint8)
            free_space = _none_free(floor.grid)
            ball_found = perf_counter()
        else:
            balls = self.on_floor(self._ball_finder.find(seen), robot)
            ball_found = perf_counter()
            llr = samples.llr.copy()
            dark_feet.doubt_beyond(samples.columns, int(self.edge_settings.certain_nats / LLR_PER_UNIT), llr)
            marks = floor.marking.mark(samples.colors, llr)
            dark_feet.block_dark_feet(samples.colors, floor.view.shown, floor.view.columns_in_use, marks)
            dark_feet.block_dark_bodies(samples.colors, floor.view.shown, floor.view.columns_in_use, marks)
            for ball in balls:
                floor.balls.clear(ball, floor.view, marks)
            free_space = floor.grid.measure(marks)
        timings |= {"ball": ball_found - begin, "free_space": perf_counter() - ball_found}
        return marks, balls, free_space


def _none_free(grid: FreeSpaceGrid) -> FreeSpace:
    return FreeSpace(grid.bearing_rad, np.zeros(len(grid.bearing_rad)))


def _as_held(camera: OmniCamera | PinholeCamera) -> PinholeCamera:
    assert isinstance(camera, PinholeCamera)
    return camera


def _sway_std_rad(held_covariance: FloatArray | None) -> tuple[float, float] | None:
    """Return the standard deviations of tilt and roll, radians; None where the frame does not show them."""
    if held_covariance is None:
        return None
    return math.sqrt(held_covariance[0, 0]), math.sqrt(held_covariance[1, 1])
