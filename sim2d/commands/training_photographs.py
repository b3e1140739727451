"""Common part of the training commands: photographs, the check for torch, and the output folder."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from pathlib import Path

from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.evaluation.dataset import Dataset, load_dataset
from robocup_vision.files.output_folder import telling_write_errors


def prepare_training(args: argparse.Namespace) -> tuple[list[Dataset], Path]:
    """Load the photographs that a command names, check that torch is installed, and make the folder `args.out`.

    Raises
    ------
    RobocupVisionError
        If a dataset is not suitable, torch is missing, or the folder cannot be made.
    """
    datasets = [load_dataset(folder) for folder in args.photographs]
    for folder, dataset in zip(args.photographs, datasets, strict=True):
        if dataset.boxes is None:
            raise ArgumentError(f"{folder}: photographs to learn from need a boxes.csv")
        if not (isinstance(dataset.camera, PinholeCamera) and dataset.camera.known_orientation):
            raise ArgumentError(f"{folder}: photographs to learn from need a forward camera whose tilt is known")
        if dataset.is_video:
            raise ArgumentError(f"{folder}: photographs to learn from must be a folder of images, not a video")
    if find_spec("torch") is None:
        raise ArgumentError("torch is not installed (pip install 'robocup-vision[train]')")
    out = Path(args.out)
    with telling_write_errors(out):
        out.mkdir(parents=True, exist_ok=True)
    return datasets, out
