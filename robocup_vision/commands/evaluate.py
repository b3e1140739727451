"""The command `robocup-vision evaluate`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robocup_vision.commands.options import add_worker_options, chosen_workers

if TYPE_CHECKING:
    from collections.abc import Mapping

    from robocup_vision.evaluation.dataset import Dataset, FrameTime
    from robocup_vision.evaluation.detections import KindFigures
    from robocup_vision.evaluation.run import Summary
    from robocup_vision.evaluation.steering import SteerFigures, SteerPlan

# limits of a slow robot, the default for --steer: speed in m/s, acceleration in m/s^2
_LIMITS = (0.4, 0.3)


def add_parser(subparsers: Any) -> None:
    """Add the command `evaluate`."""
    evaluate = subparsers.add_parser(
        "evaluate",
        help="score the localiser on a folder of images, a video, a recording or a bag",
        description="Score the localiser on a dataset folder, any folder of images, a video, a recording or a rosbag2 "
        "bag, and write results.csv, summary.json, trajectory.tum and report.html.",
    )
    add = evaluate.add_argument
    add("dataset", help="folder with a dataset.toml, folder of images, video file, recording, or bag (extra ros)")
    add("--field", metavar="F", help="built-in field or field file (needed without a dataset.toml)")
    add("--camera", metavar="C", help="camera file, or rig file of several cameras (needed without a dataset.toml)")
    add("--colors", metavar="K", help="colour file (default: learnt from the images)")
    add(
        "--method",
        metavar="M",
        help="field, floor, edges, goal, landmarks; published ones: hull, angles (default: by camera)",
    )
    add("--map", metavar="MAP", help="landmark map (.npz), for method landmarks")
    add("--image-topic", metavar="T", help="topic of the images of a bag that has several")
    add("--truth-topic", metavar="T", help="topic of a bag with true poses (default: /truth/pose)")
    add("--odometry-topic", metavar="T", help="topic of the odometry of a bag that has several")
    add("--out", metavar="DIR", help="folder for the files (default: out/NAME)")
    add("--memory", action="store_true", help="score the estimate over time of a sequence, not what each frame shows")
    add("--half", choices=("own",), help="with --memory: the robot begins in its own half, x < 0 (default: not known)")
    add(
        "--steer", action="store_true", help="steer by each frame, too: as recorded, else straight ahead (steering.csv)"
    )
    add(
        "--limits",
        nargs=2,
        type=float,
        metavar=("SPEED", "ACCELERATION"),
        help="of the robot that is steered, m/s and m/s^2 (default: as recorded, else 0.4 0.3)",
    )
    add("--force", action="store_true", help="write into a folder that holds other files, too")
    add("--resume", action="store_true", help="go on with an interrupted run in the same folder")
    add_worker_options(evaluate)
    add(
        "--shared-folder",
        action="store_true",
        help="with --dask: the workers read the images themselves, by the same paths; else the files are sent to them",
    )
    evaluate.set_defaults(run=run_evaluate)


def run_evaluate(options: argparse.Namespace) -> int:
    """Score a dataset; return 0, or 2 after one line on standard error if an image could not be used."""
    from field_models.errors import ArgumentError
    from robocup_vision.recording.bags.bag import is_bag

    if options.shared_folder and options.dask is None:
        raise ArgumentError("--shared-folder is for --dask")
    if options.half is not None and not options.memory:
        raise ArgumentError("--half is for --memory")
    summary, name = _score_bag(options) if is_bag(options.dataset) else _score_dataset(options)
    _print_summary(name, summary)
    if summary.problem is None:
        return 0
    print(f"robocup-vision evaluate: {summary.problem}", file=sys.stderr)
    return 2


def _score_dataset(options: argparse.Namespace) -> tuple[Summary, str]:
    from field_models.errors import ArgumentError
    from robocup_vision.evaluation.dataset import load_dataset

    for name in ("image_topic", "truth_topic", "odometry_topic"):
        if getattr(options, name) is not None:
            raise ArgumentError(f"--{name.replace('_', '-')} is for recordings and bags, {options.dataset} is none")
    dataset = load_dataset(
        options.dataset,
        field=options.field,
        camera=options.camera,
        colors=options.colors,
        method=options.method,
        landmark_map=options.map,
        takes_rig=True,
    )
    for name in ("memory", "steer"):
        if getattr(options, name) and dataset.landmarks is not None:
            raise ArgumentError(f"--{name} is not for method landmarks")
    return _score(options, dataset), dataset.name


def _score_bag(options: argparse.Namespace) -> tuple[Summary, str]:
    from field_models.errors import ArgumentError
    from robocup_vision.recording.bags.bag_dataset import load_bag, recorded_steering
    from robocup_vision.recording.bags.bag_frames import BagTopics

    if options.map is not None:
        raise ArgumentError("--map is for folders of images, a recording or bag is not located by landmarks")
    dataset = load_bag(
        options.dataset,
        field=options.field,
        camera=options.camera,
        colors=options.colors,
        method=options.method,
        topics=BagTopics(options.image_topic, options.truth_topic, options.odometry_topic),
    )
    summary = _score(
        options,
        dataset,
        moments=_moments(options.dataset, dataset.times or {}),
        recorded=recorded_steering(options.dataset) if options.steer else None,
    )
    return summary, dataset.name


def _score(options: argparse.Namespace, dataset: Dataset, *, recorded: SteerPlan | None = None, **how: Any) -> Summary:
    from functools import partial

    from robocup_vision.evaluation.run import evaluate, make_default_vision, make_vision_with_memory

    return evaluate(
        dataset,
        Path(options.out) if options.out is not None else Path("out") / dataset.name,
        force=options.force,
        resume=options.resume,
        make_vision=partial(make_vision_with_memory, half=options.half) if options.memory else make_default_vision,
        scores_belief=options.memory,
        steering=_steer_plan(options, dataset, recorded),
        workers=chosen_workers(options),
        send_images=not options.shared_folder,
        **how,
    )


def _steer_plan(options: argparse.Namespace, dataset: Dataset, recorded: SteerPlan | None) -> SteerPlan | None:
    from dataclasses import replace

    from field_models.errors import ArgumentError
    from robocup_vision.evaluation.steering import SteerPlan
    from robocup_vision.motion_limits import MotionLimits

    if not options.steer:
        if options.limits is not None:
            raise ArgumentError("--limits is for --steer")
        return None
    limits = MotionLimits(*(options.limits or _LIMITS))
    if recorded is None:
        return SteerPlan(dataset.field.robot_radius_m, limits)
    return recorded if options.limits is None else replace(recorded, limits=limits)


def _moments(path: str, times: Mapping[str, FrameTime]) -> dict[str, str]:
    """Return the addresses of the images' moments in the live page; none for a bag that is not a recording."""
    from field_models.errors import RobocupVisionError
    from robocup_vision.evaluation.moment_links import moment_link
    from robocup_vision.recording.recording import Recording

    try:
        span = Recording(path).span_s
    except (RobocupVisionError, OSError):
        return {}
    begin_s = 0.0 if span is None else span[0]
    return {image: moment_link(Path(path).name, time.t_s - begin_s) for image, time in times.items()}


