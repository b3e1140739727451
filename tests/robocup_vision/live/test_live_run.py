"""Sources run side by side: pause, step, seek, record, calibrate; what is wrong is said once, and the run goes on."""

import shutil
import time

import numpy as np
import pytest
from scripted_source import ScriptedSource

from field_models.errors import ArgumentError, FrameError
from robocup_vision.live.live_run import LiveRun
from robocup_vision.live.page.feed import Feed
from robocup_vision.live.page.picture import split_picture
from robocup_vision.live.sources.opening import open_source
from robocup_vision.live.sources.source import SourceFrame, SourceOptions
from robocup_vision.recording.recorder import Recorder
from robocup_vision.recording.recording import Recording

WAIT_S = 30.0


def _scripted(vision, script, name="scripted", waits=False):
    """Return a source; a pair of a script is the time of a frame, and the frame."""
    frames = (SourceFrame(name, item[1], item[0]) if isinstance(item, tuple) else item for item in script)
    return ScriptedSource(vision, frames, (name,), waits)


@pytest.fixture
def run_of(tmp_path):
    runs = []

    def make(*sources, **options):
        feeds = []

        def display(controls):
            feeds.append(Feed())
            return feeds[0]

        run = LiveRun(display, sources, SourceOptions(), tmp_path / "out", quiet=True, **options)
        runs.append(run)
        return run, feeds[0]

    yield make
    for run in runs:
        run.close()


def until(condition):
    deadline = time.monotonic() + WAIT_S
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert condition()


def lines(feed):
    return [line.split("  ", 1)[1] for line in feed.status[1]["lines"]]


def newest(feed, robot="scripted"):
    picture = feed.newest(robot)
    return {"t_s": None} if picture is None else split_picture(picture.data)[0]


def run_to_end(run, feed):
    run.start()
    until(lambda: feed.status[1]["ended"])
    feed.wait_until_made(WAIT_S)


def run_to_pause(run, feed):
    """Start a run that pauses at once; return how many frames it has shown."""
    run.pause(True)
    run.start()
    run.pause(True)
    until(lambda: feed.wait_until_made(1.0))
    return run.loops[0].frames


def test_frames_are_looked_at_and_the_end_is_said(run_of, vision, frames):
    source = _scripted(vision, [(0.1 * n, frame) for n, frame in enumerate(frames)])
    run, feed = run_of(source)
    run_to_end(run, feed)
    assert newest(feed)["pose"]["located"]
    assert newest(feed)["settings"] == {"method": "field"}
    assert lines(feed) == [f"scripted: ended after {len(frames)} frames"]
    run.close()
    assert source.is_closed


def test_a_frame_of_another_size_is_shown_and_said_once(run_of, vision, frames):
    small = np.ascontiguousarray(frames[0][::2, ::2])
    script = [(0.0, frames[0]), (0.1, small), (0.2, small), 0.01]
    run, feed = run_of(_scripted(vision, script))
    run_to_end(run, feed)
    told = newest(feed)
    assert told["size_px"] == [small.shape[1], small.shape[0]]
    assert "layers" not in told
    assert sum(f"{small.shape[1]}" in line for line in lines(feed)) == 1
    assert feed.status[1]["problem"].startswith("scripted:")


def test_after_a_bad_frame_the_run_goes_on(run_of, vision, frames):
    script = [(0.0, frames[0]), FrameError("film.png: is damaged"), (0.2, frames[0])]
    run, feed = run_of(_scripted(vision, script))
    run_to_end(run, feed)
    assert lines(feed) == ["scripted: film.png: is damaged", "scripted: ended after 2 frames"]
    assert newest(feed)["t_s"] == 0.2


def test_a_stall_is_said_and_that_it_is_over(run_of, vision, frames, monkeypatch):
    monkeypatch.setattr("robocup_vision.live.sources.source_loop._STALL_S", 0.05)
    script = [(0.0, frames[0]), 0.06, 0.06, 0.01, (0.2, frames[0])]
    run, feed = run_of(_scripted(vision, script))
    run_to_end(run, feed)
    said = lines(feed)
    assert said[0] == "scripted: stalls: no frame for 0.05 s"
    assert said[1].startswith("scripted: frames come again, after 0.")
    assert feed.status[1]["problem"] == ""


