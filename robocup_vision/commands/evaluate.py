"""`robocup-vision evaluate`: its options, and what it does with them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robocup_vision.evaluation.run import Summary


def add_parser(subparsers: Any) -> None:
    """Add the command `evaluate`."""
    evaluate = subparsers.add_parser(
        "evaluate",
        help="score the localiser on a folder of images or a video",
        description="Score the localiser on a dataset folder, any folder of images, or a video, and write results.csv, "
        "summary.json, trajectory.tum and report.html.",
    )
    evaluate.add_argument("dataset", help="folder with a dataset.toml, folder of images, or video file")
    evaluate.add_argument("--field", metavar="F", help="built-in field or field file (needed without a dataset.toml)")
    evaluate.add_argument("--camera", metavar="C", help="camera file (needed without a dataset.toml)")
    evaluate.add_argument("--colors", metavar="K", help="colour file (default: learnt from the images)")
    evaluate.add_argument(
        "--method", metavar="M", help="field, floor, edges, goal, landmarks or hull (default: by camera)"
    )
    evaluate.add_argument("--map", metavar="MAP", help="landmark map (.npz), for method landmarks")
    evaluate.add_argument("--out", metavar="DIR", help="folder for the files (default: out/NAME)")
    evaluate.add_argument("--jobs", metavar="N", type=int, default=1, help="number of processes (default: 1)")
    evaluate.set_defaults(run=run_evaluate)


def run_evaluate(options: argparse.Namespace) -> int:
    """Score a dataset; return 0, or 2 after one line on standard error if an image could not be used.

    Raises
    ------
    RobocupVisionError
        If something in the files is wrong.
    """
    from robocup_vision.evaluation.dataset import load_dataset
    from robocup_vision.evaluation.run import evaluate

    dataset = load_dataset(
        options.dataset,
        field=options.field,
        camera=options.camera,
        colors=options.colors,
        method=options.method,
        landmark_map=options.map,
    )
    out = Path(options.out) if options.out is not None else Path("out") / dataset.name
    summary = evaluate(dataset, out, options.jobs)
    _print_summary(dataset.name, summary)
    if summary.problem is None:
        return 0
    print(f"robocup-vision evaluate: {summary.problem}", file=sys.stderr)
    return 2


def _print_summary(name: str, summary: Summary) -> None:
    from robocup_vision.evaluation.report import degrees, millimetres, percent

    figures = summary.figures
    ms = "-" if figures.median_ms is None else f"{figures.median_ms:.2f} ms"
    lines = [
        ("located", f"{figures.located}/{figures.images}"),
        ("within 5 cm / 3 deg", percent(figures.within_5cm_3deg)),
        ("within 10 cm / 5 deg", percent(figures.within_10cm_5deg)),
        ("median position error", millimetres(figures.median_error_m)),
        ("median heading error", degrees(figures.median_error_rad)),
        ("median time per frame", ms),
        ("report", str(summary.report if summary.report is not None else summary.out)),
    ]
    print(name)
    for label, value in lines:
        # the report's signs are not in every terminal's character set
        print(f"  {label:<22} {value.replace('°', ' deg').replace('–', '-')}")
    for note in summary.notes:
        print(f"note: {note}")
