"""`record` writes what comes from a folder or a camera; a camera that is unplugged and comes back goes on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from recorded_runs import make_vision, run_frames
from scripted_source import ScriptedSource

from field_models.errors import ArgumentError, FrameError
from robocup_vision import cli
from robocup_vision.camera.files import save_camera
from robocup_vision.geometry import Pose2
from robocup_vision.live.sources.source import SourceFrame
from robocup_vision.live.sources.source_recording import record_source
from robocup_vision.recording import Recording


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "images").mkdir()
    for number, now in enumerate(run_frames()[:4]):
        cv2.imwrite(str(tmp_path / "images" / f"{number}.png"), now.frame)
    save_camera(make_vision().camera, tmp_path / "camera.toml")
    return tmp_path


def _frames(count: int, odometry: Pose2 | None = None) -> list[object]:
    return [SourceFrame("scripted", now.frame, now.t_s, odometry, truth=now.truth) for now in run_frames()[:count]]


@pytest.mark.usefixtures("without_plots")
def test_a_folder_is_recorded_by_the_command(
    folder: Path, capfd: pytest.CaptureFixture[str], refused: Callable[..., str]
) -> None:
    source, out, camera = str(folder / "images"), str(folder / "run.mcap"), str(folder / "camera.toml")
    assert cli.main(["record", source, out, "--field", "ssl_2001", "--camera", camera, "--memory"]) == 0
    assert "4 frames, 4 of them located" in capfd.readouterr().out
    frames = list(Recording(out).frames())
    assert len(frames) == 4
    assert np.array_equal(frames[3].frame, run_frames()[3].frame)
    assert cli.main(["replay", out, "--out", str(folder / "replay")]) == 0
    options = ["--field", "ssl_2001", "--camera", camera, "--memory"]
    before = Path(out).read_bytes()
    assert "run.mcap: is there already, nothing was written" in refused("record", source, out, *options)
    assert Path(out).read_bytes() == before
    assert cli.main(["record", source, out, *options, "--force"]) == 0
    assert "run.mcap is the source itself" in refused("record", out, out, "--force")
    assert len(list(Recording(out).frames())) == 4


def test_a_frame_that_cannot_be_used_is_counted(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "images" / "1.png").write_bytes(b"no image")
    source, out, camera = str(folder / "images"), str(folder / "run.mcap"), str(folder / "camera.toml")
    options = ["--field", "ssl_2001", "--camera", camera, "--foxglove", "0"]
    assert cli.main(["record", source, out, *options]) == 2
    captured = capsys.readouterr()
    assert "1 frames could not be used, the first: 1.png" in captured.err
    assert "Foxglove: ws://127.0.0.1:" in captured.out
    assert len(list(Recording(out).frames())) == 3


def test_a_camera_that_was_unplugged_is_said_and_goes_on(tmp_path: Path) -> None:
    said: list[str] = []
    first, second = _frames(2)
    summary = record_source(
        ScriptedSource(make_vision(), [first, "gives no frames", second]), tmp_path / "run.mcap", say=said.append
    )
    assert summary.frames == 2
    assert said == ["scripted: gives no frames", "scripted: gives frames again"]
    recording = Recording(tmp_path / "run.mcap")
    assert recording.is_whole
    assert len(recording.truth()) == 2


def test_motion_over_an_unusable_frame_is_not_lost(tmp_path: Path) -> None:
    script = _frames(3, Pose2(0.01, 0.0, 0.0))
    small = SourceFrame("scripted", run_frames()[1].frame[::2, ::2], run_frames()[1].t_s, Pose2(0.01, 0.0, 0.0))
    script[1:2] = [small, FrameError("damaged")]
    summary = record_source(ScriptedSource(make_vision(), script), tmp_path / "run.mcap")
    assert (summary.frames, summary.unusable) == (2, 2)
    assert "frame must be uint8 (220, 256, 3)" in summary.first_problem
    last = list(Recording(tmp_path / "run.mcap").frames())[-1]
    assert last.odometry is not None
    assert last.odometry.x_m == pytest.approx(0.02)


def test_a_time_ends_it_and_an_interrupt_keeps_it(tmp_path: Path) -> None:
    summary = record_source(
        ScriptedSource(make_vision(), _frames(4)), tmp_path / "a.mcap", seconds=run_frames()[2].t_s - 1e-6
    )
    assert summary.frames == 2
    summary = record_source(ScriptedSource(make_vision(), [*_frames(1), KeyboardInterrupt()]), tmp_path / "b.mcap")
    assert summary.frames == 1
    assert Recording(tmp_path / "b.mcap").is_whole


def test_what_cannot_be_recorded_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="--seconds must be positive"):
        record_source(ScriptedSource(make_vision(), []), tmp_path / "a.mcap", seconds=0.0)
    with pytest.raises(ArgumentError, match="record needs the frames of one robot"):
        record_source(ScriptedSource(make_vision(), [], ("one", "other")), tmp_path / "a.mcap")