def test_a_bug_ends_one_source_and_is_said(run_of, vision, frames):
    broken = _scripted(vision, [ZeroDivisionError("oh")], name="broken")
    good = _scripted(vision, [(0.0, frames[0])], name="good")
    run, feed = run_of(broken, good)
    run_to_end(run, feed)
    assert "broken: ended: ZeroDivisionError: oh" in lines(feed)
    assert "good: ended after 1 frames" in lines(feed)


def test_a_film_pauses_steps_and_goes_on(run_of, vision, frames):
    run, feed = run_of(_scripted(vision, [(n / 20, frames[0]) for n in range(12)], waits=True))
    assert run.offers == {"pause", "save", "record"}
    before = run_to_pause(run, feed)
    run.step()
    run.step()
    until(lambda: run.loops[0].frames == before + 2)
    time.sleep(0.2)
    assert run.loops[0].frames == before + 2
    assert feed.status[1]["paused"]
    run.pause(False)
    until(lambda: feed.status[1]["ended"])
    assert run.loops[0].frames == 12


class _Simulation(ScriptedSource):
    """Things can be put elsewhere in it, but for one."""

    def __init__(self, vision, frames):
        super().__init__(vision, frames, waits=True)
        self.placed = []

    def place(self, thing, x_m, y_m, theta_rad):
        if thing == "sun":
            raise ArgumentError("there is no 'sun' in this match")
        self.placed.append((thing, x_m, y_m, theta_rad))


def test_things_are_put_elsewhere_even_while_it_stands_still(run_of, vision, frames):
    source = _Simulation(vision, [SourceFrame("scripted", frames[0], n / 20) for n in range(50)])
    run, feed = run_of(source)
    assert "place" in run.offers
    before = run_to_pause(run, feed)
    run.place("ball", 0.5, 0.25, None)
    until(lambda: run.loops[0].frames == before + 1)
    assert source.placed == [("ball", 0.5, 0.25, None)]
    run.place("sun", 0.0, 0.0, None)
    until(lambda: lines(feed) == ["scripted: there is no 'sun' in this match"])


def test_a_camera_cannot_be_paused_or_sought(run_of, vision, frames):
    run, _ = run_of(_scripted(vision, [(0.0, frames[0])]))
    assert run.offers == {"save", "record"}
    for name, *values in (
        ("pause", True),
        ("seek", 1.0),
        ("step",),
        ("open", "a", 0.0),
        ("place", "ball", 0.0, 0.0, None),
    ):
        with pytest.raises(ArgumentError):
            run.ask(name, *values)


def test_a_time_is_gone_to_and_shown(run_of, dataset):
    source = open_source(str(dataset), SourceOptions())
    run, feed = run_of(source)
    assert run.offers == {"pause", "seek", "save", "record"}
    run.start(seek_s=1.0)
    name = source.setups[0].name
    until(lambda: newest(feed, name)["t_s"] == 1.0)
    assert feed.status[1]["paused"]
    # what lies before can be stepped back to
    assert [picture.t_s for picture in feed.history(name)] == [0.0, 0.5, 1.0]
    run.step()
    until(lambda: newest(feed, name)["t_s"] == 1.5)
    run.seek(0.5)
    until(lambda: newest(feed, name)["t_s"] == 0.5)
    run.step()
    until(lambda: newest(feed, name)["t_s"] == 1.0)


def test_two_robots_of_one_name_are_refused(run_of, vision, frames):
    with pytest.raises(ArgumentError, match="scripted: is named twice"):
        run_of(_scripted(vision, []), _scripted(vision, []))


