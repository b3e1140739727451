"""`robocup-vision check`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any


def add_parser(subparsers: Any) -> None:
    """Add the command `check` to the subparsers of an argparse parser."""
    parser = subparsers.add_parser(
        "check",
        help="find errors in a set-up: size, field, tilt, mirroring, lens, colours, units",
        description="Use some images of a dataset to find errors in its files, and print each with its evidence. Where "
        "few images are located, or poses contradict truth or odometry, set-ups near this one are tried. The exit "
        "status is 1 if something is wrong.",
    )
    add = parser.add_argument
    add("dataset", help="folder with a dataset.toml, folder of images, or video file")
    add("--field", metavar="F", help="built-in field or field file (needed without a dataset.toml)")
    add("--camera", metavar="C", help="camera file (needed without a dataset.toml)")
    add("--colors", metavar="K", help="colour file")
    parser.set_defaults(run=run_check)


def run_check(args: argparse.Namespace) -> int:
    """Check a dataset and print what was found; return 0 if nothing is wrong, else 1."""
    from robocup_vision.calibration.check import check_dataset
    from robocup_vision.evaluation.dataset import load_dataset

    dataset = load_dataset(args.dataset, field=args.field, camera=args.camera, colors=args.colors)
    findings = check_dataset(dataset)
    words = {"ok": "ok", "wrong": "WRONG", "unknown": "unknown"}
    print(dataset.name)
    for finding in findings:
        print(f"  {words[finding.state]:<8} {finding.subject}: {finding.evidence}")
    return 1 if any(finding.state == "wrong" for finding in findings) else 0
