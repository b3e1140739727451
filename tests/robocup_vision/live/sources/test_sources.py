"""Sources of frames: what each tells, at what rate, and what is no source."""

import shutil
import time

import cv2
import numpy as np
import pytest

from field_models.errors import ArgumentError, FileError, FrameError, RobocupVisionError
from robocup_vision import Pose2
from robocup_vision.live.sources.capture import CameraSource
from robocup_vision.live.sources.opening import open_source, recordings_in
from robocup_vision.live.sources.source import FrameRate, SourceOptions
from robocup_vision.recording.recorder import Recorder

FIELD = SourceOptions(field="ssl_2001")


class _Device:
    """A camera that gives what a test puts in, and fails when a test says so."""

    def __init__(self, shape=(4, 4, 3)):
        self.frame, self.opened, self.is_there = np.zeros(shape, np.uint8), 0, True

    def open(self, device):
        self.opened += 1
        return self

    def isOpened(self):
        return self.is_there

    def read(self):
        time.sleep(0.002)
        return (True, self.frame) if self.is_there else (False, None)

    def release(self):
        pass


def read_all(source, limit=100):
    got = []
    while len(got) < limit and (frames := source.read(1.0)) is not None:
        got += frames
    return got


def test_a_dataset_says_everything_itself(dataset):
    source = open_source(str(dataset), SourceOptions())
    assert source.setups[0].field.name == "ssl_2001"
    assert source.setups[0].camera is not None
    got = read_all(source)
    assert len(got) == len(list((dataset / "images").iterdir()))
    assert all(frame.alone and frame.truth is not None for frame in got)
    assert [frame.t_s for frame in got] == sorted(frame.t_s for frame in got)
    source.seek(got[2].t_s + 0.1)
    assert source.read(1.0)[0].t_s == got[2].t_s
    vision = source.make_vision(source.setups[0])
    assert vision.look(got[0].frame).pose
    source.close()


def test_a_sequence_hands_its_odometry_over_images_that_cannot_be_read(dataset, tmp_path):
    folder = tmp_path / "sequence"
    shutil.copytree(dataset, folder)
    names = sorted(path.name for path in (folder / "images").iterdir())
    rows = [f"{name},{0.1 * number},{0.0 if number == 0 else 0.01},0,0" for number, name in enumerate(names)]
    (folder / "frames.csv").write_text("image,t_s,dx_m,dy_m,dtheta_rad\n" + "\n".join(rows) + "\n")
    with (folder / "dataset.toml").open("a") as file:
        file.write('frames = "frames.csv"\n')
    (folder / "images" / names[1]).write_bytes(b"broken")
    source = open_source(str(folder), SourceOptions(memory=True))
    first = source.read(1.0)[0]
    assert not first.alone
    with pytest.raises(FrameError, match=names[1]):
        source.read(1.0)
    third = source.read(1.0)[0]
    assert third.odometry.x_m == pytest.approx(0.02)
    assert source.make_vision(source.setups[0]).memory is not None


def test_a_folder_without_a_camera_file_is_to_be_calibrated(dataset):
    source = open_source(str(dataset / "images"), FIELD)
    assert source.setups[0].camera is None
    assert source.make_vision(source.setups[0]) is None
    assert source.read(1.0)[0].alone


def test_a_video_gives_its_frames_at_its_rate(frames, tmp_path):
    path = tmp_path / "film.avi"
    height, width = frames[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 20.0, (width, height))
    for frame in frames:
        writer.write(frame)
    writer.release()
    source = open_source(str(path), FIELD)
    got = read_all(source)
    assert [frame.t_s for frame in got] == pytest.approx([0.0, 0.05, 0.1, 0.15])
    with pytest.raises(ArgumentError, match=r"film.avi cannot go to a time"):
        source.seek(0.0)
    source.close()


def test_a_recording_is_looked_at_with_what_ran(vision, frames, tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path, vision) as recorder:
        views = [recorder.look(frame, t_s=10.0 + 0.1 * number) for number, frame in enumerate(frames)]
        recorder.add_truth(Pose2(0.1, 0.2, 0.3), 10.2)
    source = open_source(str(path), SourceOptions())
    assert source.duration_s == pytest.approx(0.3)
    got = read_all(source)
    assert [frame.t_s for frame in got] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert got[2].truth.x_m == pytest.approx(0.1)
    assert got[1].truth is None
    again = source.make_vision(source.setups[0])
    for frame, view in zip(got, views, strict=True):
        assert again.look(frame.frame, frame.t_s).pose.pose == view.pose.pose
    source.seek(0.15)
    assert source.read(1.0)[0].t_s == pytest.approx(0.2)
    source.close()
    assert recordings_in(tmp_path) == ("run.mcap",)


