"""A match from the command line to its files: figures, film, report, and what is said where one cannot be made."""

import json
import os
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from sim2d_players import SMALL_CAMERA, FailsAt, Reckoner, Sleeper

from field_models import load_field
from field_models.errors import ArgumentError, FileError
from robocup_vision import cli
from sim2d.match import run as match_run
from sim2d.match.match import Match
from sim2d.match.run import MatchPlan, run_match
from sim2d.report import html as match_report
from sim2d.report import video as match_video
from sim2d.report.video import MatchVideo
from sim2d.sensors.faults import SenseFault
from sim2d.world.state import BallState

# `played` is made before it, with its plots
pytestmark = pytest.mark.usefixtures("without_plots")
SHORT = MatchPlan(players=1, seconds=0.1, ours=Sleeper, theirs=Sleeper, camera=SMALL_CAMERA)


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    faults = (SenseFault(0, "black", 0.2, 0.4), SenseFault(1, "dropped", 0.0, amount=0.5))
    plan = MatchPlan(players=1, seconds=1.0, seed=2, ours=Reckoner, theirs=FailsAt, camera=SMALL_CAMERA, faults=faults)
    out = tmp_path_factory.mktemp("match")
    return run_match(plan, out), out


def test_all_files_are_written(played):
    summary, out = played
    assert sorted(path.name for path in out.iterdir()) == ["match.json", "match.webm", "report.html"]
    assert summary.notes == ()
    values = json.loads((out / "match.json").read_text())
    assert values["robots"][0]["within_5cm_3deg"] == 1.0
    assert values["robots"][1]["stopped_reason"] == "RuntimeError: my own bug"
    assert [fault["kind"] for fault in values["faults"]] == ["black", "dropped"]
    assert values["faults"][1]["until_s"] is None


