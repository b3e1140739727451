"""Vision by a pinhole camera: its place by a goal or by lines, and the floor in view where its tilt is known."""

from __future__ import annotations

import math
from dataclasses import replace
from time import perf_counter

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import FloatArray, Pose2, read_only
from robocup_vision.kernels import polar
from robocup_vision.localization.goal import GoalLocalizer
from robocup_vision.localization.goal_geometry import HEIGHT, LOG_FOCAL, ROLL, TILT
from robocup_vision.localization.goal_search import PRIOR_STD_M, PRIOR_STD_RAD
from robocup_vision.localization.lines import LineLocalizer
from robocup_vision.localization.lines_nearby import locate_nearby
from robocup_vision.perception.ball import Ball
from robocup_vision.perception.color_table import LLR_PER_UNIT, Colors
from robocup_vision.perception.floor_ball import FloorBallFinder
from robocup_vision.perception.floor_view import BEARINGS, FloorView
from robocup_vision.perception.free_space import FloorMarking, FreeSpace, FreeSpaceGrid
from robocup_vision.sight import Sight
from robocup_vision.view import View

UInt8Array = npt.NDArray[np.uint8]

# as for the mirror camera: floor is a run of samples of this mean likelihood ratio, in nats, or behind a line this sum
_CERTAIN_NATS = 3.0
_STRIP_NATS = 5.0
_LINE_GAP = 3
# logarithm of the strongest cast of light: white beyond it is some paint
_CAST = math.log(2.0)
# a narrow view shows few lines, which other poses explain nearly as well: without a prior so many points must agree
_LEAST_LINE_SHARE = 0.75
# and on so many lines, for two lines are any corner; a line counts with this share of the points, so near to it
_LEAST_LINES, _LEAST_ON_A_LINE, _ON_LINE_WIDTHS = 3, 0.08, 2.0


