"""Vision, the one object a robot embeds: a camera frame in; pose, free floor, obstacles and the ball out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError, FrameError
from field_models.field import Field
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import FloatArray, Pose2, read_only
from robocup_vision.kernels import free_floor, polar
from robocup_vision.localization.floor import FloorLocalizer
from robocup_vision.localization.floor_hull import HullLocalizer
from robocup_vision.localization.goal_side import GoalSide
from robocup_vision.localization.lines import LineLocalizer
from robocup_vision.perception.ball import Ball, BallFinder
from robocup_vision.perception.color_table import LLR_PER_UNIT, Colors, ColorTable, build_color_table, learn_colors
from robocup_vision.perception.floor_color import RING_COLUMNS
from robocup_vision.perception.free_space import FloorMarking, FreeSpace, FreeSpaceGrid
from robocup_vision.perception.obstacles import Obstacle, find_obstacles
from robocup_vision.perception.polar_view import BEARINGS, BODY_COLUMNS, PolarView

UInt8Array = npt.NDArray[np.uint8]
Method = Literal["floor", "field", "hull"]

# mean log-likelihood ratio, in nats, that makes a run of samples floor; a strip behind a line needs this much in all
_CERTAIN_NATS = 3.0
_STRIP_NATS = 5.0
# columns that a painted line may hide
_LINE_GAP = 3
# an edge is a colour difference of this many standard deviations of the noise
_LEAST_CONTRAST = 5.0
# the ring's mean likelihood ratio below this share of what it was when learnt: the light has changed
_DRIFT_SHARE = 0.6
# blocked samples in a row that make an obstacle
_BLOCKED_RUN = 2
# a blocked sample within this many columns of the wall that the pose predicts is that wall
_WALL_COLUMNS = 3.0


@dataclass(frozen=True)
class View:
    """What one frame shows.

    Parameters
    ----------
    pose : PoseEstimate or NotLocated
        The robot on the field.
    free_space : FreeSpace
        Free range in each direction.
    ball : Ball or None
        The ball, robot frame.
    timings_s : mapping of str to float
        Seconds each stage took, and ``total``.
    boundary_radius_px : (K,) float64
        Image radius of the floor's edge at each of the polar view's bearings, NaN where none.
    marks : (K, M) uint8
        Polar samples: 0 blocked, 1 floor, 2 line, 3 ball.
    wall_radius_px : (K,) float64
        Where the pose puts the walls; NaN where it does not say.
    polar : PolarView
        Where those samples lie.
    """

    pose: PoseEstimate | NotLocated
    free_space: FreeSpace
    ball: Ball | None
    timings_s: Mapping[str, float]
    boundary_radius_px: FloatArray
    marks: UInt8Array
    wall_radius_px: FloatArray
    polar: PolarView

    def __post_init__(self) -> None:
        own = (self.boundary_radius_px, self.marks, self.wall_radius_px, self.free_space.range_m)
        for array in own:
            array.flags.writeable = False

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """Things that stand on the floor; without the field's walls where the pose is known. Worked out when asked."""
        if not self.marks.any():
            return ()
        blocked = np.empty(self.polar.bearings, dtype=np.int64)
        columns = self.polar.columns_in_use
        free_floor.first_blocked(self.marks, self.polar.valid, BODY_COLUMNS, columns, _BLOCKED_RUN, blocked)
        place = np.minimum(blocked, len(self.polar.radius_px) - 1)
        beyond = self.polar.radius_px[place] - self.wall_radius_px
        with np.errstate(invalid="ignore"):
            is_wall = beyond > -_WALL_COLUMNS * self.polar.step_px
        return find_obstacles(self.polar.floor_m, blocked, is_wall, gap_m=0.05)

    @cached_property
    def boundary_px(self) -> FloatArray:
        """(K, 2) float64: the floor's edge at each bearing, pixels; NaN rows where none."""
        return read_only(self.polar.camera.polar_to_pixel(self.polar.bearing_rad, self.boundary_radius_px))

    @cached_property
    def line_points_px(self) -> FloatArray:
        """(N, 2) float64: polar samples on painted lines, pixels."""
        return read_only(self.polar.pixels[self.marks == free_floor.LINE])


