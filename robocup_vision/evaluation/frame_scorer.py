"""Scores single frames, in this process or in several; an error in one frame becomes the reason in its row."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from field_models.errors import ArgumentError, FrameError, RobocupVisionError
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.evaluation.boxes import Box
from robocup_vision.evaluation.dataset import Dataset, FrameTime, Truth
from robocup_vision.evaluation.detections import BALL, OBSTACLE, match_boxes
from robocup_vision.evaluation.overlays import WorstSoFar, encode_jpeg, error_crops
from robocup_vision.evaluation.result_files import FrameResult
from robocup_vision.evaluation.rig_images import RigContents, RigImages, decode_rig, rig_contents
from robocup_vision.evaluation.scoring import Row, pose_error
from robocup_vision.evaluation.steering import FrameSteering, SteerPlan
from robocup_vision.files.images import decode_image, file_bytes, read_image
from robocup_vision.geometry import Pose2
from robocup_vision.workers import Workers, in_order, run_pieces

if TYPE_CHECKING:
    from robocup_vision.localization.filter.settings import Half
    from robocup_vision.memory import Memory
    from robocup_vision.vision import Vision

_MIN_BATCHES = 64
_MAX_BATCH = 32


class ViewLike(Protocol):
    """The result of a localiser for one frame.

    A dataset with `pose_of = "camera"` needs a property `camera_pose` of the same type beside `pose`.
    """

    @property
    def pose(self) -> PoseEstimate | NotLocated:
        """The robot's pose by this frame alone."""
        ...


class VisionLike(Protocol):
    """A localiser that can be scored: `robocup_vision.Vision`, or a team's own."""

    def look(self, frame: UInt8Array, t_s: float | None = None, odometry: Pose2 | None = None) -> ViewLike:
        """Look at one frame, (H, W, 3) uint8 BGR, with its time and the motion since the frame before if known.

        If the dataset has mountings of the camera, the keyword argument `mounting` is passed, too.
        """
        ...

    def forget(self) -> None:
        """Forget everything learnt from earlier frames."""
        ...


MakeVision = Callable[[Dataset], VisionLike]
DrawOverlay = Callable[[Any, UInt8Array, Any], UInt8Array]


def make_default_vision(dataset: Dataset) -> VisionLike:
    """Build the library's own `Vision` for a dataset; for method "landmarks" its `LandmarkVision`."""
    if dataset.landmarks is not None and isinstance(dataset.camera, PinholeCamera):
        from robocup_vision.landmarks.vision import LandmarkVision

        return LandmarkVision(dataset.landmarks, dataset.camera, mask=dataset.mask)
    return _vision(dataset, None)


def make_vision_with_memory(dataset: Dataset, half: Half | None = None) -> Vision:
    """Build `Vision` with a memory; a mirror camera without odometry gets an estimator of ego-motion.

    Parameters
    ----------
    half : {"own"}, optional
        The field half in which the robot is known to start (`Memory`).
    """
    from robocup_vision.mapping.view_motion import ViewMotion
    from robocup_vision.memory import Memory

    has_odometry = any(time.odometry is not None for time in (dataset.times or {}).values())
    motion = None if has_odometry or isinstance(dataset.camera, PinholeCamera) else ViewMotion()
    return _vision(dataset, Memory(dataset.field, ego_motion=motion, half=half))


def _vision(dataset: Dataset, memory: Memory | None) -> Vision:
    from robocup_vision import vision

    camera, mask = (dataset.camera, dataset.mask) if dataset.rig is None else (dataset.rig, dataset.rig_masks)
    return vision.Vision(dataset.field, camera, dataset.colors, method=dataset.method, mask=mask, memory=memory)


def draw_default_overlay(view: Any, frame: UInt8Array, vision: Any) -> UInt8Array:
    """Draw a frame with what `Vision` or `LandmarkVision` found in it."""
    from robocup_vision.landmarks.vision import LandmarkView, draw_landmarks

    if isinstance(view, LandmarkView):
        return draw_landmarks(view, frame)
    from robocup_vision.overlay import draw

    return draw(view, frame, vision)


