"""`robocup-vision train-kinds`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any

from robocup_vision.commands.options import count, seed


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `train-kinds` to an argparse parser's subparsers; `run_train_kinds` runs it."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "train-kinds",
        help="train the network that tells robots and people apart (extra train)",
        description="Read photographs, train the network that forward cameras tell the kind of an obstacle by, and "
        "write it as kind.onnx.",
    )
    add = parser.add_argument
    add("--steps", type=count, default=600, metavar="N", help="batches that are learnt from (default: 600)")
    add("--seed", type=seed, default=1, metavar="S", help="places, weights and order of batches (default: 1)")
    add("out", metavar="FOLDER", help="where the file is written")
    add(
        "photographs",
        nargs="+",
        metavar="DATASET",
        help="folder with a dataset.toml, a forward camera whose tilt is known, and boxes of kinds robot and person in "
        "boxes.csv",
    )
    parser.set_defaults(run=run_train_kinds)
    return parser


def run_train_kinds(args: argparse.Namespace) -> int:
    """Train and write; return the exit status."""
    import numpy as np

    from field_models.errors import ArgumentError
    from robocup_vision.files.output_folder import telling_write_errors
    from sim2d.commands.training_photographs import prepare_training

    datasets, out = prepare_training(args)
    from sim2d.training.kind_crops import OTHER, dataset_crops, joined
    from sim2d.training.kind_training import train

    crops = joined([dataset_crops(np.random.default_rng(args.seed), dataset) for dataset in datasets])
    found = np.bincount(crops.kinds, minlength=OTHER + 1)
    print("{} robots, {} people, {} other places".format(*found.tolist()))
    if not found.all():
        raise ArgumentError("photographs to learn from must show robots, people and other places of the floor")
    with telling_write_errors(out):
        train(out / "kind.onnx", crops, seed=args.seed, steps=args.steps)
    print(out)
    return 0
