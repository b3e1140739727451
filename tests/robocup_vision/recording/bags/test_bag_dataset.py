"""Recordings and bags scored as datasets, and their topics' times."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded_runs import FRAMES, LIMITS, run_frames

from field_models.errors import ArgumentError, FileError
from robocup_vision import cli
from robocup_vision.evaluation.dataset import Truth
from robocup_vision.messages.types import decode, header, make, typestore
from robocup_vision.recording.bags.bag import Bag, is_bag
from robocup_vision.recording.bags.bag_dataset import load_bag, recorded_steering
from robocup_vision.recording.bags.bag_frames import BagTopics
from robocup_vision.recording.bags.stream import pose_at
from robocup_vision.recording.bags.topic_times import TopicTimes, rising
from robocup_vision.recording.log_reader import LogReader
from robocup_vision.recording.recording import Recording

pytestmark = pytest.mark.usefixtures("without_plots")


def write_bag(path: Path, recorded: Path, plugin: str, mode: str | None, skip: tuple[str, ...] = ()) -> None:
    """Write the messages of a recording as a rosbag2 folder, as `ros2 bag record` would."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    writer = Writer(path, version=9, storage_plugin=StoragePlugin[plugin])
    if mode is not None:
        writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for logged in LogReader(recorded).messages():
            if logged.topic in skip or logged.type_name.startswith("robocup_vision_msgs"):
                continue
            if logged.topic not in connections:
                connections[logged.topic] = writer.add_connection(logged.topic, logged.type_name, typestore=typestore())
            writer.write(connections[logged.topic], logged.time_ns, logged.data)


def _assert_scored(out: Path, frames: int = FRAMES) -> None:
    figures = json.loads((out / "summary.json").read_text())
    assert figures["images"] == frames
    assert figures["located"] == frames
    assert figures["within_5cm_3deg"] == 1.0
    assert figures["median_error_m"] < 0.01


def test_a_recording_is_scored_with_what_it_brings(recorded: Path, tmp_path: Path) -> None:
    assert cli.main(["evaluate", str(recorded), "--out", str(tmp_path)]) == 0
    _assert_scored(tmp_path)
    times = [float(line.split()[0]) for line in (tmp_path / "trajectory.tum").read_text().splitlines()]
    assert times == [now.t_s for now in run_frames()]


@pytest.mark.parametrize(
    ("plugin", "mode"),
    [("SQLITE3", None), ("SQLITE3", "FILE"), ("SQLITE3", "MESSAGE"), ("MCAP", None), ("MCAP", "STORAGE")],
)
def test_a_bag_of_any_kind_is_scored(
    plugin: str, mode: str | None, recorded: Path, camera: Path, tmp_path: Path
) -> None:
    write_bag(tmp_path / "bag", recorded, plugin, mode)
    dataset = load_bag(tmp_path / "bag", field="ssl_2001", camera=camera)
    assert dataset.times is not None
    frames = list(dataset.read_frames())
    for name, frame, now in zip(dataset.image_names, frames, run_frames(), strict=True):
        assert isinstance(frame, np.ndarray)
        assert np.array_equal(frame, now.frame)
        odometry = dataset.times[name].odometry
        assert (odometry is None) == (now.t_s == 0.0)
        if odometry is not None:
            assert odometry.array == pytest.approx(now.odometry.array, abs=1e-9)
        truth = dataset.truth[name]
        assert (truth.x_m, truth.y_m) == pytest.approx((now.truth.x_m, now.truth.y_m), abs=1e-9)


@pytest.mark.slow
def test_the_command_scores_a_bag_by_its_topics(recorded: Path, camera: Path, tmp_path: Path) -> None:
    """Only this finds topics that the command hands over wrongly."""
    write_bag(tmp_path / "bag", recorded, "SQLITE3", None)
    out = tmp_path / "out"
    chosen = ["--field", "ssl_2001", "--camera", str(camera), "--truth-topic", "/truth/pose"]
    topics = ["--image-topic", "/camera/image", "--odometry-topic", "/odometry"]
    assert cli.main(["evaluate", str(tmp_path / "bag"), *chosen, *topics, "--out", str(out)]) == 0
    _assert_scored(out)


def test_a_belief_may_stand_for_the_truth(recorded: Path) -> None:
    by_belief = load_bag(recorded, topics=BagTopics(truth="/pose_with_covariance"))
    assert len(by_belief.truth) == FRAMES
    by_odometry = load_bag(recorded, topics=BagTopics(truth="/odometry"))
    assert len(by_odometry.truth) == FRAMES


