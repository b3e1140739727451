"""A replay is the run itself, bit for bit; with other settings it says by how much it differs, and when first."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from recorded_runs import make_vision, run_frames

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision import cli
from robocup_vision.geometry import Pose2
from robocup_vision.memory import Memory
from robocup_vision.recording import Recorder, Recording
from robocup_vision.recording.loops import Changes, loop_kind
from robocup_vision.recording.replay import Differences, ReplayedCall, replay
from robocup_vision.vision import Vision


def _differences(path: Path, changes: Changes = Changes(), **span: float) -> Differences:
    differences = Differences()
    for call in replay(Recording(path), changes, **span):
        differences.add(call)
    return differences


def test_the_replay_is_the_run(recorded: Path) -> None:
    differences = _differences(recorded)
    assert differences.is_same
    assert differences.calls > 2 * len(run_frames())
    assert differences.first_s is None
    assert differences.looks == len(run_frames())
    assert differences.pose_m.largest == 0.0
    assert differences.command_mps.largest == 0.0


def test_a_span_is_reported_with_what_was_remembered_before(recorded: Path) -> None:
    begin_s, end_s = run_frames()[9].t_s, run_frames()[12].t_s
    differences = _differences(recorded, from_s=begin_s - 1e-6, to_s=end_s + 1e-6)
    assert differences.is_same
    assert differences.looks == 4


def test_other_settings_are_reported(recorded: Path) -> None:
    without = _differences(recorded, Changes(memory=False))
    assert not without.is_same
    assert without.first_s == pytest.approx(run_frames()[0].t_s)
    # no belief any more, so nothing to compare it with
    assert without.belief_m.largest is None
    by_hull = _differences(recorded, Changes(method="hull"))
    assert 0.0 < (by_hull.pose_m.largest or 0.0) < 0.1


def test_steering_follows_the_new_views(recorded: Path) -> None:
    # on a larger field the same picture is of another floor
    differences = _differences(recorded, Changes(field=load_field("msl_6x4")))
    assert not differences.is_same
    assert differences.command_mps.largest is not None


def test_an_unknown_method_is_refused(recorded: Path) -> None:
    with pytest.raises(ArgumentError, match="method"):
        list(replay(Recording(recorded), Changes(method="guess")))


def test_distances_are_of_what_both_know() -> None:
    from robocup_vision.estimates import NotLocated, PoseEstimate

    at = PoseEstimate(Pose2(1.0, 0.0, 3.1), [[1e-4, 0, 0], [0, 1e-4, 0], [0, 0, 1e-4]], 1.0, 0.1)  # type: ignore[arg-type]
    off = PoseEstimate(Pose2(1.0, 0.5, -3.1), at.covariance, 1.0, 0.1)
    differences = Differences()
    differences.add(ReplayedCall(0, "look", 1.0, {"pose": at}, {"pose": off}))
    differences.add(ReplayedCall(1, "look", 2.0, {"pose": at}, {"pose": NotLocated("dark")}))
    assert differences.pose_m.values == [0.5]
    assert differences.pose_rad.largest == pytest.approx(math.tau - 6.2)
    assert differences.located == (2, 1)
    assert differences.first_s == 1.0


@pytest.mark.slow
def test_the_command_writes_its_files(recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only this finds files of a replay that miss calls or tell another result than the page."""
    assert cli.main(["replay", str(recorded), "--out", str(tmp_path / "same")]) == 0
    printed = capsys.readouterr().out
    figures = json.loads((tmp_path / "same" / "replay.json").read_text())
    assert figures["same"] == figures["calls"] > 0
    assert f"{figures['calls']} of {figures['calls']}" in printed
    assert figures["first_difference_s"] is None
    with (tmp_path / "same" / "replay.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == figures["calls"]
    looks = [row for row in rows if row["kind"] == "look"]
    assert all(row["x_m"] == row["replayed_x_m"] != "" for row in looks)
    page = (tmp_path / "same" / "replay.html").read_text()
    assert "calls the same in every bit" in page
    assert page.count("data:image/png") == 7
    assert cli.main(["replay", str(recorded), "--no-memory", "--out", str(tmp_path / "other")]) == 0
    assert json.loads((tmp_path / "other" / "replay.json").read_text())["same"] < figures["calls"]


@pytest.mark.usefixtures("without_plots")
def test_a_replay_that_differs_unasked_is_an_error(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robocup_vision.recording.calls.view_digest", lambda view: "another")
    monkeypatch.setattr("robocup_vision.recording.loops.look_outputs", lambda view: {"digest": "another"})
    assert cli.main(["replay", str(recorded), "--out", str(tmp_path)]) == 1
    assert "differs from what ran" in capsys.readouterr().err


def test_a_loop_that_nobody_brings_is_named() -> None:
    from field_models.errors import RobocupVisionError

    with pytest.raises(RobocupVisionError, match="loop 'another', which no installed package brings"):
        loop_kind("another")


def test_rgb_frames_and_dropped_ones_are_replayed(tmp_path: Path) -> None:
    made = make_vision()
    vision = Vision(made.field, made.camera, memory=Memory(made.field), channels="rgb")
    looks = 4
    with Recorder(tmp_path / "rgb.mcap", vision) as recorder:
        for index, now in enumerate(run_frames()[:looks]):
            frame = None if index == 2 else np.ascontiguousarray(now.frame[..., ::-1])
            view = recorder.look(frame, t_s=now.t_s, odometry=now.odometry)
            assert bool(view.pose) == (index != 2)
    differences = _differences(tmp_path / "rgb.mcap")
    assert differences.is_same
    assert differences.looks == looks
    frames = list(Recording(tmp_path / "rgb.mcap").frames())
    assert len(frames) == looks - 1
    np.testing.assert_array_equal(frames[0].frame, run_frames()[0].frame)


def test_a_file_that_is_none_is_one_line(tmp_path: Path, refused: Callable[..., str]) -> None:
    (tmp_path / "text.mcap").write_text("no recording")
    for name, problem in (("none.mcap", "cannot be read"), ("text.mcap", "is not an MCAP file")):
        assert problem in refused("replay", tmp_path / name, "--out", tmp_path / "out")


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--from", "500"], "no call is in --from 500, they are from 0.000 s to"),
        (["--from", "500", "--to", "600"], "no call is in --from 500 --to 600, they are from 0.000 s to"),
        (["--to", "-1"], "no call is in --to -1, they are from 0.000 s to"),
        (["--from", "2", "--to", "1"], "--to must not be before --from, got 1 before 2"),
        (["--from", "nan"], "--from must be a finite number of seconds, got nan"),
        (["--to", "inf"], "--to must be a finite number of seconds, got inf"),
    ],
)
def test_a_span_without_a_call_is_refused(
    words: list[str], problem: str, recorded: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    assert problem in refused("replay", recorded, *words, "--out", tmp_path / "out")