def _print_summary(name: str, summary: Summary) -> None:
    from robocup_vision.evaluation.report import degrees, millimetres, percent, time_of

    figures = summary.figures
    parts = [] if not summary.left_out else [f"{summary.left_out} of {figures.images + summary.left_out} left out"]
    if 0 < figures.with_truth < figures.images:
        parts.append(f"{figures.images - figures.with_truth} of {figures.images} without truth")
    ms = "-" if figures.median_ms is None else f"{figures.median_ms:.2f} ms ({time_of(summary.is_sequence)})"
    lines = [
        ("method", summary.method),
        ("located", f"{figures.located}/{figures.images}"),
        ("within 5 cm / 3 deg", percent(figures.within_5cm_3deg)),
        ("within 10 cm / 5 deg", percent(figures.within_10cm_5deg)),
        ("median position error", millimetres(figures.median_error_m)),
        ("median heading error", degrees(figures.median_error_rad)),
        ("median time per frame", ms),
        *(
            (kind, _detections_text(one))
            for kind, one in (summary.detections or {}).items()
            if one.boxes or one.reported
        ),
        *([] if summary.steering is None else [("safe commands", _steering_text(summary.steering))]),
        ("report", str(summary.report if summary.report is not None else summary.out)),
    ]
    print(": ".join([name, *([", ".join(parts)] if parts else [])]))
    for label, value in lines:
        # not every terminal can print the report's characters
        print(f"  {label:<22} {value.replace('°', ' deg').replace('–', '-')}")
    for note in summary.notes:
        print(f"note: {note}")


def _detections_text(figures: KindFigures) -> str:
    from robocup_vision.evaluation.report import millimetres, percent

    precision = "" if figures.reported is None else f", precision {percent(figures.precision)} of {figures.reported}"
    error = f", range error {millimetres(figures.median_range_error_m)}" if figures.median_range_error_m else ""
    return f"{figures.found} of {figures.boxes} boxes found ({percent(figures.recall)}){precision}{error}"


def _steering_text(figures: SteerFigures) -> str:
    time = "" if figures.median_ms is None else f", median time {figures.median_ms:.2f} ms"
    return f"{figures.safe}/{figures.commands}{time}"