def test_a_cut_recording_and_a_cut_bag_are_read_as_far_as_they_go(recorded: Path, camera: Path, tmp_path: Path) -> None:
    data = recorded.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    dataset = load_bag(tmp_path / "cut.mcap")
    by_topics = load_bag(tmp_path / "cut.mcap", topics=BagTopics(image="/camera/image"))
    assert 0 < len(dataset.image_names) < FRAMES
    # a cut may come between an image and its call
    assert 0 <= len(by_topics.image_names) - len(dataset.image_names) <= 1
    assert any("was cut off" in note for note in dataset.notes)
    assert any("was cut off" in note for note in by_topics.notes)


@pytest.mark.parametrize(
    ("topics", "problem"),
    [
        (BagTopics(image="/no"), r"has no topic for --image-topic, only /balls, .*, got '/no'"),
        (BagTopics(image="/odometry"), r"--image-topic /odometry must be of sensor_msgs/msg/Image or"),
        (BagTopics(truth="/scan"), r"--truth-topic /scan must be of geometry_msgs/msg/PoseStamped or"),
    ],
)
def test_a_topic_that_does_not_fit_is_named(recorded: Path, topics: BagTopics, problem: str) -> None:
    with pytest.raises(FileError, match=problem):
        load_bag(recorded, topics=topics)


def test_what_is_missing_is_named(recorded: Path, camera: Path, tmp_path: Path) -> None:
    write_bag(tmp_path / "bag", recorded, "MCAP", None, skip=("/camera/image",))
    with pytest.raises(ArgumentError, match="so --field must be given"):
        load_bag(tmp_path / "bag")
    with pytest.raises(ArgumentError, match="so --camera must be given"):
        load_bag(tmp_path / "bag", field="ssl_2001")
    with pytest.raises(FileError, match=r"has no topic of sensor_msgs/msg/Image or"):
        load_bag(tmp_path / "bag", field="ssl_2001", camera=camera)
    with pytest.raises(FileError, match="does not exist"):
        load_bag(tmp_path / "none.db3", field="ssl_2001", camera=camera)
    (tmp_path / "text.db3").write_text("no bag")
    with pytest.raises(FileError, match="is no bag that can be read"):
        load_bag(tmp_path / "text.db3", field="ssl_2001", camera=camera)
    assert is_bag(tmp_path / "bag")
    assert not is_bag(tmp_path / "none")


def test_a_folder_of_recordings_is_no_bag(recorded: Path) -> None:
    with pytest.raises(FileError, match=r"is a folder of recordings, name one of them: run\.mcap"):
        load_bag(recorded.parent)


def test_a_folder_of_images_has_no_topics(tmp_path: Path, refused: Callable[..., str]) -> None:
    assert "--truth-topic is for recordings and bags" in refused("evaluate", tmp_path, "--truth-topic", "/x")