def test_recordings_outside_the_folder_are_not_listed(tmp_path):
    outside, inside = tmp_path / "secret.mcap", tmp_path / "shown"
    inside.mkdir()
    outside.write_bytes(b"")
    (inside / "own.mcap").write_bytes(b"")
    (inside / ".hidden.mcap").write_bytes(b"")
    (inside / "folder.mcap").mkdir()
    (inside / "link.mcap").symlink_to(outside)
    assert recordings_in(inside) == ("own.mcap",)


def test_a_camera_gives_its_newest_frame():
    device = _Device()
    source = CameraSource("camera", 0, FIELD, device.open)
    first = source.read(5.0)[0]
    time.sleep(0.05)
    second = source.read(5.0)[0]
    # what came between was never read
    assert second.t_s - first.t_s > 0.03
    source.close()
    assert source.read(0.0) is None


def test_a_camera_that_was_unplugged_is_opened_again(monkeypatch):
    monkeypatch.setattr("robocup_vision.live.sources.capture._AGAIN_S", 0.02)
    device = _Device()
    source = CameraSource("camera", 0, FIELD, device.open)
    assert source.read(5.0)
    device.is_there = False
    deadline = time.monotonic() + 5.0
    while not source.problem and time.monotonic() < deadline:
        source.read(0.01)
    assert "unplugged" in source.problem
    device.is_there = True
    while source.problem and time.monotonic() < deadline:
        source.read(0.01)
    assert source.problem == ""
    assert device.opened > 1
    source.close()


def test_a_camera_that_gives_grey_frames_is_refused_frame_by_frame():
    device = _Device(shape=(4, 4))
    source = CameraSource("camera", 0, FIELD, device.open)
    with pytest.raises(FrameError, match="8-bit colour"):
        source.read(5.0)
    source.close()


def test_a_camera_that_is_not_there_is_named():
    device = _Device()
    device.is_there = False
    with pytest.raises(RobocupVisionError, match="camera 7: no camera"):
        CameraSource("camera 7", 7, FIELD, device.open)


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("no/such/thing", FileError, "does not exist"),
        ("/dev/video99", FileError, "does not exist"),
        ("nothing:at_all", ArgumentError, "no source of kind 'nothing:'"),
        ("sim:nowhere", RobocupVisionError, "nowhere"),
    ],
)
def test_sources_that_are_none_are_named(text, error, words):
    with pytest.raises(error, match=words):
        open_source(text, FIELD)


def test_files_that_are_no_source_are_named(tmp_path, dataset):
    for name, words in (("a.png", "single image"), ("a.avi", "no video"), ("a.mcap", "a.mcap")):
        path = tmp_path / name
        path.write_bytes(b"nothing")
        with pytest.raises(RobocupVisionError, match=words):
            open_source(str(path), FIELD)
    with pytest.raises(ArgumentError, match="--field"):
        open_source(str(dataset / "images"), SourceOptions())


def test_a_memory_needs_to_know_how_the_robot_moves(dataset):
    goal = dataset.parent / "goal_four_legged"
    source = open_source(str(goal), SourceOptions(memory=True))
    with pytest.raises(ArgumentError, match="--memory needs odometry"):
        source.make_vision(source.setups[0])
    mirror = open_source(str(dataset), SourceOptions(memory=True))
    assert mirror.make_vision(mirror.setups[0]).memory.ego_motion is not None


def feed(rate, begin_s, step_s, seconds):
    told = []
    t_s = begin_s
    while t_s < begin_s + seconds:
        told.append(rate.add(t_s))
        t_s += step_s
    return [change for change in told if change is not None], t_s


@pytest.mark.parametrize("hz", [5.0, 30.0, 60.0])
def test_a_steady_rate_is_measured_and_never_a_change(hz):
    rate = FrameRate()
    assert rate.rate_hz is None
    changes, _ = feed(rate, 0.0, 1 / hz, 8.0)
    assert changes == []
    assert rate.rate_hz == pytest.approx(hz, rel=0.01)


@pytest.mark.parametrize("other", [15.0, 60.0])
def test_a_change_is_told_once(other):
    rate = FrameRate()
    _, t_s = feed(rate, 0.0, 1 / 30, 5.0)
    changes, _ = feed(rate, t_s, 1 / other, 10.0)
    assert len(changes) == 1
    assert changes[0][0] == pytest.approx(30.0, rel=0.02)
    assert changes[0][1] == pytest.approx(other, rel=0.25)


def test_another_time_is_no_change():
    rate = FrameRate()
    feed(rate, 100.0, 1 / 30, 4.0)
    changes, _ = feed(rate, 0.0, 1 / 10, 4.0)
    assert changes == []
    assert rate.rate_hz == pytest.approx(10.0, rel=0.01)
