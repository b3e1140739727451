"""Counting how often goals are found, and the command that writes it down."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.cli import main
from robocup_vision.geometry import Pose2
from robocup_vision.planning.gaze.goal_evidence import load_goal_evidence
from sim2d.match.setups import camera_for
from sim2d.rendering.scene import Robot, Scene
from sim2d.sensors import goal_evidence
from sim2d.sensors.goal_evidence import NOTHING, RIGHT, WRONG, corners_in_view, count_evidence

FIELD = load_field("four_legged_2007")
CAMERA = camera_for(FIELD)


def test_corners_in_view_are_counted_with_what_hides_them() -> None:
    pose = Pose2(0.7, 0.0, 0.0)
    scene = Scene(FIELD)
    count, width_px = corners_in_view(scene, CAMERA, pose, 1)
    assert count == 4
    assert width_px == pytest.approx(2 * np.arctan2(0.45, 2.0) * CAMERA.focal_px[0])
    assert corners_in_view(scene, CAMERA, Pose2(0.7, 0.0, 0.5), 1)[0] == 2
    assert corners_in_view(scene, CAMERA, pose, -1)[0] == 0
    # a dog half-way hides the foot of the left post, and a tall robot all of it
    for height_m, left in ((0.2, 3), (1.0, 2)):
        hidden = dataclasses.replace(scene, robots=(Robot(1.7, 0.225, 0.1, height_m),))
        assert corners_in_view(hidden, CAMERA, pose, 1)[0] == left


@pytest.mark.slow
def test_counts_add_up_and_depend_on_seed_and_index_alone() -> None:
    """Only this finds counts that depend on how the work was shared out."""
    both = count_evidence(FIELD, CAMERA, 3, range(8))
    parts = count_evidence(FIELD, CAMERA, 3, range(4)) + count_evidence(FIELD, CAMERA, 3, range(4, 8))
    assert both.first.sum() == 8
    assert np.array_equal(both.first, parts.first)
    assert both.first[..., RIGHT].sum() + both.first[..., WRONG].sum() + both.first[..., NOTHING].sum() == 8
    assert both.first[..., RIGHT].sum() >= 1


def test_command_writes_a_file_that_is_read_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "evidence.toml"
    assert main(["learn-goal-evidence", "--count", "3", "--seed", "1", str(out)]) == 0
    assert "3 looks at the goals of four_legged_2007" in capsys.readouterr().out
    evidence = load_goal_evidence(out)
    assert evidence.found.sum(axis=-1) == pytest.approx(1.0)
    assert "learn-goal-evidence --field four_legged_2007 --count 3 --seed 1" in out.read_text(encoding="utf-8")


def test_command_refuses_a_missing_folder_before_it_counts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(goal_evidence, "count_evidence", lambda *_: pytest.fail("counted for nothing"))
    out = tmp_path / "no" / "out.toml"
    assert main(["learn-goal-evidence", "--count", "1", str(out)]) == 2
    line = f"robocup-vision learn-goal-evidence: {out}: cannot be written: its folder does not exist\n"
    assert capsys.readouterr().err == line