def test_an_image_of_another_size_or_encoding_is_an_unreadable_row(
    recorded: Path, camera: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer

    image = next(m for m in LogReader(recorded).messages() if m.topic == "/camera/image")
    store = typestore()
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/image", image.type_name, typestore=store)
        grey = make(image.type_name, header(2.0, "c"), 4, 4, "mono8", 0, 4, np.zeros(16, dtype=np.uint8))
        small = make(image.type_name, header(3.0, "c"), 4, 4, "bgr8", 0, 12, np.zeros(48, dtype=np.uint8))
        good = decode(image.data, image.type_name)
        for second, message in enumerate((good, grey, small, good)):
            writer.write(connection, second * 10**9 + 10**9, store.serialize_cdr(message, image.type_name))
    out = tmp_path / "out"
    chosen = ["--field", "ssl_2001", "--camera", str(camera)]
    assert cli.main(["evaluate", str(tmp_path / "bag"), *chosen, "--out", str(out)]) == 2
    rows = (out / "results.csv").read_text().splitlines()[1:]
    assert "encoding 'mono8' cannot be read" in rows[1]
    assert "is 4x4, the camera file says 256x220" in rows[2]
    # the stamp of the last image is 0, after those of others
    assert len(rows) == 3
    assert capsys.readouterr().out.startswith("bag: 1 of 4 left out\n")


def test_a_damaged_message_is_its_frames_error(recorded: Path, tmp_path: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer

    image = next(m for m in LogReader(recorded).messages() if m.topic == "/camera/image")
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/image", image.type_name, typestore=typestore())
        writer.write(connection, 1, image.data[:40])
    messages = [message for _, message in Bag(tmp_path / "bag").messages("/image")]
    assert "no sensor_msgs/msg/Image" in str(messages[0])


def test_poses_are_interpolated_between_near_neighbours_alone() -> None:
    poses = [(0.0, Truth(0.0, 0.0, 3.0)), (0.2, Truth(1.0, 2.0, -3.0)), (2.0, Truth(5.0, 5.0, None))]
    middle = pose_at(poses, 0.1)
    assert middle is not None
    assert (middle.x_m, middle.y_m) == pytest.approx((0.5, 1.0))
    assert middle.theta_rad is not None
    assert abs(middle.theta_rad) == pytest.approx(math.pi, abs=1e-9)
    assert pose_at(poses, 1.0) is None
    assert pose_at(poses, -0.1) is None
    assert pose_at(poses, 2.1) is None
    assert pose_at(poses, 2.00005) == poses[2][1]
    assert pose_at([], 0.0) is None


def _steering(out: Path) -> list[dict[str, str]]:
    with (out / "steering.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_a_recording_is_steered_as_it_was(recorded: Path, tmp_path: Path) -> None:
    words = ["evaluate", str(recorded), "--memory", "--steer", "--out", str(tmp_path)]
    assert cli.main(words) == 0
    _assert_scored(tmp_path)
    rows = _steering(tmp_path)
    assert [float(row["target_rad"]) for row in rows] == pytest.approx([math.sin(now.t_s) for now in run_frames()])
    velocities = [call.inputs["velocity_mps"] for call in Recording(recorded).calls() if call.kind == "steer"]
    found = [(float(row["velocity_x_mps"]), float(row["velocity_y_mps"])) for row in rows]
    assert np.array(found) == pytest.approx(np.array(velocities))
    assert any(row["safe"] == "yes" for row in rows)
    plan = recorded_steering(recorded)
    assert plan is not None
    assert plan.limits == LIMITS


def test_a_bag_is_steered_straight_ahead(recorded: Path, camera: Path, tmp_path: Path) -> None:
    write_bag(tmp_path / "bag", recorded, "MCAP", None)
    words = ["evaluate", str(tmp_path / "bag"), "--field", "ssl_2001", "--camera", str(camera), "--memory", "--steer"]
    assert cli.main([*words, "--limits", "0.5", "1", "--out", str(tmp_path / "out")]) == 0
    rows = _steering(tmp_path / "out")
    assert len(rows) == FRAMES
    assert {row["target_rad"] for row in rows} == {"0"}
    speeds = [math.hypot(float(row["command_x_mps"]), float(row["command_y_mps"])) for row in rows]
    assert max(speeds) == pytest.approx(0.5)
    assert float(rows[-1]["velocity_x_mps"]) > 0.1
    assert recorded_steering(tmp_path / "bag") is None


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--limits", "1", "1"], "--limits is for --steer"),
        (["--steer", "--limits", "-1", "1"], "speed_mps must be at least 1e-06, got -1.0"),
        (["--shared-folder"], "--shared-folder is for --dask"),
        (["--half", "own"], "--half is for --memory"),
    ],
)
def test_options_that_do_not_fit_are_one_line(
    words: list[str], problem: str, recorded: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    assert problem in refused("evaluate", recorded, *words, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@given(st.lists(st.integers(0, 6).map(float), max_size=8))
def test_rising_is_the_longest_part_that_rises(times_s: list[float]) -> None:
    parts = (
        part
        for size in range(len(times_s), -1, -1)
        for part in combinations(range(len(times_s)), size)
        if all(times_s[before] < times_s[after] for before, after in pairwise(part))
    )
    # the first of the longest, in the order of their places, is the earliest
    assert rising(times_s) == list(next(parts))


@given(
    rate=st.floats(0.01, 100.0),
    begin_s=st.floats(-1e9, 1e9),
    logged_s=st.lists(st.floats(0.0, 1000.0), min_size=1, max_size=20).map(sorted),
)
def test_no_stamp_of_a_clock_of_its_own_rate_is_off(rate: float, begin_s: float, logged_s: list[float]) -> None:
    evenly_s = [index * 0.1 for index in range(len(logged_s))]
    for logged in (evenly_s, [0.0] * len(logged_s)):
        stamps = tuple(begin_s + rate * 0.1 * index for index in range(len(logged_s)))
        assert TopicTimes("/image", stamps, tuple(logged)).off == frozenset()
    # a recorder that rests for long, on one clock
    assert TopicTimes("/image", tuple(begin_s + t for t in logged_s), tuple(logged_s)).off == frozenset()


def test_a_message_that_cannot_be_read_stands_at_the_time_of_its_logging() -> None:
    times = TopicTimes("/image", (5.0, float("nan"), 5.2), (100.0, 100.1, 100.2))
    assert [round(t_s, 9) for t_s in times.times_s(by_stamps=True)] == [5.0, 5.1, 5.2]
    assert times.times_s(by_stamps=False) == [100.0, 100.1, 100.2]
