"""Scores a localiser on a dataset: every image gets one row, and an error in one image does not end the run."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.arguments import require_kind
from robocup_vision.evaluation import report
from robocup_vision.evaluation.dataset import Dataset
from robocup_vision.evaluation.detections import SCORED_KINDS, KindFigures, detection_figures, reported_kinds
from robocup_vision.evaluation.frame_scorer import (
    DrawOverlay,
    FrameScorer,
    MakeVision,
    ScorePlan,
    ViewLike,
    VisionLike,
    draw_default_overlay,
    make_default_vision,
    make_vision_with_memory,
    score_images,
    score_sequence,
)
from robocup_vision.evaluation.overlays import CROP_COUNT, Crop, WorstSoFar, spread_indices
from robocup_vision.evaluation.result_files import (
    RESULT_CODEC,
    FrameResult,
    prepare_folder,
    results_file,
    run_json,
    steering_file,
    with_truth,
    without_truth,
    write_summary,
    write_trajectory,
)
from robocup_vision.evaluation.scoring import Figures, Row, figures
from robocup_vision.evaluation.steering import SteerFigures, SteerPlan, steer_figures
from robocup_vision.evaluation.truth_units import truth_units_note
from robocup_vision.files.output_folder import refuse_foreign_files
from robocup_vision.files.resume_file import ResumeFile
from robocup_vision.files.text_files import write_text
from robocup_vision.progress import progress
from robocup_vision.workers import Workers, find_workers

__all__ = [
    "DrawOverlay",
    "MakeVision",
    "Summary",
    "ViewLike",
    "VisionLike",
    "evaluate",
    "make_default_vision",
    "make_vision_with_memory",
]

UNFINISHED_NAME = "unfinished.jsonl"
OUTPUT_NAMES = ("results.csv", "steering.csv", "summary.json", "trajectory.tum", "report.html")


@dataclass(frozen=True, slots=True)
class Summary:
    """The results of `evaluate`."""

    figures: Figures  #: the figures over all images
    rows: tuple[Row, ...]  #: one per image, in the images' order
    out: Path  #: the folder of the files
    report: Path | None  #: the HTML report; None if it could not be written
    notes: tuple[str, ...]  #: lines the user should see: what was ignored or left out
    method: str  #: method of localisation
    #: whether colours and poses were carried from image to image; otherwise each was independent, which takes longer
    is_sequence: bool = False
    steering: SteerFigures | None = None  #: the figures over all commands; None without steering
    left_out: int = 0  #: how many frames are not among the images; the notes say why
    #: figures of detections by kind; None if the dataset has no boxes
    detections: dict[str, KindFigures] | None = None

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
    resume: bool = False,
    scores_belief: bool = False,
    steering: SteerPlan | None = None,
    workers: Workers | None = None,
    send_images: bool = True,
) -> Summary:
    """Score a localiser on a dataset and write results.csv, summary.json, trajectory.tum and report.html.

    Each image is independent, unless the dataset has times: then it is one sequence, processed in order in one process,
    with time and odometry. An image whose worker dies is processed again. results.csv gets one line for each image,
    in order, as soon as it is known.

    Parameters
    ----------
    out : str or Path
        Folder for the files; made if missing. Files of an earlier run in it are replaced.
    jobs : int
        Number of processes. Except for the times, the results do not depend on it.
    make_vision : callable
        Builds the localiser from the dataset. With `jobs` > 1 it must be importable, for other processes.
    draw_overlay : callable
        ``draw_overlay(view, frame, vision)`` returns a BGR picture for the report; must be importable, too.
    moments : mapping of str to str, optional
        Address that opens each image's moment, by image, for the report.
    force : bool
        Also write to a folder that holds other files, which are kept.
    resume : bool
        Continue an interrupted run of the same dataset in this folder, if there is one.
    scores_belief : bool
        Score the estimate over time, `view.belief`, instead of each frame's own pose. It needs a localiser with a
        memory, such as `make_vision_with_memory` builds.
    steering : SteerPlan, optional
        Steer by each image, too, and write steering.csv.
    workers : Workers, optional
        Workers from `robocup_vision.workers`; by default `jobs` processes.
    send_images : bool
        Send the bytes of image files to workers on other machines; otherwise they read the files by the same paths.

    Raises
    ------
    ArgumentError
        If an argument is of another kind, `jobs` is not positive, or the belief of a dataset without times or of
        camera poses is to be scored.
    FileError
        If the folder holds other files and `force` is not set, or the files cannot be written.
    RobocupVisionError
        If the localiser does not accept the dataset's field, camera or colours.
    KeyboardInterrupt
        If interrupted: results.csv then holds the finished images, and the error states their number.
    """
    require_kind("dataset", dataset, Dataset, "load_dataset(path)")
    if workers is not None:
        require_kind("workers", workers, Workers, "find_workers(jobs)")
    if steering is not None:
        require_kind("steering", steering, SteerPlan, "SteerPlan(robot_radius_m, limits)")
    require_kind("out", out, (str, Path), "the path of a folder")
    crew = find_workers(jobs) if workers is None else workers
    if scores_belief and dataset.times is None:
        raise ArgumentError("--memory needs a sequence: a video, or a dataset with frames.csv")
    if scores_belief and dataset.pose_of == "camera":
        raise ArgumentError(
            "--memory estimates the robot's pose, the dataset holds the camera's (pose_of = \"camera\")"
        )
    out = Path(out)
    if not force:
        refuse_foreign_files(out, (*OUTPUT_NAMES, UNFINISHED_NAME))
    notes = list(dataset.notes)
    missing = report.missing_packages()
    if missing:
        notes.append(f"no report.html: {' and '.join(missing)} not installed (pip install 'robocup-vision[report]')")
    marked = [box for boxes in (dataset.boxes or {}).values() for box in boxes]
    if others := sorted({box.kind for box in marked} - set(SCORED_KINDS)):
        notes.append(f"boxes of these kinds are not scored, for no view tells them: {', '.join(others)}")
    is_sequence = dataset.times is not None
    in_turn = is_sequence or dataset.is_video
    if in_turn and not crew.is_here:
        notes.append("a sequence runs in order in one process: --jobs and --dask are ignored")
    if is_sequence and resume:
        notes.append("a sequence cannot be gone on with in its middle: --resume is ignored")
        resume = False
    spread = frozenset() if missing else spread_indices(len(dataset.image_names))
    plan = ScorePlan(
        dataset, make_vision, draw_overlay, not missing, spread, scores_belief, steering, reported_kinds(marked)
    )
    # made here even if workers do the work: a wrong field or colour is reported once, and compiled code gets cached
    scorer = FrameScorer(plan)
    run = _Run(plan)
    with ResumeFile(out / UNFINISHED_NAME, run_json(dataset, steering), resume=resume, codec=RESULT_CODEC) as kept:
        prepare_folder(out, OUTPUT_NAMES)
        first = len(kept.found)
        before = (with_truth(kept.found.pop(index), dataset) for index in sorted(kept.found))
        fresh = score_sequence(scorer, first) if in_turn else score_images(scorer, crew, first, send_images=send_images)
        try:
            # `closing` ends the workers even if an interrupt comes while a row is being written
            with closing(fresh), ExitStack() as files:
                tables = [files.enter_context(results_file(out / "results.csv"))]
                if steering is not None:
                    tables.append(files.enter_context(steering_file(out / "steering.csv")))
                for result in progress(chain(before, fresh), len(dataset.image_names), dataset.name):
                    if len(run.rows) >= first and not is_sequence:
                        kept.add(len(run.rows), without_truth(result))
                    for table in tables:
                        table.add(result.row)
                    run.add(result)
        except (KeyboardInterrupt, RobocupVisionError) as error:
            progress_text = (
                f"{len(run.rows)} of {len(dataset.image_names)} images are done and kept in {out / 'results.csv'}"
            )
            if not is_sequence:
                progress_text += "; --resume goes on"
            if isinstance(error, KeyboardInterrupt):
                raise KeyboardInterrupt(progress_text) from None
            raise RobocupVisionError(f"{error}; {progress_text}" if run.rows else str(error)) from None
        notes += run.notes
        units = truth_units_note(run.rows, dataset.field, symmetric=dataset.symmetry == "point")
        notes += [units] if units else []
        steered = None if steering is None else steer_figures([row.steering for row in run.rows if row.steering])
        page = None if missing else out / "report.html"
        summary = replace(_write_files(out, dataset, run, notes, page, moments), steering=steered)
        kept.delete()
    return summary


def _write_files(
    out: Path, dataset: Dataset, run: _Run, notes: list[str], page: Path | None, moments: Mapping[str, str] | None
) -> Summary:
    rows = run.rows
    summary = Summary(
        figures(rows),
        tuple(rows),
        out,
        page,
        tuple(notes),
        dataset.method,
        dataset.times is not None,
        left_out=dataset.left_out,
        detections=None
        if dataset.boxes is None
        else detection_figures([one for row in rows for one in row.detections], run.reported_kinds),
    )
    write_summary(
        out / "summary.json",
        summary.figures,
        method=dataset.method,
        left_out=dataset.left_out,
        detections=summary.detections,
    )
    write_trajectory(out / "trajectory.tum", rows, dataset.times)
    if page is not None:
        found = report.Found(summary.detections, run.crops, run.crops_left_out)
        text = report.render_report(
            dataset, rows, summary.figures, notes, run.spread, run.worst.pictures, moments, found
        )
        write_text(page, text)
    return summary


class _Run:
    """The results so far: all rows, and the pictures that the report shows."""

    def __init__(self, plan: ScorePlan) -> None:
        self.rows: list[Row] = []
        self.notes: list[str] = []
        self.spread: dict[int, bytes] = {}
        self.worst = WorstSoFar()
        self.crops: list[Crop] = []
        self.crops_left_out = 0
        self._spread = plan.spread
        self.reported_kinds = plan.reported_kinds

    def add(self, result: FrameResult) -> None:
        """Add the next image's result."""
        index = len(self.rows)
        self.rows.append(result.row)
        if result.jpeg is not None:
            if index in self._spread:
                self.spread[index] = result.jpeg
            if self.worst.admits(index, result.row.severity):
                self.worst.add(index, result.row.severity, result.jpeg)
        room = CROP_COUNT - len(self.crops)
        self.crops += result.crops[:room]
        self.crops_left_out += len(result.crops[room:])
        if result.overlay_problem and not self.notes:
            self.notes.append(f"overlays show the bare image where drawing fails: {result.overlay_problem}")
