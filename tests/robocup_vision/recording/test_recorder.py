"""Recordings: what is written comes back, also of files that are cut, damaged or of a killed process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from recorded_runs import make_steering, make_vision, run_frames

from field_models.errors import ArgumentError, FileError, RobocupVisionError
from robocup_vision.geometry import Pose2
from robocup_vision.messages.types import decode, encode
from robocup_vision.recording import Recorder, RecorderSettings, Recording
from robocup_vision.recording.call_writer import CallWriter
from robocup_vision.recording.log_reader import LogReader
from robocup_vision.recording.loops import Changes, loop_kind
from robocup_vision.recording.run import Run


def test_frames_come_back_as_they_were(recorded: Path) -> None:
    recording = Recording(recorded)
    frames = list(recording.frames())
    assert len(frames) == len(run_frames())
    for now, then in zip(frames, run_frames(), strict=True):
        assert np.array_equal(now.frame, then.frame)
        assert now.t_s == then.t_s
        assert now.odometry is not None
        # motion of a step without a frame is part of the next frame's
        assert now.odometry.array == pytest.approx(then.odometry.array, abs=1e-12)
    assert recording.is_whole
    assert not recording.dropped
    assert recording.versions["python"]
    assert recording.camera.size_px == make_vision().camera.size_px
    assert recording.field.name == "ssl_2001"


def test_truth_is_a_topic_of_its_own(recorded: Path) -> None:
    truth = Recording(recorded).truth()
    assert [t_s for t_s, _ in truth] == pytest.approx([now.t_s for now in run_frames()], abs=1e-9)
    for (_, pose), now in zip(truth, run_frames(), strict=True):
        assert pose.array == pytest.approx(now.truth.array, abs=1e-12)


def test_a_time_span_can_be_read_alone(recorded: Path) -> None:
    recording = Recording(recorded)
    times = [now.t_s for now in run_frames()]
    frames = [now.t_s for now in recording.frames(times[3], times[7])]
    assert frames == times[3:8]
    span = recording.span_s
    assert span is not None
    assert span == pytest.approx((times[0], times[-1]), abs=1e-9)


@pytest.mark.parametrize("image_format", ["png", "jpeg"])
def test_compressed_frames_come_back(image_format: str, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    vision = make_vision()
    with Recorder(path, vision, settings=RecorderSettings(image_format)) as recorder:  # type: ignore[arg-type]
        for now in run_frames()[:2]:
            recorder.look(now.frame, now.t_s, now.odometry)
    for got, now in zip(Recording(path).frames(), run_frames(), strict=False):
        off = np.abs(got.frame.astype(int) - now.frame)
        assert off.max() == 0 if image_format == "png" else 0 < off.mean() < 12


def test_a_callers_buffer_may_be_used_again(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    buffer = np.empty_like(run_frames()[0].frame)
    with Recorder(path, make_vision()) as recorder:
        for now in run_frames()[:3]:
            buffer[:] = now.frame
            recorder.look(buffer, now.t_s, now.odometry)
            buffer[:] = 0
    for got, now in zip(Recording(path).frames(), run_frames(), strict=False):
        assert np.array_equal(got.frame, now.frame)


def _cuts(size: int) -> Iterator[int]:
    rng = np.random.default_rng(3)
    yield from sorted(rng.integers(0, size, 60).tolist())


def test_a_file_cut_anywhere_reads_up_to_its_last_whole_chunk(recorded: Path, tmp_path: Path) -> None:
    data = recorded.read_bytes()
    attachments_end = data.index(b"versions.json") + 1000
    whole = [call.number for call in Recording(recorded).calls()]
    seen = set()
    for cut in _cuts(len(data)):
        path = tmp_path / "cut.mcap"
        path.write_bytes(data[:cut])
        if cut < attachments_end:
            continue
        recording = Recording(path)
        numbers = [call.number for call in recording.calls()]
        assert numbers == whole[: len(numbers)]
        assert not recording.is_whole
        seen.add(len(numbers))
    assert len(seen) > 1


@pytest.mark.parametrize("cut", [0, 4, 8, 20, 200])
def test_a_file_cut_in_its_head_says_so(recorded: Path, tmp_path: Path, cut: int) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(recorded.read_bytes()[:cut])
    with pytest.raises(FileError, match=r"is not an MCAP file|no recording of robocup-vision"):
        Recording(path)


def test_a_truth_that_is_not_finite_is_none(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.mcap", make_vision()) as recorder:
        for t_s, x_m in ((0.0, 0.5), (0.1, float("nan")), (0.2, 0.7)):
            recorder.add_truth(Pose2(x_m, 0.0, 0.0), t_s)
    assert [(t_s, pose.x_m) for t_s, pose in Recording(tmp_path / "run.mcap").truth()] == [(0.0, 0.5), (0.2, 0.7)]


def test_a_damaged_chunk_is_named_by_its_time(recorded: Path, tmp_path: Path) -> None:
    from mcap.reader import make_reader

    with recorded.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    place = summary.chunk_indexes[0]
    data = bytearray(recorded.read_bytes())
    middle = place.chunk_start_offset + place.chunk_length // 2
    data[middle : middle + 64] = bytes(64)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(bytes(data))
    with pytest.raises(FileError, match=r"is damaged: its chunk at 0\.000 s"):
        list(Recording(path).calls())


def test_a_foreign_reader_reads_every_message_back_equal(recorded: Path) -> None:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    topics = set()
    with recorded.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        count = 0
        for schema, channel, message, foreign in reader.iter_decoded_messages(log_time_order=False):
            assert schema is not None
            ours = decode(message.data, schema.name)
            _assert_equal(foreign, ours, channel.topic)
            assert encode(ours) == message.data
            topics.add(channel.topic)
            count += 1
    assert count == sum(1 for _ in LogReader(recorded).messages())
    assert topics >= {
        "/camera/image",
        "/camera/camera_info",
        "/odometry",
        "/pose_with_covariance",
        "/vision/pose_with_covariance",
        "/scan",
        "/map",
        "/cmd_vel",
        "/balls",
        "/obstacles",
        "/field_boundary",
        "/tracks",
        "/tf",
        "/tf_static",
        "/truth/pose",
        "/truth/ball",
        "/robocup_vision/calls",
    }


def _assert_equal(foreign: object, ours: object, where: str) -> None:
    if hasattr(ours, "__dataclass_fields__"):
        for name in ours.__dataclass_fields__:
            # constants stand in the type, not in the message
            if not name.startswith("__") and not name.isupper():
                _assert_equal(getattr(foreign, name), getattr(ours, name), f"{where}.{name}")
    elif isinstance(ours, np.ndarray):
        read = np.frombuffer(foreign, np.uint8) if isinstance(foreign, bytes) else np.asarray(foreign)
        assert np.array_equal(read, ours, equal_nan=ours.dtype.kind == "f"), where
    elif isinstance(ours, list):
        assert isinstance(foreign, list)
        assert len(foreign) == len(ours), where
        for a, b in zip(foreign, ours, strict=True):
            _assert_equal(a, b, where)
    else:
        assert foreign == ours or (foreign != foreign and ours != ours), where


def test_a_recording_begun_in_the_middle_says_so(tmp_path: Path) -> None:
    vision, now = make_vision(), run_frames()[0]
    assert vision.is_fresh
    vision.look(now.frame, now.t_s, now.odometry)
    assert not vision.is_fresh
    with Recorder(tmp_path / "a.mcap", vision):
        pass
    assert "in the middle of a run" in Recording(tmp_path / "a.mcap").run.caveat
    vision.forget()
    with Recorder(tmp_path / "b.mcap", vision):
        pass
    assert Recording(tmp_path / "b.mcap").run.caveat == ""


def test_frames_that_stand_alone_replay_alone(tmp_path: Path) -> None:
    vision = make_vision()
    with Recorder(tmp_path / "a.mcap", vision) as recorder:
        for now in run_frames()[:3]:
            vision.forget()
            recorder.add_forget()
            recorder.add_look(vision.look(now.frame, 0.0), now.frame, 0.0)
    recording = Recording(tmp_path / "a.mcap")
    loop = loop_kind(recording.run.loop).make(recording.run, Changes())
    calls = list(recording.calls())
    assert [call.kind for call in calls] == ["forget", "look"] * 3
    assert all(loop.call(call).get("digest") == call.outputs.get("digest") for call in calls)


def test_a_full_queue_drops_by_count_where_asked_to(tmp_path: Path) -> None:
    settings = RecorderSettings(max_waiting_bytes=1, when_full="drop")
    vision = make_vision()
    views = [vision.look(now.frame, now.t_s, now.odometry) for now in run_frames()]
    with Recorder(tmp_path / "a.mcap", vision, settings=settings) as recorder:
        for view, now in zip(views, run_frames(), strict=True):
            recorder.add_look(view, now.frame, now.t_s, now.odometry)
        dropped = recorder.dropped
    recording = Recording(tmp_path / "a.mcap")
    assert recording.dropped == dropped > 0
    numbers = [call.number for call in recording.calls()]
    assert len(numbers) == len(run_frames()) - dropped
    assert numbers == sorted(numbers)


def test_steering_without_a_steering_is_refused(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", make_vision()) as recorder:
        view = recorder.look(run_frames()[0].frame, 0.0)
        with pytest.raises(ArgumentError, match="steer needs a Steering"):
            recorder.steer(view.free_space, (0.0, 0.0), 0.0)


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"no/run\.mcap: cannot be written"):
        Recorder(tmp_path / "no" / "run.mcap", make_vision())


def test_an_error_in_the_thread_reaches_the_loop(tmp_path: Path) -> None:
    calls = CallWriter(tmp_path / "a.mcap", Run.of(make_vision(), make_steering()))
    calls.add_messages(lambda: 1 // 0)  # type: ignore[arg-type, return-value]
    with pytest.raises(RobocupVisionError, match="ZeroDivisionError"):
        calls.close()
    assert Recording(tmp_path / "a.mcap").span_s is None


# each child records 30 frames a second until it is killed, and says each frame's time when it has been handed over
_PROGRAM = """
import os, sys, time
import cv2
cv2.setNumThreads(0)
from recorded_runs import make_vision, run_frames
from robocup_vision.recording import Recorder
vision = make_vision()
frames = run_frames()
views = [vision.look(now.frame, now.t_s, now.odometry) for now in frames]
vision.forget()
for path in sys.argv[1:]:
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        continue
    recorder = Recorder(path, vision)
    begin = time.monotonic()
    for number in range(600):
        t_s = time.monotonic() - begin
        recorder.add_look(views[number % len(frames)], frames[number % len(frames)].frame, t_s)
        sys.stdout.write(f"{os.getpid()} {t_s}\\n"); sys.stdout.flush()
        time.sleep(1 / 30)
    os._exit(0)
"""


@pytest.mark.slow
def test_killed_recordings_read_to_their_last_second(tmp_path: Path) -> None:
    """Only this finds a recording that keeps more than a second in memory."""
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    seconds = np.random.default_rng(7).uniform(1.2, 3.0, 2).tolist()
    paths = [tmp_path / f"{number}.mcap" for number in range(len(seconds))]
    command = [sys.executable, "-c", _PROGRAM, *map(str, paths)]
    said: list[list[float]] = [[] for _ in paths]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        killed: list[int] = []
        for line in process.stdout:
            pid, t_s = int(line.split()[0]), float(line.split()[1])
            if pid in killed:
                said[len(killed) - 1].append(t_s)
                continue
            said[len(killed)].append(t_s)
            if t_s > seconds[len(killed)]:
                os.kill(pid, signal.SIGKILL)
                killed.append(pid)
    assert len(killed) == len(paths)
    for path, times in zip(paths, said, strict=True):
        recording = Recording(path)
        read = [frame.t_s for frame in recording.frames()]
        assert not recording.is_whole
        assert read == times[: len(read)]
        assert read[-1] > times[-1] - 1.0
