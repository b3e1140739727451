"""A match leaves one recording a robot: it replays bit for bit, and truth is a topic of its own."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from sim2d_players import FailsAt, Sleeper

from field_models import load_field
from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.camera.files import load_camera
from robocup_vision.recording import Recording
from robocup_vision.recording.log_reader import LogReader
from robocup_vision.recording.loops import Changes
from robocup_vision.recording.replay import Differences, replay
from sim2d.match.run import MatchPlan, MatchSummary, run_match
from sim2d.players.catalog import PLAYERS
from sim2d.sensors.faults import SenseFault

# a match is played and recorded
pytestmark = pytest.mark.slow

PLAN = MatchPlan(
    players=2,
    seconds=1.0,
    seed=4,
    ours=PLAYERS["planning"],
    theirs=Sleeper,
    faults=(SenseFault(0, "dropped", 0.0, amount=0.3), SenseFault(1, "delayed", 0.2, amount=0.1)),
)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> MatchSummary:
    return run_match(PLAN, tmp_path_factory.mktemp("match"), record=True)


@pytest.mark.parametrize("robot", [0, 1])
def test_a_robot_replays_bit_for_bit(recorded: MatchSummary, robot: int) -> None:
    """Only this finds what a player hears of a match and a recording leaves out."""
    recording = Recording(recorded.recordings[robot])
    differences = Differences()
    for call in replay(recording):
        differences.add(call)
    assert differences.calls == 30
    assert differences.is_same
    assert differences.looks > 10


def test_messages_between_robots_come_back(recorded: MatchSummary) -> None:
    """Only this finds messages between robots that a recording leaves out."""
    calls = Recording(recorded.recordings[1]).calls()
    assert sum(len(call.inputs["messages"]) for call in calls if "messages" in call.inputs) == 2


def test_truth_and_frames_come_back(recorded: MatchSummary) -> None:
    """Only this finds a recording of a match that lacks its truth, its frames or its losses."""
    recording = Recording(recorded.recordings[1])
    truth = recording.truth()
    assert len(truth) == 30
    frames = list(recording.frames())
    assert frames[0].frame.shape == (220, 256, 3)
    assert frames[0].odometry is not None
    dropped = list(Recording(recorded.recordings[0]).frames())
    assert 10 < len(dropped) < 30


def test_another_field_or_camera_may_be_tried_but_no_method(recorded: MatchSummary, tmp_path: Path) -> None:
    """Only this finds a replay by another camera that is not by it."""
    recording = Recording(recorded.recordings[1])
    with pytest.raises(ArgumentError, match="has its own method"):
        next(replay(recording, Changes(method="floor")))
    (tmp_path / "camera.toml").write_bytes(LogReader(recorded.recordings[1]).attachments["camera.toml"])
    camera = load_camera(tmp_path / "camera.toml")
    moved = dataclasses.replace(camera, center_px=(camera.center_px[0] + 2.0, camera.center_px[1]))
    differences = Differences()
    for call in replay(recording, Changes(camera=moved, field=load_field("ssl_2001")), to_s=0.5):
        differences.add(call)
    assert not differences.is_same
    assert 0.0 < (differences.pose_m.largest or 0.0) < 0.2


@pytest.mark.usefixtures("without_plots")
def test_a_player_that_is_not_built_in_is_recorded_but_not_replayed(tmp_path: Path) -> None:
    """Only this finds a stranger's recording that is lost, or replayed by another player."""
    plan = MatchPlan(players=1, seconds=0.1, ours=FailsAt, theirs=PLAYERS["plain"])
    summary = run_match(plan, tmp_path, record=True)
    recording = Recording(summary.recordings[0])
    assert len(list(recording.frames())) == 3
    with pytest.raises(RobocupVisionError, match="'FailsAt' is not one of plain, memory, planning"):
        next(replay(recording))
    unrecorded = run_match(plan, tmp_path)
    assert not list(tmp_path.glob("*.mcap"))
    assert "recording=" not in unrecorded.report.read_text(encoding="utf-8")


def test_the_report_links_the_recordings(recorded: MatchSummary) -> None:
    """Only this finds a report of a match whose links lead to no recording."""
    assert recorded.report is not None
    page = recorded.report.read_text(encoding="utf-8")
    for path in recorded.recordings:
        assert f'href="http://127.0.0.1:8090/?recording={path.name}&amp;t=0.000"' in page
    assert "currentTime" in page
