"""Scores a localiser on a dataset: every image gets one row, and neither a bad file nor a bug loses the run."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np

from field_models.errors import ArgumentError, FileError, FrameError, RobocupVisionError
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.evaluation import report
from robocup_vision.evaluation.dataset import Dataset
from robocup_vision.evaluation.overlays import WorstSoFar, encode_jpeg, spread_indices
from robocup_vision.evaluation.result_files import prepare_folder, write_results, write_summary, write_trajectory
from robocup_vision.evaluation.scoring import Figures, Row, figures, pose_error
from robocup_vision.files.output_folder import refuse_foreign_files
from robocup_vision.geometry import Pose2
from robocup_vision.progress import progress

OUTPUT_NAMES = ("results.csv", "summary.json", "trajectory.tum", "report.html")


class ViewLike(Protocol):
    """What a localiser returns for one frame.

    A dataset with `pose_of = "camera"` needs a property `camera_pose` of the same type beside `pose`.
    """

    @property
    def pose(self) -> PoseEstimate | NotLocated:
        """The robot's pose as this frame alone shows it."""
        ...


class VisionLike(Protocol):
    """What can be scored: `robocup_vision.Vision`, or a team's own localiser."""

    def look(self, frame: UInt8Array, t_s: float | None = None, odometry: Pose2 | None = None) -> ViewLike:
        """Look at one frame, (H, W, 3) uint8 BGR, with its time and the motion since the frame before if known."""
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
    from robocup_vision import vision

    return vision.Vision(dataset.field, dataset.camera, dataset.colors, method=dataset.method, mask=dataset.mask)


def draw_default_overlay(view: Any, frame: UInt8Array, vision: Any) -> UInt8Array:
    """Draw a frame with what `Vision` or `LandmarkVision` found in it."""
    from robocup_vision.landmarks.vision import LandmarkView, draw_landmarks

    if isinstance(view, LandmarkView):
        return draw_landmarks(view, frame)
    from robocup_vision.overlay import draw

    return draw(view, frame, vision)


@dataclass(frozen=True, slots=True)
class Summary:
    """What `evaluate` found and wrote.

    Parameters
    ----------
    figures : Figures
        The figures over all images.
    rows : tuple of Row
        One an image, in the images' order.
    out : Path
        The folder of the files.
    report : Path or None
        The HTML report; None if it could not be written.
    notes : tuple of str
        Lines the user should see: what was ignored or left out.
    """

    figures: Figures
    rows: tuple[Row, ...]
    out: Path
    report: Path | None
    notes: tuple[str, ...]

    @property
    def problem(self) -> str | None:
        """One line on the images that failed, or None if every image was read and scored."""
        failed = [row for row in self.rows if row.failed]
        if not failed:
            return None
        return f"{len(failed)} of {len(self.rows)} images failed, the first: {failed[0].image}: {failed[0].reason}"


