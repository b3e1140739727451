"""The pipeline of a mirror camera: colours, the floor's outline, pose, ball and free space all around."""

from __future__ import annotations

from copy import copy
from time import perf_counter

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array, read_only
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.compiling.loops import plain
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.estimates import NotLocated, PoseEstimate, SwappedChannels
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor import outline
from robocup_vision.localization.localizer import FrameEvidence
from robocup_vision.localization.methods import make_mirror_localizer
from robocup_vision.localization.swapped_channels import MIN_DISTANCE
from robocup_vision.perception.balls.finder import BallFinder
from robocup_vision.perception.balls.projection import BallFrame, MirrorBallProjection
from robocup_vision.perception.color_table import LLR_PER_UNIT, ColorTable
from robocup_vision.perception.free_space import FloorMarking, FreeSpace, FreeSpaceGrid
from robocup_vision.perception.hues import thumbnail_of
from robocup_vision.perception.markings.finder import MarkingSource
from robocup_vision.perception.polar_view import BEARINGS, PolarView
from robocup_vision.pipeline.frames import NO_FRAME, FrameOptions, FramePipeline
from robocup_vision.view import View


class OmniPipeline(FramePipeline):
    """Turns frames of a mirror camera into views."""

    def __init__(self, field: Field, camera: OmniCamera, options: FrameOptions) -> None:
        # before any loop is called, so that the progress report knows how many must be compiled
        prepare(f"mirror_{options.method.name}")
        super().__init__(field, camera.size_px, options)
        self._use_camera(camera)
        self._warm_up()

    def _use_camera(self, camera: OmniCamera) -> None:
        """Make all parts that depend on the camera."""
        field, mask, method, directions = self.field, self._mask, self._options.method, self._options.directions
        self.camera = camera
        # a whole number of bearings per direction of the free space, so that there are at least `BEARINGS`
        bearings = directions * -(-BEARINGS // max(directions, 1))
        self.polar = PolarView(camera, bearings, mask)
        self.grid = FreeSpaceGrid(self.polar, directions, self._options.rings, self._options.free_ratio)
        self._outline_rules = self._make_rules()
        self._localizer = make_mirror_localizer(method, field, camera, self.polar, mask)
        self._ball_finder = BallFinder(field, camera, mask)
        self._ball_projection = MirrorBallProjection(camera, field.ball_radius_m)
        # buffers for the samples of the current frame, and their log-likelihood ratios
        self._samples = np.empty((*self.polar.places.shape, 3), dtype=np.uint8)
        self._llr = np.empty(self.polar.places.shape, dtype=np.int8)
        self._nothing = read_only(np.full(bearings, np.nan))

    def _make_rules(self) -> outline.OutlineRules:
        """Return this camera's sample positions, and the thresholds for floor and lines, for the compiled loop."""
        view, settings = self.polar, self.edge_settings
        rays = self.camera.polar_to_pixel(view.bearing_rad, 1.0) - self.camera.center_px
        marking = FloorMarking(view, self.field.line_width_m, 2 * self.field.robot_radius_m)
        return plain(
            outline.OutlineRules(
                view.valid,
                view.hidden_px,
                *self.camera.center_px,
                np.ascontiguousarray(rays[:, 0]),
                np.ascontiguousarray(rays[:, 1]),
                view.radius_px,
                view.step_px,
                view.row_step_rad / 3,
                int(settings.certain_nats / LLR_PER_UNIT),
                settings.line_gap_columns,
                int(settings.strip_nats / LLR_PER_UNIT),
                *marking.widest_line,
                view.columns_in_use,
            )
        )

    def with_camera(self, camera: OmniCamera) -> OmniPipeline:
        """Return this pipeline with another calibration of its camera; settings and colours are kept."""
        other = copy(self)
        other._use_camera(camera)
        return other

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
    ) -> View:
        """See `Vision.look`."""
        begin = perf_counter()
        frame = self.checked(frame)
        if prior is None and odometry is not None and self._last_pose is not None:
            prior = self._last_pose.compose(odometry)
        measured = self._measure(frame, t_s)
        if measured is None:
            return self._view_without_floor(begin, t_s, "no floor is found around the robot: too dark, or none in view")
        evidence, near, outline_s = measured
        table, edge, marks = evidence.table, evidence.edge_px, evidence.marks
        assert table is not None
        assert marks is not None
        outlined = perf_counter()
        answer = self._localizer.locate(evidence, prior)
        pose, walls = answer.pose, self._nothing if answer.wall_px is None else answer.wall_px
        located = perf_counter()
        robot = pose.pose if pose else None
        seen = BallFrame(frame, self.camera, self._ball_projection, table, near, t_s)
        balls = self.on_floor(self._ball_finder.find(seen), robot)
        balled = perf_counter()
        for ball in balls:
            self._ball_projection.clear(ball, self.polar, marks)
        free_space = self.grid.measure(marks)
        free = perf_counter()
        self._last_pose = robot
        self._channel_order.judge(
            lambda: balls,
            lambda: self.on_floor(self._ball_finder.find_swapped(seen), robot),
            pose,
            lambda: self._goal_nats(pose, table),
        )
        pose = self._unless_swapped(pose)
        self._keep_floor(free_space, t_s)
        end = perf_counter()
        timings = {
            "colors": outlined - begin - outline_s,
            "outline": outline_s,
            "pose": located - outlined,
            "ball": balled - located,
            "free_space": free - balled,
            "channels": end - free,
            "total": end - begin,
        }
        return View(
            pose,
            free_space,
            balls,
            timings,
            edge,
            marks,
            walls,
            self.polar,
            self.camera,
            self.grid,
            t_s,
            obstacle_finder=self._obstacle_finder,
            thumbnail=thumbnail_of(frame),
            warnings=self._warnings(pose),
            measurement=self._measurement_unless_swapped(answer.measurement),
            marking_source=MarkingSource.of(self._marking_finder, frame, self.camera),
        )

    def measure(self, frame: UInt8Array) -> FrameEvidence | None:
        """Return the evidence of a frame (H, W, 3) for a localiser; None if no floor is found around the robot."""
        measured = self._measure(self.checked(frame), None)
        return None if measured is None else measured[0]

    def _measure(self, frame: UInt8Array, t_s: float | None) -> tuple[FrameEvidence, float, float] | None:
        """Return a frame's evidence, the mean log-likelihood ratio of floor nearby (nats), and the outline's time.

        None if no floor is found around the robot.
        """
        before = table = self._color_memory.table
        if before is None:
            table, _ = self._color_memory.classify(self.polar.sample(frame), self.polar)
        if table is None:
            return None
        known = perf_counter()
        edge, outermost, marks, near, ring = self._read_floor(frame, table)
        outline_s = perf_counter() - known
        if before is not None:
            table = self._color_memory.follow(self._samples, self.polar, self._llr, ring)
            if table is not before:
                edge, outermost, marks, near, _ = self._read_floor(frame, table)
        return FrameEvidence(frame, self.camera, table, self.polar, edge, outermost, marks, t_s), near, outline_s

    def _goal_nats(self, pose: PoseEstimate | NotLocated, table: ColorTable) -> float:
        """Return the log-likelihood ratio of swapped red and blue, nats, by whether goals have decided the half."""
        max_nats = self._channel_order.settings.max_nats
        if isinstance(pose, SwappedChannels):
            return max_nats
        can_decide = self.field.halves_differ and table.colors.swap_distance >= MIN_DISTANCE
        return -max_nats if can_decide and pose and len(pose.candidates) == 1 else 0.0

    def _read_floor(
        self, frame: UInt8Array, table: ColorTable
    ) -> tuple[FloatArray, npt.NDArray[np.int64], UInt8Array, float, float]:
        """Return the floor's edge (K,), pixels, its outermost column (K,), the marks (K, M), and two means.

        The means are log-likelihood ratios of floor: of the nearest third of the columns, in nats, and of the ring that
        `ColorMemory.follow` takes. Fills the buffers of samples and ratios.
        """
        view, bearings = self.polar, self.polar.bearings
        outermost, edge = np.empty(bearings, dtype=np.int64), np.empty(bearings)
        marks = np.empty(self._llr.shape, dtype=np.uint8)
        ring, total = outline.read_floor(
            frame,
            view.places,
            table.packing,
            table.floor_llr,
            self._outline_rules,
            self.edge_settings.min_contrast * table.colors.floor.noise,
            self._samples,
            self._llr,
            outermost,
            edge,
            marks,
        )
        return edge, outermost, marks, total * LLR_PER_UNIT / view.near_count, ring

    def drop(self, t_s: float | None = None, odometry: Pose2 | None = None) -> View:
        """Return the view of a frame that the camera did not give; see `Vision.look`."""
        begin = perf_counter()
        carried, pose = self._carry(odometry, t_s), self._last_pose
        view = self._view_without_floor(begin, t_s, NO_FRAME, carried)
        self._last_pose = pose
        return view

    def _view_without_floor(
        self, begin: float, t_s: float | None, reason: str, free_space: FreeSpace | None = None
    ) -> View:
        self._last_pose = None
        shape = self.polar.valid.shape
        nothing = np.full(len(self.grid.bearing_rad), self.grid.ring_bounds_m[0])
        return View(
            NotLocated(reason),
            free_space or FreeSpace(self.grid.bearing_rad, nothing),
            (),
            {"total": perf_counter() - begin},
            self._nothing,
            np.zeros(shape, dtype=np.uint8),
            self._nothing,
            self.polar,
            self.camera,
            self.grid,
            t_s,
        )

    def _warm_up(self) -> None:
        """Compile all loops that a frame needs, or load them from the disk's cache, so that no frame is delayed."""
        width, height = self.camera.size_px
        v, u = np.mgrid[:height, :width]
        far = (
            np.hypot(u - self.camera.center_px[0], v - self.camera.center_px[1]) > 0.7 * self.camera.usable_radius_px[1]
        )
        frame = np.where(far[..., None], np.uint8(220), np.array([45, 130, 50], dtype=np.uint8))
        self.look(np.ascontiguousarray(frame, dtype=np.uint8))
        self.forget()
