"""`robocup-vision train-balls`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any

from robocup_vision.commands.options import count, seed


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `train-balls` to an argparse parser's subparsers; `run_train_balls` runs it."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "train-balls",
        help="train the networks that find balls of any look (extra train)",
        description="Draw pictures of balls of many looks among what they are mistaken for, read photographs, train "
        "the two networks that forward cameras find balls by, and write them as places.onnx and ball.onnx.",
    )
    add = parser.add_argument
    add(
        "--photographs",
        action="append",
        default=[],
        metavar="DATASET",
        help="folder with a dataset.toml, a forward camera whose tilt is known, and boxes of kind ball in boxes.csv; "
        "may be given several times (default: renderings alone)",
    )
    add("--scenes", type=count, default=800, metavar="N", help="pictures that are drawn (default: 800)")
    add("--fields", type=count, default=100, metavar="N", help="whole fields that are rendered (default: 100)")
    add("--steps", type=count, default=1700, metavar="N", help="batches that are learnt from (default: 1700)")
    add("--seed", type=seed, default=1, metavar="S", help="renderings, weights and order of batches (default: 1)")
    add("out", metavar="FOLDER", help="where both files are written")
    parser.set_defaults(run=run_train_balls)
    return parser


def run_train_balls(args: argparse.Namespace) -> int:
    """Train and write; return the exit status."""
    import numpy as np

    from robocup_vision.files.output_folder import telling_write_errors
    from sim2d.commands.training_photographs import prepare_training

    datasets, out = prepare_training(args)
    from sim2d.training.ball_training import material, train

    known = material(np.random.default_rng(args.seed), args.scenes, args.fields, datasets)
    with telling_write_errors(out):
        train(out, known, seed=args.seed, steps=args.steps)
    print(out)
    return 0
