"""What `check` says of photographs: that those of other things do not show the field, and never so of a field's.

Photographs of other things are scaled to each camera's size and checked as one folder a camera, as a user would who
has given the wrong folder. The folders of photographs of a field are those of `FIELDS`, each with its camera file.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2

from benchmarks.scores.photograph_rows import REAL, PhotographRow, needs, photographs_of_other_things
from robocup_vision import load_camera
from robocup_vision.calibration.check import check_dataset
from robocup_vision.camera import save_camera
from robocup_vision.evaluation.dataset import Dataset, load_dataset
from sim2d.rendering.cameras import sekimori_camera

WORDS = "do not show this field"
# folder, built-in field or None for that of the folder, camera file, method
FIELDS = (
    ("omni_msl_6x4", "msl_6x4", "camera.toml", None),
    ("omni_msl_6x4_b", "msl_6x4", "camera.toml", None),
    ("omni_msl_lab", None, "camera.toml", None),
    ("omni_msl_table", None, "camera.toml", None),
    ("goal_spl", "spl_2020", "camera.toml", None),
)


def _says_so(dataset: Dataset) -> bool:
    return any(WORDS in finding.evidence for finding in check_dataset(dataset))


def _own_field(folder: str, field: str | None) -> str:
    return field or str(REAL / folder / "field.toml")


@needs("negatives")
def other_things() -> PhotographRow:
    """Check the photographs of other things by four cameras."""
    said = []
    with tempfile.TemporaryDirectory() as name:
        walled = Path(name) / "walled.toml"
        save_camera(sekimori_camera(), walled)
        cases: list[tuple[str, Path, str | None]] = [("ssl_2001", walled, None)]
        cases += [
            (_own_field(folder, field), REAL / folder / file, method)
            for folder, field, file, method in (
                FIELDS[0],
                FIELDS[-1],
                ("onboard_ssl_more", None, "camera.toml", "edges"),
            )
        ]
        for number, (field, camera, method) in enumerate(cases):
            folder = Path(name) / str(number)
            folder.mkdir()
            for index, frame in enumerate(photographs_of_other_things(load_camera(camera).size_px)):
                cv2.imwrite(str(folder / f"{index:03d}.png"), frame)
            said.append(_says_so(load_dataset(folder, field=field, camera=camera, method=method)))
    return PhotographRow("check, other things", f"said by {sum(said)} of {len(said)} cameras", "all", all(said))


@needs("omni_msl_lab")
def fields() -> PhotographRow:
    """Check the photographs of a field."""
    said = [
        _says_so(
            load_dataset(
                REAL / folder / "images", field=_own_field(folder, field), camera=REAL / folder / file, method=method
            )
        )
        for folder, field, file, method in FIELDS
    ]
    return PhotographRow("check, fields", f"said of {sum(said)} of {len(said)} folders", "none", not any(said))


ROWS = (other_things, fields)