@dataclass(frozen=True, slots=True)
class ScorePlan:
    """What is scored, and how; can be pickled."""

    dataset: Dataset
    make_vision: MakeVision
    draw_overlay: DrawOverlay
    wants_overlays: bool  #: whether pictures for a report are drawn
    spread: frozenset[int]  #: numbers of the images that the report always shows; empty without a report
    scores_belief: bool = False  #: score the estimate over time, `view.belief`, instead of each frame's own pose
    steering: SteerPlan | None = None  #: steer by each frame, too: the localiser's views then need `free_space`
    #: which of "ball" and "obstacle" are compared with the dataset's boxes
    reported_kinds: tuple[str, ...] = (BALL, OBSTACLE)

    def without_images(self) -> ScorePlan:
        """Return the plan for a worker, which receives each image's name, truth and boxes with its job."""
        # None would mean that there is no boxes.csv
        boxes: dict[str, tuple[Box, ...]] | None = None if self.dataset.boxes is None else {}
        return replace(self, dataset=replace(self.dataset, image_names=(), truth={}, boxes=boxes))


class ImageJob(NamedTuple):
    """An image to score, as it is sent to a worker."""

    number: int  #: its index in the dataset
    image: str
    truth: Truth | None  #: None if it is unknown
    #: bytes of its file, or of a rig's files; an error if they cannot be read; None: the worker reads them
    content: bytes | RigContents | FrameError | None = None
    boxes: tuple[Box, ...] = ()  #: the boxes marked in it


class FrameScorer:
    """Scores frames with one localiser, in one thread, and ranks the worst frames so far."""

    def __init__(self, plan: ScorePlan) -> None:
        self.plan = plan
        self._worst = WorstSoFar()
        self._unused_odometry: Pose2 | None = Pose2(0.0, 0.0, 0.0)
        self._vision = plan.make_vision(plan.dataset)
        self._steering = (
            None if plan.steering is None else FrameSteering(plan.steering, in_sequence=plan.dataset.times is not None)
        )

    def score_file(self, job: ImageJob) -> FrameResult:
        """Read an image, or decode the bytes that were sent, and score it."""
        dataset = self.plan.dataset
        frame: UInt8Array | RigImages | FrameError
        try:
            if isinstance(job.content, FrameError):
                frame = job.content
            elif dataset.rig is not None and isinstance(job.content, tuple):
                frame = decode_rig(job.content, dataset.rig, job.image)
            elif dataset.rig is not None:
                frame = dataset.read_rig_frames(job.image)
            elif job.content is None:
                frame = read_image(dataset.path / job.image, dataset.camera.size_px)
            else:
                assert isinstance(job.content, bytes)
                frame = decode_image(job.content, job.image, dataset.camera.size_px)
        except FrameError as error:
            frame = error
        return self.score(job, frame)

    def score(self, job: ImageJob, frame: UInt8Array | RigImages | FrameError) -> FrameResult:
        """Score one frame; an error of any kind becomes its row's reason."""
        image = job.image
        row = Row(image, truth=job.truth)
        time = None if self.plan.dataset.times is None else self.plan.dataset.times[image]
        odometry = self._odometry(time)
        if isinstance(frame, FrameError):
            self._unused_odometry = odometry
            reason = _one_line(str(frame).removeprefix(f"{image}: "))
            return FrameResult(replace(row, reason=reason, failed=True, unreadable=True))
        self._unused_odometry = Pose2(0.0, 0.0, 0.0)
        view = None
        try:
            # a rig's localiser takes frames and times of several cameras
            shown: Any = frame
            taken: dict[str, Any] = {"t_s": None, "odometry": odometry}
            if time is None:
                self._vision.forget()
            else:
                taken["t_s"] = time.t_s if time.camera_times_s is None else time.camera_times_s
                taken |= {} if time.mounting is None else {"mounting": time.mounting}
            started_s = perf_counter()
            view = self._vision.look(shown, **taken)
            row = replace(row, time_s=perf_counter() - started_s)
            row = self._score(row, self._pose(view))
            if self._steering is not None:
                row = replace(row, steering=self._steering.steer(view, None if time is None else time.t_s, odometry))
            if self.plan.dataset.boxes is not None:
                row = replace(
                    row, detections=match_boxes(view, job.boxes, self.plan.dataset.field, self.plan.reported_kinds)
                )
        except Exception as error:  # a bug in one frame must not cost the others
            row = replace(row, estimate=None, error=None, reason=_describe(error), failed=True)
            with contextlib.suppress(Exception):
                self._vision.forget()  # its state after an error is unknown
        return self._picture(job.number, row, view, frame)

    def _odometry(self, time: FrameTime | None) -> Pose2 | None:
        """Return the motion since the last frame that was looked at, over unreadable ones in between; None: unknown."""
        if time is None or time.odometry is None or self._unused_odometry is None:
            return None
        return self._unused_odometry.compose(time.odometry)

    def _score(self, row: Row, pose: PoseEstimate | NotLocated) -> Row:
        if not isinstance(pose, PoseEstimate):
            return replace(row, reason=_one_line(pose.reason) or "no reason given")
        values = [*pose.pose.array, *pose.covariance.ravel(), pose.inlier_ratio, pose.residual_px]
        if not (np.isfinite(values).all() and (np.diag(pose.covariance) >= 0).all()):
            raise ValueError("the estimate is not finite or has a negative variance")
        error = None
        if row.truth is not None:
            error = pose_error(pose, row.truth, symmetric=self.plan.dataset.symmetry == "point")
        return replace(row, estimate=pose, error=error)

    def _pose(self, view: ViewLike) -> PoseEstimate | NotLocated:
        if self.plan.scores_belief:
            belief: PoseEstimate | NotLocated = view.belief.pose  # type: ignore[attr-defined]
            return belief
        if self.plan.dataset.pose_of == "robot":
            return view.pose
        pose = getattr(view, "camera_pose", None)
        if not isinstance(pose, PoseEstimate | NotLocated):
            raise ArgumentError('the localiser gives no camera_pose, which pose_of = "camera" in dataset.toml needs')
        return pose

    def _picture(self, index: int, row: Row, view: ViewLike | None, frame: UInt8Array | RigImages) -> FrameResult:
        is_worst = self._worst.admits(index, row.severity)
        if not self.plan.wants_overlays:
            return FrameResult(row)
        bare = frame if isinstance(frame, np.ndarray) else next(one for one in frame if one is not None)
        crops = error_crops(row.image, bare, row.detections)
        if not (is_worst or index in self.plan.spread):
            return FrameResult(row, crops=crops)
        picture, problem = bare, ""
        if view is not None:
            try:
                shown: Any = frame
                picture = self.plan.draw_overlay(view, shown, self._vision)
            except Exception as error:  # the row counts even if its picture cannot be drawn
                problem = _describe(error)
        jpeg = encode_jpeg(picture)
        if is_worst:
            self._worst.add(index, row.severity, b"")  # only the ranking is needed here, the caller keeps the picture
        return FrameResult(row, jpeg, problem, crops)