class PinholeSight(Sight):
    """Turns frames of a pinhole camera into views; parameters as those of `Vision`, methods "goal" and "field"."""

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
        if method not in ("goal", "field"):
            raise ArgumentError(f"method must be 'goal' or 'field' for a pinhole camera, got {method!r}")
        if method == "field" and not camera.known_orientation:
            raise ArgumentError("method 'field' needs a camera whose tilt_rad is known")
        # so narrow a view may show nothing white, but a ball or a goal
        super().__init__(field, camera.size_px, colors, mask, _CAST)
        self.camera = camera
        self._goal = GoalLocalizer(field, camera) if method == "goal" else None
        self._lines = LineLocalizer(field, camera, self._mask) if method == "field" else None
        self.polar: FloorView | None = None
        self.grid: FreeSpaceGrid | None = None
        if camera.known_orientation:
            view = FloorView(camera, max(BEARINGS, 2 * directions), self._mask, 1.1 * field.robot_radius_m)
            if view.sees_floor:
                self.polar = view
                self.grid = FreeSpaceGrid(view, directions, rings)
                self._marking = FloorMarking(view, field.line_width_m, 2 * field.robot_radius_m)
                self._ball = FloorBallFinder(field, camera, self._mask)
                self._edge_px = np.append(view.radius_px + view.step_px / 2, np.nan)
        width, height = camera.size_px
        self.look(np.full((height, width, 3), (50, 130, 45), dtype=np.uint8))
        self.forget()

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
        pose, pose_camera = self._locate(frame, prior if prior is not None else self._moved(odometry))
        self._last_pose = pose.pose if pose else None
        located = perf_counter()
        timings = {"pose": located - begin}
        if self.polar is None or self.grid is None:
            nothing, none = np.empty(0), np.empty((0, 0), dtype=np.uint8)
            timings["total"] = perf_counter() - begin
            free_space = FreeSpace(nothing, np.empty(0))
            return View(pose, free_space, None, timings, nothing, none, np.empty(0), None, pose_camera, t_s)
        samples = self.polar.sample(frame)
        table, llr = self._memory.classify(samples, self.polar)
        colored = perf_counter()
        edge = np.full(self.polar.bearings, np.nan)
        if table is None:
            marks, ball = np.zeros(llr.shape, dtype=np.uint8), None
            free_space = FreeSpace(self.grid.bearing_rad, np.zeros(len(self.grid.bearing_rad)))
            balled = perf_counter()
        else:
            column = np.empty(self.polar.bearings, dtype=np.int64)
            certain, strip = int(_CERTAIN_NATS / LLR_PER_UNIT), int(_STRIP_NATS / LLR_PER_UNIT)
            polar.outer_boundary(llr, self.polar.valid, certain, _LINE_GAP, strip, column)
            edge = self._edge_px[column]
            ball = self._ball.find(frame, table)
            if ball is not None and pose and self.field.is_bounded and not self._is_ball_on_floor(ball, pose.pose):
                ball = None
            balled = perf_counter()
            marks = self._marking.mark(samples, llr)
            if ball is not None:
                self._ball.clear(ball, self.polar, marks)
            free_space = self.grid.measure(marks)
        end = perf_counter()
        timings |= {"colors": colored - located, "ball": balled - colored, "free_space": end - balled}
        walls = self._walls(pose.pose) if pose else np.full(self.polar.bearings, np.nan)
        timings["total"] = perf_counter() - begin
        return View(pose, free_space, ball, timings, edge, marks, walls, self.polar, pose_camera, t_s)

    def _locate(
        self, frame: UInt8Array, prior: PoseEstimate | Pose2 | None
    ) -> tuple[PoseEstimate | NotLocated, PinholeCamera]:
        if self._lines is not None:
            if isinstance(prior, Pose2):
                prior = PoseEstimate(prior, np.diag([PRIOR_STD_M, PRIOR_STD_M, PRIOR_STD_RAD]) ** 2, 1.0, 0.0)
            if prior is not None:
                return locate_nearby(self._lines.finder.find(frame), self._lines.line_map, prior), self.camera
            return self._by_lines_alone(frame, self._lines), self.camera
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

    def _by_lines_alone(self, frame: UInt8Array, lines: LineLocalizer) -> PoseEstimate | NotLocated:
        points = lines.finder.find(frame)
        estimate = lines.locate(points)
        if not isinstance(estimate, PoseEstimate):
            return estimate
        if estimate.inlier_share < _LEAST_LINE_SHARE:
            share = f"{estimate.inlier_share:.0%}"
            return NotLocated(f"only {share} of the line points lie on lines: too few for so narrow a view")
        nearest = lines.line_map.nearest(estimate.pose.transform(points.floor_m))
        on_each = np.bincount(nearest.index[nearest.distance_m < _ON_LINE_WIDTHS * self.field.line_width_m])
        told = int(np.count_nonzero(on_each >= max(_LEAST_ON_A_LINE * len(points), 10)))
        if told < _LEAST_LINES:
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

    def _robot(self, pose: Pose2) -> Pose2:
        return pose if self._goal is None else pose.compose(self._mounting.inverse())

    def _is_ball_on_floor(self, ball: Ball, pose: Pose2) -> bool:
        return self._is_on_floor(ball, self._robot(pose))

    def _walls(self, pose: Pose2) -> FloatArray:
        """Where the pose puts the walls, as `radius_px` of each bearing (K,); NaN where none is to be seen."""
        assert self.polar is not None
        walls = self.field.walls if self.field.is_bounded else np.empty((0, 4))
        if not len(walls):
            return np.full(self.polar.bearings, np.nan)
        foot = self._robot(pose).compose(Pose2(*self.camera.offset_m, 0.0))
        angle = foot.theta_rad + self.polar.bearing_rad[:, None]
        dx, dy = np.cos(angle), np.sin(angle)
        x0, y0, x1, y1 = walls.T
        ax, ay, bx, by = x0 - foot.x_m, y0 - foot.y_m, x1 - x0, y1 - y0
        with np.errstate(divide="ignore", invalid="ignore"):
            across = dx * by - dy * bx
            away = (ax * by - ay * bx) / across
            along = (ax * dy - ay * dx) / across
        hit = (away > 0) & (along >= 0) & (along <= 1)
        nearest = np.where(hit, away, np.inf).min(axis=1)
        used = self.polar.columns_in_use
        radius = np.interp(-1.0 / nearest, -1.0 / self.polar.range_m[:used], self.polar.radius_px[:used])
        return read_only(np.where(np.isfinite(nearest), radius, np.nan))