def test_the_film_has_ten_pictures_a_second(played):
    capture = cv2.VideoCapture(str(played[1] / "match.webm"))
    pictures = []
    while True:
        read, picture = capture.read()
        if not read:
            break
        pictures.append(picture)
    assert len(pictures) == 10
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(10.0)
    assert int(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little") == b"VP80"
    assert {picture.shape for picture in pictures} == {pictures[0].shape}
    # something moves on the field, and robot 0's camera was black in between
    panel = [picture[60:200, 800:900].mean() for picture in pictures]
    assert np.ptp(panel) > 50
    assert np.abs(pictures[0][60:, :600].astype(int) - pictures[-1][60:, :600]).max() > 60


def test_the_report_shows_what_happened(played):
    page = (played[1] / "report.html").read_text()
    for text in ("0 : 0", "match.webm", "Robot 1 was stopped at 0.50 s: RuntimeError: my own bug", "black", "seed 2"):
        assert text in page
    assert page.count("data:image/png;base64") == 2
    assert re.search(r'<video src="match.webm" poster="data:image/jpeg;base64,[^"]{1000,}"', page)


def test_the_poster_is_the_picture_with_the_ball_nearest_to_a_goal(tmp_path):
    field = load_field("ssl_2001")
    match = Match(field, 1, 2, ours=Reckoner, theirs=Sleeper, camera=SMALL_CAMERA)
    moment = match.step()
    end_m = field.goals[0].line_x_m
    path = tmp_path / "film.webm"
    film = MatchVideo(path, field, match.arena.camera, 2, match.arena.limits.radius_m)
    # a goal is counted, and the ball lies there, but it is no play; then the ball is near, and then far away
    for x_m, phase in ((end_m, "kick_off"), (0.9 * end_m, "play"), (0.0, "play")):
        state = replace(moment.state, ball=BallState(x_m, 0.0), phase=phase)
        for _ in range(3):
            film.add(replace(moment, state=state))
    film.close()
    poster = cv2.imdecode(np.frombuffer(film.poster, np.uint8), cv2.IMREAD_COLOR)
    capture = cv2.VideoCapture(str(path))
    unlike = [np.abs(poster.astype(int) - capture.read()[1]).mean() for _ in range(3)]
    assert np.argmin(unlike) == 1


def test_a_film_that_cannot_be_written_is_one_note(tmp_path, monkeypatch):
    class Nothing:
        def __init__(self, *_):
            pass

        def isOpened(self):
            return False

        def release(self):
            pass

    monkeypatch.setattr(match_video, "_open_writer", Nothing)
    monkeypatch.setattr(match_report, "missing_packages", lambda: ("jinja2",))
    summary = run_match(SHORT, tmp_path)
    assert summary.video is None
    assert summary.report is None
    assert [path.name for path in tmp_path.iterdir()] == ["match.json"]
    assert summary.notes == (
        "no match.webm: this OpenCV cannot write VP8 video",
        "no report.html: jinja2 not installed (pip install 'robocup-vision[report]')",
    )


def test_a_picture_that_cannot_be_drawn_ends_the_match_with_its_error(tmp_path, monkeypatch):
    def fail(*_):
        raise ValueError("a fault of drawing")

    monkeypatch.setattr(match_video.MatchPictures, "draw", fail)
    with pytest.raises(ValueError, match="a fault of drawing"):
        run_match(SHORT, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_files_of_an_earlier_match_do_not_stay_and_nothing_is_said(tmp_path, capfd):
    (tmp_path / "robot_7.mcap").write_text("old")
    (tmp_path / "report.html").write_text("old")
    run_match(SHORT, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["match.json", "match.webm", "report.html"]
    assert (tmp_path / "report.html").read_text() != "old"
    assert capfd.readouterr().err == ""


def test_a_match_that_fails_leaves_nothing_behind(tmp_path, monkeypatch):
    with pytest.raises(ArgumentError, match="players must be at least 1, got 0"):
        run_match(MatchPlan(players=0), tmp_path / "deep" / "out")
    assert list(tmp_path.iterdir()) == []

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(match_run.MatchStory, "add", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run_match(SHORT, tmp_path / "deep" / "out")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "report.html").write_text("of the match before")
    with pytest.raises(KeyboardInterrupt):
        run_match(SHORT, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_files_of_others_are_refused_unless_forced(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(FileError, match=r"holds files of others \(notes.txt\)"):
        run_match(SHORT, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    summary = run_match(SHORT, tmp_path, force=True)
    assert summary.report == tmp_path / "report.html"
    assert summary.report.exists()
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_realtime_keeps_to_the_clock(tmp_path, monkeypatch):
    slept = []
    clock = iter(np.arange(1000) * 0.001)
    monkeypatch.setattr(match_run.time, "monotonic", lambda: float(next(clock)))
    monkeypatch.setattr(match_run.time, "sleep", slept.append)
    assert run_match(SHORT, tmp_path, realtime=True).notes == ()
    assert len(slept) == 3
    assert slept == pytest.approx([k / 30 - 0.001 * k for k in (1, 2, 3)])


def test_a_machine_that_is_too_slow_says_so(tmp_path, monkeypatch):
    clock = iter(np.arange(1000) * 1.0)
    monkeypatch.setattr(match_run.time, "monotonic", lambda: float(next(clock)))
    notes = run_match(SHORT, tmp_path, realtime=True).notes
    assert notes == ("this machine could not keep up with the clock: it fell 2.9 s behind",)


@pytest.mark.slow
def test_command_prints_a_table_and_repeats_its_file(tmp_path, capsys, monkeypatch):
    """Only this finds a match file of the command that does not repeat."""
    monkeypatch.chdir(tmp_path)
    files = []
    for out in ("one", "two"):
        assert cli.main(["match", "--players", "1", "--seconds", "0.5", "--seed", "4", "--out", out]) == 0
        files.append(Path(out, "match.json").read_bytes())
    assert files[0] == files[1]
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "ssl_2001, 1 against 1, 0.5 s, seed 4"
    assert lines[1] == "score 0 : 0"
    assert [line.split()[:2] for line in lines[2:5]] == [["robot", "side"], ["0", "+x"], ["1", "-x"]]
    assert lines[5] == f"report: {os.path.join('one', 'report.html')}"


def test_a_report_that_cannot_be_written_is_an_error(tmp_path, monkeypatch):
    write_text = Path.write_text

    def fail_for_the_report(path, *arguments, **options):
        if path.name == "report.html":
            raise OSError(28, "No space left on device")
        return write_text(path, *arguments, **options)

    monkeypatch.setattr(Path, "write_text", fail_for_the_report)
    with pytest.raises(FileError, match=r"report.html: cannot be written \(No space left on device\)"):
        run_match(SHORT, tmp_path)