def _describe(error: Exception) -> str:
    if isinstance(error, RobocupVisionError):
        return _one_line(str(error))
    return _one_line(f"internal error: {type(error).__name__}: {error}")


def _one_line(text: str) -> str:
    return " ".join(text.split())


def score_sequence(scorer: FrameScorer, first: int = 0) -> Generator[FrameResult, None, None]:
    """Score a dataset's frames from number `first` on in order, in this process."""
    dataset = scorer.plan.dataset
    if dataset.rig is not None:
        for index, name in islice(enumerate(dataset.image_names), first, None):
            yield scorer.score_file(ImageJob(index, name, dataset.truth_of(index)))
        return
    for index, frame in islice(enumerate(dataset.read_frames()), first, None):
        name = dataset.image_names[index]
        yield scorer.score(ImageJob(index, name, dataset.truth_of(index), boxes=dataset.boxes_of(index)), frame)


def score_images(
    scorer: FrameScorer, workers: Workers, first: int = 0, *, send_images: bool = True
) -> Generator[FrameResult, None, None]:
    """Score a dataset's images from number `first` on, each independently of the others.

    Parameters
    ----------
    scorer : FrameScorer
        The scorer of this process, if this process is the worker; other workers make their own from its plan.
    send_images : bool
        Send the bytes of image files to workers on other machines; otherwise they read the files by the same paths.

    Raises
    ------
    RobocupVisionError
        If an image repeatedly ends its worker, or there are no workers.
    """
    dataset = scorer.plan.dataset
    sends = send_images and not workers.share_files
    jobs = (
        ImageJob(
            index,
            name,
            dataset.truth_of(index),
            _content(dataset, name) if sends else None,
            dataset.boxes_of(index),
        )
        for index, name in enumerate(dataset.image_names[first:], start=first)
    )
    if workers.is_here:
        return in_order(run_pieces(lambda: scorer.score_file, jobs, workers))
    # batches small enough that all workers end at about the same time, and large enough that overhead is negligible
    batch = min(max(len(dataset.image_names) // _MIN_BATCHES, 1), _MAX_BATCH)
    start = partial(_start_scorer, scorer.plan.without_images())
    return in_order(run_pieces(start, jobs, workers, batch=batch, describe=lambda job: f"image {job.image}"))


def _content(dataset: Dataset, name: str) -> bytes | RigContents | FrameError:
    try:
        if dataset.rig is not None:
            return rig_contents(dataset.path, dataset.rig, name)
        return file_bytes(dataset.path / name)
    except FrameError as error:
        return error


def _start_scorer(plan: ScorePlan) -> Callable[[ImageJob], FrameResult]:
    return FrameScorer(plan).score_file
