"""Vision by a pinhole camera: its place by a goal, lines or walls, and the floor in view.

Where the file does not know the tilt, a goal or lines tell it frame by frame, and with it where the floor is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array, read_only
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.geometry import HEIGHT, LOG_FOCAL, ROLL, TILT
from robocup_vision.localization.goal.half_goal import PRIOR_STD_M, PRIOR_STD_RAD
from robocup_vision.localization.goal.localizer import GoalLocalizer
from robocup_vision.localization.lines.localizer import LineLocalizer
from robocup_vision.localization.lines.nearby import locate_nearby
from robocup_vision.localization.lines.walls import localizer_by_walls, wall_points
from robocup_vision.perception.ball import Ball
from robocup_vision.perception.color_table import Colors, ColorTable
from robocup_vision.perception.floor_ball import FloorBallFinder
from robocup_vision.perception.floor_view import BEARINGS, FloorView
from robocup_vision.perception.free_space import FloorMarking, FreeSpace, FreeSpaceGrid
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.pipeline.frames import Sight
from robocup_vision.view import View

# an edge of the floor differs by this many times the floor's noise
_MIN_CONTRAST = 5.0
# logarithm of the strongest cast of light: white beyond it is some paint
_CAST = math.log(2.0)
# at which a camera of unknown tilt is tried out before the first frame
_WARM_TILT_RAD = -0.3
# a narrow view shows few lines, which other poses explain nearly as well: without a prior so many points must agree
_MIN_LINE_SHARE = 0.75
# and on so many lines, for two lines are any corner; a line counts with this share of the points, so near to it
_MIN_LINES, _MIN_ON_A_LINE, _ON_LINE_WIDTHS = 3, 0.08, 2.0


@dataclass(frozen=True, slots=True, eq=False)
class _Floor:
    """What looks at the floor, for one camera as it is held."""

    view: FloorView
    grid: FreeSpaceGrid
    marking: FloorMarking
    ball: FloorBallFinder


@dataclass(frozen=True, slots=True, eq=False)
class _Reading:
    """What a frame's floor samples tell by colour: the samples, their floor likelihoods, each bearing's last one."""

    samples: UInt8Array
    table: ColorTable | None
    llr: npt.NDArray[np.int8]
    columns: npt.NDArray[np.int64]


class PinholeSight(Sight):
    """Turns frames of a pinhole camera into views; parameters as those of `Vision`, without method "hull"."""

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        colors: Colors | None = None,
        method: str = "goal",
        mask: UInt8Array | None = None,
        *,
        directions: int = 80,
        rings: int | tuple[float, ...] = 20,
    ) -> None:
        if method not in ("goal", "field", "floor"):
            raise ArgumentError(f"method must be 'goal', 'field' or 'floor' for a pinhole camera, got {method!r}")
        if method != "goal" and not camera.known_orientation:
            raise ArgumentError(f"method '{method}' needs a camera whose tilt_rad is known")
        # so narrow a view may show nothing white, but a ball or a goal
        super().__init__(field, camera.size_px, colors, mask, _CAST)
        self.camera = camera
        self._goal = GoalLocalizer(field, camera) if method == "goal" else None
        self._lines = LineLocalizer(field, camera, self._mask) if method == "field" else None
        self._walls = localizer_by_walls(field, camera) if method == "floor" else None
        self._directions, self._rings = directions, rings
        self._floor = self._floor_of(camera) if camera.known_orientation else None
        # so that no frame pays for compiling what the floor needs
        self._warm_up(camera if camera.known_orientation else camera.with_orientation(0.0, _WARM_TILT_RAD, 0.0))
        self.forget()

    @property
    def polar(self) -> FloorView | None:
        """The floor samples of every frame, or, where the tilt is unknown, of the last one; None: there are none."""
        return None if self._floor is None else self._floor.view

    @property
    def grid(self) -> FreeSpaceGrid | None:
        """The cells of the free space, as `polar`."""
        return None if self._floor is None else self._floor.grid

    def _floor_of(self, camera: PinholeCamera) -> _Floor | None:
        """Prepare to look at the floor by a camera whose tilt is known; None if it sees none."""
        view = FloorView(camera, max(BEARINGS, 2 * self._directions), self._mask, 1.1 * self.field.robot_radius_m)
        if not view.sees_floor:
            return None
        return _Floor(
            view,
            FreeSpaceGrid(view, self._directions, self._rings),
            FloorMarking(view, self.field.line_width_m, 2 * self.field.robot_radius_m),
            FloorBallFinder(self.field, camera, self._mask),
        )

    def _warm_up(self, camera: PinholeCamera) -> None:
        width, height = camera.size_px
        frame = np.full((height, width, 3), (50, 130, 45), dtype=np.uint8)
        self.look(frame)
        floor = self._floor or self._floor_of(camera)
        if floor is not None:
            self._see_floor(frame, floor, self._read(frame, floor.view), None, {})

    def look(
        self,
        frame: UInt8Array,
        t_s: float | None = None,
        odometry: Pose2 | None = None,
        prior: PoseEstimate | Pose2 | None = None,
    ) -> View:
        """See `Vision.look`."""
        begin = perf_counter()
        frame = self._checked(frame)
        timings: dict[str, float] = {}
        reading = None
        if self.camera.known_orientation and self._floor is not None:
            reading = self._read(frame, self._floor.view, timings)
        start = perf_counter()
        pose, pose_camera = self._locate(frame, reading, prior if prior is not None else self._moved(odometry))
        self._last_pose = pose.pose if pose else None
        timings["pose"] = perf_counter() - start
        if not self.camera.known_orientation:
            self._floor = self._floor_of(pose_camera) if pose else None
        floor = self._floor
        if floor is None:
            nothing, none = np.empty(0), np.empty((0, 0), dtype=np.uint8)
            timings["total"] = perf_counter() - begin
            free_space = FreeSpace(nothing, np.empty(0))
            return View(pose, free_space, None, timings, nothing, none, np.empty(0), None, pose_camera, t_s)
        stands = self._stands(pose.pose) if pose else None
        reading = reading or self._read(frame, floor.view, timings)
        edge, marks, ball, free_space = self._see_floor(frame, floor, reading, stands, timings)
        walls = np.full(floor.view.bearings, np.nan) if stands is None else self._walls_px(stands, floor.view)
        timings["total"] = perf_counter() - begin
        return View(pose, free_space, ball, timings, edge, marks, walls, floor.view, pose_camera, t_s)

    def _read(self, frame: UInt8Array, view: FloorView, timings: dict[str, float] | None = None) -> _Reading:
        begin = perf_counter()
        samples = view.sample(frame)
        table, llr = self._memory.classify(samples, view)
        columns = np.full(view.bearings, -1) if table is None else self._last_floor(llr, view)
        if timings is not None:
            timings["colors"] = perf_counter() - begin
        return _Reading(samples, table, llr, columns)

    def _see_floor(
        self, frame: UInt8Array, floor: _Floor, reading: _Reading, stands: Pose2 | None, timings: dict[str, float]
    ) -> tuple[FloatArray, UInt8Array, Ball | None, FreeSpace]:
        """Tell the floor's edge (K,), what the samples (K, M) show, the ball and the free space.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR.
        floor : _Floor
            For the camera as it is held.
        reading : _Reading
            Of this frame.
        stands : Pose2 or None
            Where what carries the camera is on the field.
        timings : dict
            Takes what the stages took, seconds.
        """
        begin = perf_counter()
        view = floor.view
        edge = np.append(view.radius_px + view.step_px / 2, np.nan)[reading.columns]
        if reading.table is None:
            marks, ball = np.zeros(reading.llr.shape, dtype=np.uint8), None
            free_space = FreeSpace(floor.grid.bearing_rad, np.zeros(len(floor.grid.bearing_rad)))
            balled = perf_counter()
        else:
            ball = floor.ball.find(frame, reading.table)
            if (
                ball is not None
                and stands is not None
                and self.field.is_bounded
                and not self._is_on_floor(ball, stands)
            ):
                ball = None
            balled = perf_counter()
            marks = floor.marking.mark(reading.samples, reading.llr)
            if ball is not None:
                floor.ball.clear(ball, view, marks)
            free_space = floor.grid.measure(marks)
        timings |= {"ball": balled - begin, "free_space": perf_counter() - balled}
        return edge, marks, ball, free_space

    def _locate(
        self, frame: UInt8Array, reading: _Reading | None, prior: PoseEstimate | Pose2 | None
    ) -> tuple[PoseEstimate | NotLocated, PinholeCamera]:
        if self._lines is not None:
            return self._by_lines(self._lines.finder.find(frame), self._lines, prior)
        if self._walls is not None:
            if reading is None or reading.table is None or self._floor is None:
                return NotLocated("no floor in view"), self.camera
            if prior is None:
                # a sway of half a degree makes three walls fit elsewhere, and fit well
                return NotLocated(
                    "a pinhole camera sees too little of the floor's edge to do without a prior"
                ), self.camera
            least = _MIN_CONTRAST * reading.table.colors.floor.noise
            view = self._floor.view
            points = wall_points(frame, view, reading.columns, view.hidden_px, least)
            answer, camera = self._by_lines(points, self._walls, prior)
            if isinstance(answer, NotLocated):
                answer = NotLocated(f"the floor's edge, by lines where the walls stand: {answer.reason}")
            return answer, camera
        assert self._goal is not None
        start = prior.pose if isinstance(prior, PoseEstimate) else prior
        sight = self._goal.look(frame, start)
        if isinstance(sight, NotLocated):
            return sight, self.camera
        p = [float(value) for value in sight.unknowns]
        fu, fv = self.camera.focal_px
        scale = math.exp(p[LOG_FOCAL])
        seen_from = replace(
            self.camera,
            focal_px=(fu * scale, fv * scale),
            height_m=p[HEIGHT],
            offset_m=(0.0, 0.0),
            pan_rad=0.0,
            tilt_rad=p[TILT],
            roll_rad=p[ROLL],
        )
        return sight.estimate(start), seen_from

    def _by_lines(
        self, points: LinePoints, lines: LineLocalizer, prior: PoseEstimate | Pose2 | None
    ) -> tuple[PoseEstimate | NotLocated, PinholeCamera]:
        if isinstance(prior, Pose2):
            prior = PoseEstimate(prior, np.diag([PRIOR_STD_M, PRIOR_STD_M, PRIOR_STD_RAD]) ** 2, 1.0, 0.0)
        if prior is not None:
            return locate_nearby(points, lines.line_map, prior, self.camera)
        return self._by_lines_alone(points, lines), self.camera

    def _by_lines_alone(self, points: LinePoints, lines: LineLocalizer) -> PoseEstimate | NotLocated:
        estimate = lines.locate(points)
        if not isinstance(estimate, PoseEstimate):
            return estimate
        if estimate.inlier_share < _MIN_LINE_SHARE:
            share = f"{estimate.inlier_share:.0%}"
            return NotLocated(f"only {share} of the line points lie on lines: too few for so narrow a view")
        nearest = lines.line_map.nearest(estimate.pose.transform(points.floor_m))
        on_each = np.bincount(nearest.index[nearest.distance_m < _ON_LINE_WIDTHS * self.field.line_width_m])
        told = int(np.count_nonzero(on_each >= max(_MIN_ON_A_LINE * len(points), 10)))
        if told < _MIN_LINES:
            return NotLocated(f"{told} lines in view, which without a prior fit many a corner of the field")
        return estimate

    def _moved(self, odometry: Pose2 | None) -> Pose2 | None:
        """Where the robot, or for method "goal" the camera, is after a motion of the robot; None: nobody knows."""
        if odometry is None or self._last_pose is None:
            return None
        if self._goal is None:
            return self._last_pose.compose(odometry)
        if self.camera.pan_rad is None:
            return None
        mounting = self._mounting
        return self._last_pose.compose(mounting.inverse().compose(odometry).compose(mounting))

    @property
    def _mounting(self) -> Pose2:
        return Pose2(*self.camera.offset_m, self.camera.pan_rad or 0.0)

    def _stands(self, pose: Pose2) -> Pose2:
        """Where on the field the frame lies in which the floor is told: the robot's, or the camera's where it tilts."""
        if self._goal is None or not self.camera.known_orientation:
            return pose
        return pose.compose(self._mounting.inverse())

    def _walls_px(self, stands: Pose2, view: FloorView) -> FloatArray:
        """Where a pose puts the walls, as `radius_px` of each bearing (K,); NaN where none is to be seen."""
        walls = self.field.walls if self.field.is_bounded else np.empty((0, 4))
        if not len(walls):
            return np.full(view.bearings, np.nan)
        foot = stands.compose(Pose2(*view.camera.offset_m, 0.0))
        angle = foot.theta_rad + view.bearing_rad[:, None]
        dx, dy = np.cos(angle), np.sin(angle)
        x0, y0, x1, y1 = walls.T
        ax, ay, bx, by = x0 - foot.x_m, y0 - foot.y_m, x1 - x0, y1 - y0
        with np.errstate(divide="ignore", invalid="ignore"):
            across = dx * by - dy * bx
            away = (ax * by - ay * bx) / across
            along = (ax * dy - ay * dx) / across
        hit = (away > 0) & (along >= 0) & (along <= 1)
        nearest = np.where(hit, away, np.inf).min(axis=1)
        used = view.columns_in_use
        radius = np.interp(-1.0 / nearest, -1.0 / view.range_m[:used], view.radius_px[:used])
        return read_only(np.where(np.isfinite(nearest), radius, np.nan))