def evaluate(
    dataset: Dataset,
    out: str | Path,
    jobs: int = 1,
    *,
    make_vision: MakeVision = make_default_vision,
    draw_overlay: DrawOverlay = draw_default_overlay,
    moments: Mapping[str, str] | None = None,
    force: bool = False,
) -> Summary:
    """Score a localiser on a dataset and write results.csv, summary.json, trajectory.tum and report.html.

    Each image stands alone, unless the dataset has a frames.csv: then it is one sequence, in order, in one process,
    with time and odometry handed on.

    Parameters
    ----------
    dataset : Dataset
        From `load_dataset`.
    out : str or Path
        Folder for the files; made if missing. Files of an earlier run in it are replaced.
    jobs : int
        Number of processes. The results do not depend on it, but for the times.
    make_vision : callable
        Builds the localiser from the dataset. With `jobs` > 1 it must be importable, for it is sent to other processes.
    draw_overlay : callable
        ``draw_overlay(view, frame, vision)`` returns a BGR picture for the report; likewise.
    moments : mapping of str to str, optional
        By image: the address that opens its moment, for the report.
    force : bool
        Go on where the folder holds other files, too, and keep them.

    Raises
    ------
    ArgumentError
        If `jobs` is not positive.
    FileError
        If the folder holds files of others, or the files cannot be written.
    RobocupVisionError
        If the localiser does not accept the dataset's field, camera or colours.
    """
    if jobs < 1:
        raise ArgumentError(f"jobs must be at least 1, got {jobs}")
    out = Path(out)
    if not force:
        refuse_foreign_files(out, OUTPUT_NAMES)
    notes = list(dataset.notes)
    missing = report.missing_packages()
    if missing:
        notes.append(f"no report.html: {' and '.join(missing)} not installed (pip install 'robocup-vision[report]')")
    if dataset.times is not None and jobs > 1:
        notes.append("a sequence (frames.csv) runs in order in one process: --jobs is ignored")
        jobs = 1
    plan = _Plan(dataset, make_vision, draw_overlay, not missing)
    # built here even when others do the work: a wrong field or colour is reported once, and compiled code is cached
    scorer = _FrameScorer(plan)
    prepare_folder(out, OUTPUT_NAMES)
    results = _score_here(scorer) if jobs == 1 else _score_elsewhere(plan, jobs)

    rows: list[Row] = []
    spread: dict[int, bytes] = {}
    worst = WorstSoFar()
    for result in progress(results, len(dataset.image_names), dataset.name):
        index = len(rows)
        rows.append(result.row)
        if result.jpeg is not None:
            if index in plan.spread:
                spread[index] = result.jpeg
            if worst.admits(index, result.row.severity):
                worst.add(index, result.row.severity, result.jpeg)
        if result.overlay_problem and not any(note.startswith("overlays") for note in notes):
            notes.append(f"overlays show the bare image where drawing fails: {result.overlay_problem}")

    summary = Summary(figures(rows), tuple(rows), out, None if missing else out / "report.html", tuple(notes))
    try:
        write_results(out / "results.csv", rows)
        write_summary(out / "summary.json", summary.figures)
        write_trajectory(out / "trajectory.tum", rows, dataset.times)
        if summary.report is not None:
            text = report.render_report(dataset, rows, summary.figures, notes, spread, worst.pictures, moments)
            summary.report.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FileError(error.filename or out, f"cannot be written ({error.strerror or error})") from None
    return summary


@dataclass(frozen=True, slots=True)
class _Plan:
    dataset: Dataset
    make_vision: MakeVision
    draw_overlay: DrawOverlay
    wants_overlays: bool

    @property
    def spread(self) -> frozenset[int]:
        return spread_indices(len(self.dataset.image_names))


@dataclass(frozen=True, slots=True)
class _FrameResult:
    row: Row
    jpeg: bytes | None = None
    overlay_problem: str = ""