def test_what_runs_is_recorded(run_of, vision, frames, tmp_path):
    run, feed = run_of(_scripted(vision, [(0.1 * n, frame) for n, frame in enumerate(frames)]))
    run.record_to(tmp_path / "run.mcap")
    assert feed.status[1]["recording"].endswith("run.mcap")
    run_to_end(run, feed)
    run.record(False)
    assert feed.status[1]["recording"] == ""
    assert len(list(Recording(tmp_path / "run.mcap").frames())) == len(frames)


def test_the_button_records_to_a_free_name(run_of, vision, frames, tmp_path):
    run, feed = run_of(_scripted(vision, [(0.0, frames[0]), 0.5]))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "recording_000.mcap").write_bytes(b"")
    run.record(True)
    assert feed.status[1]["recording"].endswith("recording_001.mcap")
    run.record(False)
    assert "recorded" in lines(feed)[-1]


def test_recordings_of_the_folder_are_opened_at_a_time(run_of, vision, frames, tmp_path):
    for name in ("a", "b"):
        with Recorder(tmp_path / f"{name}.mcap", vision) as recorder:
            for number, frame in enumerate(frames):
                recorder.look(frame, t_s=0.5 * number)
    (tmp_path / "out").mkdir(exist_ok=True)
    run, feed = run_of(open_source(str(tmp_path / "a.mcap"), SourceOptions()), folder=tmp_path)
    assert feed.status[1]["recordings"] == ["a.mcap", "b.mcap"]
    run.start()
    run.open("b.mcap", 1.0)
    until(lambda: newest(feed, "b")["t_s"] == 1.0)
    assert feed.status[1]["opened"] == "b.mcap"
    for name in ("../a.mcap", "/etc/passwd", "c.mcap", "a.mcap\0", str(tmp_path / "a.mcap")):
        with pytest.raises(ArgumentError, match="no recording"):
            run.open(name, 0.0)


@pytest.mark.slow
def test_a_camera_is_calibrated_from_the_page(run_of, dataset, tmp_path, monkeypatch):
    """Only this finds a calibration that the page starts with other frames, or whose end it does not hear."""
    monkeypatch.setattr("robocup_vision.live.calibrating._EVERY_S", 0.0)
    monkeypatch.setattr("robocup_vision.live.sources.folder._IMAGES_HZ", 20.0)
    images = tmp_path / "images"
    shutil.copytree(dataset / "images", images)
    source = open_source(str(images), SourceOptions(field="ssl_2001"))
    run, feed = run_of(source)
    assert "calibrate" in run.offers
    with pytest.raises(ArgumentError, match="collect frames first"):
        run.calibrate("omni")
    run.collect(True)
    run_to_end(run, feed)
    until(lambda: feed.status[1]["calibration"]["frames"] >= 5)
    run.collect(False)
    run.calibrate("omni")
    with pytest.raises(ArgumentError, match="under way"):
        run.calibrate("omni")
    deadline = time.monotonic() + 240.0
    while feed.status[1]["calibration"]["busy"] and time.monotonic() < deadline:
        time.sleep(0.1)
    told = feed.status[1]["calibration"]
    subjects = {subject: state for subject, state, _ in told["findings"]}
    assert subjects["camera"] == "ok"
    assert subjects["size"] == "ok"
    assert list((tmp_path / "out").glob("calibration_*/camera.toml"))
    assert {"save", "record"} <= run.offers


def test_a_calibration_without_a_floor_says_why(run_of, tmp_path):
    import cv2

    folder = tmp_path / "dark"
    folder.mkdir()
    for number in range(2):
        cv2.imwrite(str(folder / f"{number}.png"), np.full((48, 64, 3), 60 * number, np.uint8))
    run, feed = run_of(open_source(str(folder), SourceOptions(field="ssl_2001")))
    run.collect(True)
    run.start()
    until(lambda: feed.status[1]["calibration"]["frames"] >= 1)
    run.calibrate("omni")
    until(lambda: not feed.status[1]["calibration"]["busy"])
    assert feed.status[1]["calibration"]["text"].startswith("not calibrated: ")
