"""Photographs that a command learns from, and whether it can learn here at all."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.evaluation.dataset import Dataset, load_dataset


def photographs_to_learn_from(folders: Sequence[str]) -> list[Dataset]:
    """Load datasets of one forward camera each, with boxes.

    Raises
    ------
    RobocupVisionError
        If one of them is none such.
    """
    datasets = [load_dataset(folder) for folder in folders]
    for folder, dataset in zip(folders, datasets, strict=True):
        if dataset.boxes is None:
            raise ArgumentError(f"{folder}: photographs to learn from need a boxes.csv")
        if not (isinstance(dataset.camera, PinholeCamera) and dataset.camera.known_orientation):
            raise ArgumentError(f"{folder}: photographs to learn from need a forward camera whose tilt is known")
        if dataset.is_video:
            raise ArgumentError(f"{folder}: photographs to learn from must be a folder of images, not a video")
    return datasets


def check_torch() -> None:
    """Check that torch is installed.

    Raises
    ------
    ArgumentError
        If it is not.
    """
    if find_spec("torch") is None:
        raise ArgumentError("torch is not installed (pip install 'robocup-vision[train]')")