class Vision:
    """Turns camera frames into views; one object a camera and thread.

    Parameters
    ----------
    field : Field
        The pitch.
    camera : OmniCamera
        The camera.
    colors : Colors, optional
        Fixed colours. Without them they are learnt from the first frame, and again when the light has changed.
    method : {"field", "floor", "hull"}
        "floor": by the floor's outline, which walls or boards must bound. "field": by the outline where there is one,
        and by the white lines where it leaves a choice, does not tell, or is not bounded, with no prior. "hull": as the
        paper prints it, by the convex hull of the whole floor mask; the published reference, for comparison.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    directions : int
        Number J of directions of the free space.
    rings : int or tuple of float
        Its rings, as in `FreeSpaceGrid`.

    Raises
    ------
    ArgumentError
        If the mask's size is not the camera's, or the method does not fit the field.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        colors: Colors | None = None,
        *,
        method: Method = "field",
        mask: UInt8Array | None = None,
        directions: int = 80,
        rings: int | tuple[float, ...] = 20,
    ) -> None:
        if method not in ("floor", "field", "hull"):
            raise ArgumentError(f"method must be 'floor', 'field' or 'hull' for a mirror camera, got {method!r}")
        width, height = camera.size_px
        if mask is not None:
            # a copy: the caller's array may be a view, or change
            mask = np.array(mask)
            if mask.shape != (height, width) or mask.dtype != np.uint8:
                raise ArgumentError(f"mask must be ({height}, {width}) uint8, got {mask.shape} {mask.dtype}")
        self.field = field
        self.camera = camera
        self.method = method
        self._keep = None if mask is None else (mask == 0).astype(np.uint8)
        self._fixed = None if colors is None else build_color_table(colors)
        self._table = self._fixed
        self._learnt_ring = 0.0
        self._last_pose: Pose2 | None = None
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

    def forget(self) -> None:
        """Forget learnt colours and the last pose: the next frame stands alone."""
        self._table = self._fixed
        self._last_pose = None

    @property
    def colors(self) -> Colors | None:
        """The colours in use, None before the first frame."""
        return None if self._table is None else self._table.colors

    def look(
        self,
        frame: UInt8Array,
        t_s: float | None = None,
        odometry: Pose2 | None = None,
        prior: PoseEstimate | Pose2 | None = None,
    ) -> View:
        """See what a frame shows.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR, of the camera's size.
        t_s : float, optional
            When it was taken.
        odometry : Pose2, optional
            The robot's motion since the frame before, in its frame then; with the last pose it makes a prior.
        prior : PoseEstimate or Pose2, optional
            Where the robot probably is: saves time, and orders candidates that the frame itself cannot tell apart.

        Raises
        ------
        FrameError
            If the frame has another size or type.
        """
        begin = perf_counter()
        frame = self._checked(frame)
        start = prior.pose if isinstance(prior, PoseEstimate) else prior
        if start is None and odometry is not None and self._last_pose is not None:
            start = self._last_pose.compose(odometry)
        samples = self.polar.sample(frame)
        table, llr = self._classify(samples)
        if table is None:
            return self._blind(begin)
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
        return View(pose, free_space, ball, timings, edge, marks, walls, self.polar)

    def _is_on_floor(self, ball: Ball, pose: Pose2) -> bool:
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        x, y = pose.x_m + c * ball.x_m - s * ball.y_m, pose.y_m + s * ball.x_m + c * ball.y_m
        return self.field.is_on_floor(x, y)

    def _checked(self, frame: UInt8Array) -> UInt8Array:
        width, height = self.camera.size_px
        if not isinstance(frame, np.ndarray) or frame.dtype != np.uint8:
            raise FrameError(f"frame must be a uint8 array, got {getattr(frame, 'dtype', type(frame).__name__)}")
        if frame.shape != (height, width, 3):
            raise FrameError(f"frame must be ({height}, {width}, 3) as the camera file says, got {frame.shape}")
        # kernels are compiled for plain arrays: a flipped view, or bytes from a message, would be compiled for anew
        plain = np.require(frame, requirements=("C", "W"))
        if self._keep is None:
            return plain
        # black under the mask, so that nothing there can tell whatever a stage reads beside it
        return np.asarray(cv2.copyTo(plain, self._keep), dtype=np.uint8)

    def _classify(self, samples: UInt8Array) -> tuple[ColorTable | None, npt.NDArray[np.int8]]:
        llr = np.empty(samples.shape[:2], dtype=np.int8)
        if self._table is not None:
            ring = self._look_up(samples, self._table, llr)
            if self._fixed is not None or ring >= _DRIFT_SHARE * self._learnt_ring:
                return self._table, llr
        colors = learn_colors(samples, self.polar.valid, self.field)
        if colors is None:
            return self._table, llr
        self._table = build_color_table(colors)
        self._learnt_ring = self._look_up(samples, self._table, llr)
        return self._table, llr

    def _look_up(self, samples: UInt8Array, table: ColorTable, llr: npt.NDArray[np.int8]) -> float:
        return float(polar.classify(samples, table.packing, table.floor_llr, self.polar.valid, RING_COLUMNS, llr))

    def _outline(
        self, frame: UInt8Array, llr: npt.NDArray[np.int8], table: ColorTable
    ) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        column = np.empty(self.polar.bearings, dtype=np.int64)
        certain, strip = int(_CERTAIN_NATS / LLR_PER_UNIT), int(_STRIP_NATS / LLR_PER_UNIT)
        polar.outer_boundary(llr, self.polar.valid, certain, _LINE_GAP, strip, column)
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
            _LEAST_CONTRAST * table.colors.floor.noise,
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

    def _blind(self, begin: float) -> View:
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
