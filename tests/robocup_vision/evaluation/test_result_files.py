"""The files of a run: their folder holds no earlier run's files, and results that were kept come back as they were."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest

from field_models.errors import FileError
from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.detections import Detection
from robocup_vision.evaluation.overlays import Crop
from robocup_vision.evaluation.result_files import RESULT_CODEC, FrameResult, prepare_folder
from robocup_vision.evaluation.scoring import Row, SteerResult
from robocup_vision.files.resume_file import ResumeFile
from robocup_vision.geometry import Pose2


def test_a_missing_folder_is_made_with_those_it_lies_in(tmp_path: Path) -> None:
    folder = tmp_path / "out" / "run"
    prepare_folder(folder, ("figures.json",))
    assert list(folder.iterdir()) == []


def test_files_of_an_earlier_run_go_and_all_else_stays(tmp_path: Path) -> None:
    for name in ("figures.json", "report.html", "notes.txt"):
        (tmp_path / name).write_text("kept?")
    prepare_folder(tmp_path, ("figures.json", "report.html", "film.webm"))
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_what_is_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match=r"file: cannot be written \(File exists\)"):
        prepare_folder(tmp_path / "file", ())
    (tmp_path / "figures.json").mkdir()
    # a folder of a file's name; how that is called differs between systems
    with pytest.raises(FileError, match=r"cannot be written \(.+\)"):
        prepare_folder(tmp_path, ("figures.json",))


POSE = Pose2(0.1, -2.0, 1e-300)
ESTIMATE = PoseEstimate(POSE, np.diag([1e-4, 2e-4, 1 / 3]), 0.9, float("inf"), (POSE, POSE.half_turn()))
DETECTIONS = (
    Detection("ball", (35.0, 25.0, 45.5, 35.0), (40.0, 30.0), range_error_m=-0.07),
    Detection("person", (1.0, 2.0, 3.0, 4.0), (2.0, 4.0), None, reported_kind="robot"),
    Detection("robot", (0.0, 0.0, 8.0, 8.0)),
    Detection("obstacle", None, (float("nan"), 3.0)),
)
STEERING = SteerResult(0.4, (0.1, 0.0), (0.0, -0.1), safe=False, reason="the gap is too narrow", time_s=2e-3)
RESULTS = {
    0: FrameResult(Row("0.png", ESTIMATE, time_s=0.01, steering=STEERING, detections=DETECTIONS), b"\xff\xd8\x00"),
    1: FrameResult(Row("dunkel é\n.png", reason='too "dark"', failed=True), overlay_problem="no paint"),
    4: FrameResult(Row("2.png", unreadable=True), crops=(Crop("ball, missed", bytes(range(256))),)),
}


def leaves(value: object) -> list[object]:
    """Return a value's class and the leaves in it, arrays as their bytes and floats as their exact text."""
    if is_dataclass(value):
        inner = [leaves(getattr(value, field.name)) for field in fields(value)]
    elif isinstance(value, tuple):
        inner = [leaves(item) for item in value]
    else:
        inner = [value.tobytes() if isinstance(value, np.ndarray) else repr(value)]
    return [type(value), *inner]


def test_every_kind_of_result_that_is_kept_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "unfinished.jsonl"
    with ResumeFile(path, {}, resume=False, codec=RESULT_CODEC) as kept:
        for index, result in RESULTS.items():
            kept.add(index, result)
    # opening it writes what was found again
    for _ in range(2):
        with ResumeFile(path, {}, resume=True, codec=RESULT_CODEC) as kept:
            assert {index: leaves(found) for index, found in kept.found.items()} == {
                index: leaves(result) for index, result in RESULTS.items()
            }


@pytest.mark.parametrize(
    "value",
    [
        '{"class": "Popen", "fields": {"args": "true"}}',
        '{"class": "Pose2", "fields": {"x_m": 1}}',
        '{"class": "Pose2", "fields": {"x_m": {"float": "far"}, "y_m": 0, "theta_rad": 0}}',
        '{"class": "Detection", "fields": {"kind": "ball", "box": null, "colour": "red"}}',
        '{"class": "Crop"}',
        '{"bytes": "&"}',
        '{"array": "<f8", "shape": [4], "data": "AAAA"}',
        '{"map": [1]}',
        "{}",
    ],
)
def test_a_kept_result_that_is_none_is_named_and_the_file_stays(value: str, tmp_path: Path) -> None:
    path = tmp_path / "unfinished.jsonl"
    text = f"{{}}\n[0, {value}]\n"
    path.write_text(text)
    with pytest.raises(FileError, match=r"unfinished\.jsonl: is damaged; begin anew without --resume"):
        ResumeFile(path, {}, resume=True, codec=RESULT_CODEC)
    assert path.read_text() == text