class _FrameScorer:
    """One localiser of one process, and the ranking of the worst frames so far."""

    def __init__(self, plan: _Plan) -> None:
        self._plan = plan
        self._dataset = plan.dataset
        self._spread = plan.spread
        self._worst = WorstSoFar()
        self._unused_odometry: Pose2 | None = Pose2(0.0, 0.0, 0.0)
        self._vision = plan.make_vision(plan.dataset)

    def score(self, index: int, frame: UInt8Array | FrameError) -> _FrameResult:
        """Score one frame; an error of any kind becomes its row's reason."""
        image = self._dataset.image_names[index]
        row = Row(image, truth=self._dataset.truth.get(image))
        t_s, odometry = self._motion(image)
        if isinstance(frame, FrameError):
            self._unused_odometry = odometry
            return _FrameResult(replace(row, reason=_one_line(str(frame).removeprefix(f"{image}: ")), failed=True))
        self._unused_odometry = Pose2(0.0, 0.0, 0.0)
        view = None
        try:
            if self._dataset.times is None:
                self._vision.forget()
            started_s = time.perf_counter()
            view = self._vision.look(frame, t_s=t_s, odometry=odometry)
            row = replace(row, time_s=time.perf_counter() - started_s)
            row = self._score(row, self._pose(view))
        except Exception as error:  # a bug in one frame must not cost the others
            row = replace(row, estimate=None, error=None, reason=_describe(error), failed=True)
            with contextlib.suppress(Exception):
                self._vision.forget()  # its state after an error is unknown
        return self._picture(index, row, view, frame)

    def _motion(self, image: str) -> tuple[float | None, Pose2 | None]:
        if self._dataset.times is None:
            return None, None
        now = self._dataset.times[image]
        # the step since the last frame that was looked at, over any that could not be
        if now.odometry is None or self._unused_odometry is None:
            return now.t_s, None
        return now.t_s, self._unused_odometry.compose(now.odometry)

    def _score(self, row: Row, pose: PoseEstimate | NotLocated) -> Row:
        if not isinstance(pose, PoseEstimate):
            return replace(row, reason=_one_line(pose.reason) or "no reason given")
        values = [*pose.pose.array, *pose.covariance.ravel(), pose.inlier_ratio, pose.residual_px]
        if not (np.isfinite(values).all() and (np.diag(pose.covariance) >= 0).all()):
            raise ValueError("the estimate is not finite or has a negative variance")
        error = None
        if row.truth is not None:
            error = pose_error(pose, row.truth, symmetric=self._dataset.symmetry == "point")
        return replace(row, estimate=pose, error=error)

    def _pose(self, view: ViewLike) -> PoseEstimate | NotLocated:
        if self._dataset.pose_of == "robot":
            return view.pose
        pose = getattr(view, "camera_pose", None)
        if not isinstance(pose, PoseEstimate | NotLocated):
            raise ArgumentError('the localiser gives no camera_pose, which pose_of = "camera" in dataset.toml needs')
        return pose

    def _picture(self, index: int, row: Row, view: ViewLike | None, frame: UInt8Array) -> _FrameResult:
        is_worst = self._worst.admits(index, row.severity)
        if not self._plan.wants_overlays or not (is_worst or index in self._spread):
            return _FrameResult(row)
        picture, problem = frame, ""
        if view is not None:
            try:
                picture = self._plan.draw_overlay(view, frame, self._vision)
            except Exception as error:  # a picture is no reason to lose a figure
                problem = _describe(error)
        jpeg = encode_jpeg(picture)
        if is_worst:
            self._worst.add(index, row.severity, b"")  # only the ranking is needed here, the caller keeps the picture
        return _FrameResult(row, jpeg, problem)


def _describe(error: Exception) -> str:
    if isinstance(error, RobocupVisionError):
        return _one_line(str(error))
    return _one_line(f"internal error: {type(error).__name__}: {error}")


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _score_here(scorer: _FrameScorer) -> Iterator[_FrameResult]:
    for index, frame in enumerate(scorer._dataset.read_frames()):
        yield scorer.score(index, frame)


_worker: _FrameScorer | None = None  # one per worker process, which is what an initialiser is for


def _start_worker(plan: _Plan) -> None:
    global _worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process stops the run
    cv2.setNumThreads(0)
    _worker = _FrameScorer(plan)


def _score_in_worker(index: int, frame: UInt8Array | FrameError | None) -> _FrameResult:
    assert _worker is not None
    if frame is None:
        try:
            frame = _worker._dataset.read_frame(index)
        except FrameError as error:
            frame = error
    return _worker.score(index, frame)


def _score_elsewhere(plan: _Plan, jobs: int) -> Iterator[_FrameResult]:
    count = len(plan.dataset.image_names)
    # a video can only be read in order, so this process reads it; images are read where they are looked at
    frames = plan.dataset.read_frames() if plan.dataset.is_video else iter([None] * count)
    context = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(min(jobs, count), context, initializer=_start_worker, initargs=(plan,))
    waiting: deque[Future[_FrameResult]] = deque()
    try:
        for index, frame in enumerate(frames):
            waiting.append(executor.submit(_score_in_worker, index, frame))
            if len(waiting) >= 4 * jobs:  # no more than this many frames are in memory
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    except BrokenProcessPool:
        raise RobocupVisionError("a worker process ended abruptly; run again with --jobs 1 to see why") from None
    finally:
        executor.shutdown(cancel_futures=True)
