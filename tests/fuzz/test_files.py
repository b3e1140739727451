"""Files with anything changed in them load, or are refused by an error that names them; corpus/ holds the seeds."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from mutations import mutate_text

from field_models import load_field
from field_models.errors import RobocupVisionError
from robocup_vision import load_camera, load_colors
from robocup_vision.evaluation.dataset import load_dataset
from robocup_vision.files.csv_table import read_poses
from robocup_vision.mapping.sensor_model import load_sensors
from robocup_vision.planning.gaze.goal_evidence import load_goal_evidence

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
CORPUS = Path(__file__).parent / "corpus"
PACKAGE = Path(__file__).resolve().parents[2] / "robocup_vision"
# by the seed's file: what reads it, and how many mutants of it
READERS = {
    CORPUS / "mirror_camera.toml": (load_camera, 350),
    CORPUS / "table_camera.toml": (load_camera, 350),
    CORPUS / "tangent_camera.toml": (load_camera, 350),
    CORPUS / "pinhole_camera.toml": (load_camera, 350),
    CORPUS / "walled_field.toml": (load_field, 350),
    CORPUS / "carpet_field.toml": (load_field, 350),
    CORPUS / "beacon_field.toml": (load_field, 350),
    CORPUS / "colors.toml": (load_colors, 400),
    CORPUS / "dataset" / "truth.csv": (lambda path: read_poses(path, ["0.png"]), 400),
    PACKAGE / "mapping" / "sensors.toml": (load_sensors, 200),
    next((PACKAGE / "planning" / "gaze").glob("*.toml")): (load_goal_evidence, 150),
}


def is_refused(read, path, *, anywhere=False):
    """Whether reading a file ends in an error of the family, which names it in one line."""
    try:
        read(path)
    except RobocupVisionError as error:
        message = str(error)
        assert "\n" not in message
        assert len(message) < 1000
        assert anywhere or path.name in message
        return True
    return False


@pytest.mark.parametrize("seed", READERS, ids=lambda path: path.name)
def test_the_seeds_themselves_load(seed):
    READERS[seed][0](seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", READERS, ids=lambda path: path.name)
def test_mutated_files_load_or_are_refused(seed, tmp_path):
    """Only this finds a reader that a damaged file ends with a traceback."""
    read, count = READERS[seed]
    text, path = seed.read_text(encoding="utf-8"), tmp_path / seed.name
    rng = np.random.default_rng([18, list(READERS).index(seed)])
    refused = 0
    for _ in range(count):
        path.write_bytes(mutate_text(text, rng))
        refused += is_refused(read, path)
    assert 0.2 * count < refused < count


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dataset.toml", "frames.csv", "truth.csv", "camera.toml"])
def test_mutated_datasets_load_or_are_refused(name, tmp_path):
    """Only this finds a dataset's reader that a damaged file ends with a traceback."""
    folder = tmp_path / "dataset"
    shutil.copytree(CORPUS / "dataset", folder)
    load_dataset(folder)
    text = (CORPUS / "dataset" / name).read_text(encoding="utf-8")
    rng = np.random.default_rng(sum(name.encode()))
    refused = 0
    for _ in range(200):
        (folder / name).write_bytes(mutate_text(text, rng))
        # a path in it may lead to any other file
        refused += is_refused(load_dataset, folder, anywhere=True)
    assert 20 < refused < 200


def test_the_corpus_is_small():
    assert sum(path.stat().st_size for path in CORPUS.rglob("*") if path.is_file()) < 100_000
