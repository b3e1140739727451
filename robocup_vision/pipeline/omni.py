"""Vision by a mirror camera: the floor all around, its outline, lines and goals, in a fraction of a millisecond."""

from __future__ import annotations

from time import perf_counter

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array, read_only
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor import polar
from robocup_vision.localization.baselines.floor_hull import HullLocalizer
from robocup_vision.localization.field_half import GoalSide
from robocup_vision.localization.floor import FloorLocalizer
from robocup_vision.localization.lines.localizer import LineLocalizer
from robocup_vision.perception.ball import BallFinder
from robocup_vision.perception.color_table import Colors, ColorTable
from robocup_vision.perception.free_space import FloorMarking, FreeSpace, FreeSpaceGrid
from robocup_vision.perception.polar_view import BEARINGS, PolarView
from robocup_vision.pipeline.frames import Sight
from robocup_vision.view import View

# an edge is a colour difference of this many standard deviations of the noise
_MIN_CONTRAST = 5.0


class MirrorSight(Sight):
    """Turns frames of a mirror camera into views; parameters as those of `Vision`, methods "floor", "field", "hull"."""

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        colors: Colors | None = None,
        *,
        method: str = "field",
        mask: UInt8Array | None = None,
        directions: int = 80,
        rings: int | tuple[float, ...] = 20,
    ) -> None:
        if method not in ("floor", "field", "hull"):
            raise ArgumentError(f"method must be 'floor', 'field' or 'hull' for a mirror camera, got {method!r}")
        super().__init__(field, camera.size_px, colors, mask)
        mask = self._mask
        self.camera = camera
        self.method = method
        # whole cells: as many bearings a direction as come nearest to the usual number from above
        bearings = directions * -(-BEARINGS // max(directions, 1))
        self.polar = PolarView(camera, bearings, mask)
        self.grid = FreeSpaceGrid(self.polar, directions, rings)
        self._marking = FloorMarking(self.polar, field.line_width_m, 2 * field.robot_radius_m)
        by_outline = method == "floor" or (method == "field" and field.is_bounded)
        self._floor = FloorLocalizer(field, camera, self.polar) if by_outline else None
        self._hull = HullLocalizer(field, camera, mask) if method == "hull" else None
        self._lines = LineLocalizer(field, camera, mask) if method == "field" else None
        self._goal_side = GoalSide(field, camera, mask)
        self._ball = BallFinder(field, camera, mask)
        rays = camera.polar_to_pixel(self.polar.bearing_rad, 1.0) - camera.center_px
        self._ray_u, self._ray_v = np.ascontiguousarray(rays[:, 0]), np.ascontiguousarray(rays[:, 1])
        self._radius_or_none = np.append(self.polar.radius_px, np.nan)
        self._nothing = read_only(np.full(bearings, np.nan))
        self._warm_up()

    def with_camera(self, camera: OmniCamera) -> MirrorSight:
        """Return the same sight, with all it has learnt, through another calibration of its camera."""
        rings = self.grid.rings
        sight = MirrorSight(
            self.field, camera, method=self.method, mask=self._mask, directions=self.grid.directions, rings=rings
        )
        sight._memory, sight._last_pose = self._memory, self._last_pose
        return sight

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
        start = prior.pose if isinstance(prior, PoseEstimate) else prior
        if start is None and odometry is not None and self._last_pose is not None:
            start = self._last_pose.compose(odometry)
        samples = self.polar.sample(frame)
        table, llr = self._memory.classify(samples, self.polar)
        if table is None:
            return self._blind(begin, t_s)
        colored = perf_counter()
        edge, outermost = self._outline(frame, llr, table)
        outlined = perf_counter()
        pose, walls = self._locate(frame, edge, table, start)
        located = perf_counter()
        ball = self._ball.find(frame, table)
        if ball is not None and pose and self.field.is_bounded and not self._is_on_floor(ball, pose.pose):
            ball = None
        balled = perf_counter()
        marks = self._marking.mark(samples, llr, outermost)
        if ball is not None:
            self._ball.clear(ball, self.polar, marks)
        free_space = self.grid.measure(marks)
        end = perf_counter()
        self._last_pose = pose.pose if pose else None
        timings = {
            "colors": colored - begin,
            "outline": outlined - colored,
            "pose": located - outlined,
            "ball": balled - located,
            "free_space": end - balled,
            "total": end - begin,
        }
        return View(pose, free_space, ball, timings, edge, marks, walls, self.polar, self.camera, t_s)

    def _outline(
        self, frame: UInt8Array, llr: npt.NDArray[np.int8], table: ColorTable
    ) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        column = self._last_floor(llr, self.polar)
        edge = np.empty(self.polar.bearings)
        polar.radial_edges(
            frame,
            self.polar.hidden_px,
            *self.camera.center_px,
            self._ray_u,
            self._ray_v,
            self._radius_or_none[column],
            self.polar.step_px,
            2 * np.pi / self.polar.bearings / 3,
            _MIN_CONTRAST * table.colors.floor.noise,
            edge,
        )
        return edge, column

    def _locate(
        self, frame: UInt8Array, edge: FloatArray, table: ColorTable, start: Pose2 | None
    ) -> tuple[PoseEstimate | NotLocated, FloatArray]:
        reason = ""
        if self._hull is not None:
            by_hull = self._hull.locate(frame, table)
            if isinstance(by_hull, PoseEstimate):
                return self._goal_side.choose(frame, by_hull, table.colors, start), self._nothing
            reason = by_hull.reason
        if self._floor is not None:
            lines = self._lines
            arbiter = None if lines is None else (lambda poses: lines.choose(frame, poses))
            estimate, walls = self._floor.locate(edge, start, arbiter)
            if isinstance(estimate, PoseEstimate):
                return self._goal_side.choose(frame, estimate, table.colors, start), walls
            reason = estimate.reason
        if self._lines is not None:
            by_lines = self._lines.locate(frame)
            if isinstance(by_lines, PoseEstimate):
                return self._goal_side.choose(frame, by_lines, table.colors, start), self._nothing
            reason = f"{reason}; by lines: {by_lines.reason}" if reason else by_lines.reason
        return NotLocated(reason), self._nothing

    def _blind(self, begin: float, t_s: float | None) -> View:
        self._last_pose = None
        shape = self.polar.valid.shape
        free_space = FreeSpace(self.grid.bearing_rad, np.full(len(self.grid.bearing_rad), self.grid.ring_bounds_m[0]))
        return View(
            NotLocated("no floor can be told around the robot: too dark, or nothing of it in view"),
            free_space,
            None,
            {"total": perf_counter() - begin},
            self._nothing,
            np.zeros(shape, dtype=np.uint8),
            self._nothing,
            self.polar,
            self.camera,
            t_s,
        )

    def _warm_up(self) -> None:
        """Compile, or load from the disk's cache, everything a frame needs, so that no frame pays for it."""
        width, height = self.camera.size_px
        v, u = np.mgrid[:height, :width]
        far = (
            np.hypot(u - self.camera.center_px[0], v - self.camera.center_px[1]) > 0.7 * self.camera.usable_radius_px[1]
        )
        frame = np.where(far[..., None], np.uint8(220), np.array([45, 130, 50], dtype=np.uint8))
        self.look(np.ascontiguousarray(frame, dtype=np.uint8))
        self.forget()
