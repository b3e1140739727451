"""Bags as other programs leave them: clocks that differ, poses that are none, files that are cut, damaged or killed."""

from __future__ import annotations

import math
import shutil
import sqlite3
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from recorded_runs import make_vision

from field_models.errors import FileError
from robocup_vision.geometry import Pose2
from robocup_vision.messages.camera_infos import camera_info
from robocup_vision.messages.images import image_message
from robocup_vision.messages.topics import pose_message
from robocup_vision.messages.types import definition, encode, header, make, typestore
from robocup_vision.recording.bags.bag import Bag, is_bag
from robocup_vision.recording.bags.bag_dataset import load_bag
from robocup_vision.recording.bags.bag_frames import BagTopics
from robocup_vision.recording.bags.stream import StreamDataset

IMAGE, TRUTH = "/camera/image_raw", "/truth/pose"
COUNT = 6
LOGGED_S = 1.7e9
# noise, which no compression makes small
FRAME = np.random.default_rng(0).integers(0, 256, (220, 256, 3), dtype=np.uint8)

Timed = Sequence[tuple[str, float, Any]]


def truth_message(index: int, t_s: float) -> Any:
    return make("geometry_msgs/msg/PoseStamped", header(t_s, "map"), pose_message(Pose2(0.1 * index, -0.2, 0.5)))


def stamps(index: int) -> float:
    return 100.0 + index / 10


def run(
    image_s: Callable[[int], float] = stamps,
    truth_s: Callable[[int], float] = stamps,
    change: Callable[[int, Any], Any] = lambda index, message: message,
) -> list[tuple[str, float, Any]]:
    """Return images and true poses in turn; `change` makes other poses of them."""
    messages: list[tuple[str, float, Any]] = []
    for index in range(COUNT):
        logged_s = LOGGED_S + index / 10
        messages.append((IMAGE, logged_s, image_message(FRAME, image_s(index), "camera")))
        messages.append((TRUTH, logged_s, change(index, truth_message(index, truth_s(index)))))
    return messages


def write_mcap(path: Path, messages: Timed, **options: Any) -> Path:
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2", library="another program")
        channels: dict[str, int] = {}
        for topic, logged_s, message in messages:
            kind = message.__msgtype__
            if topic not in channels:
                schema = writer.register_schema(kind, "ros2msg", definition(kind).encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], int(logged_s * 1e9), encode(message), int(logged_s * 1e9))
        writer.finish()
    return path


def write_folder(path: Path, messages: Timed, plugin: str) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(path, version=9, storage_plugin=StoragePlugin[plugin]) as writer:
        connections: dict[str, Any] = {}
        for topic, logged_s, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=typestore())
            writer.write(connections[topic], int(logged_s * 1e9), encode(message))
    return path


@pytest.fixture
def load(camera: Path, tmp_path: Path) -> Callable[..., StreamDataset]:
    def read(messages: Timed, topics: BagTopics = BagTopics()) -> StreamDataset:
        path = write_mcap(tmp_path / "bag.mcap", messages)
        return load_bag(path, field="ssl_2001", camera=camera, topics=topics)

    return read


def numbers(dataset: StreamDataset) -> list[int]:
    return [int(name.removeprefix("frame_")) for name in dataset.image_names]


def test_simulated_time_begins_at_zero(load: Callable[..., StreamDataset]) -> None:
    dataset = load(run(lambda index: index / 10, lambda index: index / 10))
    assert numbers(dataset) == list(range(COUNT))
    assert [time.t_s for time in (dataset.times or {}).values()] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert len(dataset.truth) == COUNT
    assert dataset.notes == ()


@pytest.mark.parametrize("wrong", [0, 2, COUNT - 1])
@pytest.mark.parametrize("stamp_s", [0.0, 2e9, 1.0])
def test_a_wrong_stamp_costs_its_own_frame_alone(
    wrong: int, stamp_s: float, load: Callable[..., StreamDataset]
) -> None:
    dataset = load(run(lambda index: stamp_s if index == wrong else stamps(index)))
    assert numbers(dataset) == [index for index in range(COUNT) if index != wrong]
    assert dataset.left_out == 1
    assert len(dataset.truth) == COUNT - 1
    [note] = dataset.notes
    assert "bag.mcap: topic /camera/image_raw: 1 of 6 frames" in note
    assert f"{stamp_s:.3f} s" in note
    assert "left out" in note


def test_frames_out_of_order_and_repeated_are_left_out_and_counted(load: Callable[..., StreamDataset]) -> None:
    times = [100.0, 100.1, 100.1, 100.05, 100.2, 100.3]
    dataset = load(run(lambda index: times[index]))
    assert numbers(dataset) == [0, 1, 4, 5]
    assert dataset.left_out == 2
    assert "2 of 6 frames are not in the order of time (the first: 100.100 s): left out" in dataset.notes[0]


def test_where_time_goes_back_the_longer_part_is_scored_by_its_own_truth(load: Callable[..., StreamDataset]) -> None:
    # a simulator begins anew: the same times, with other poses
    first = run()
    again = run(lambda index: stamps(index) + 0.03, lambda index: stamps(index) + 0.03)[:6]
    for message in (message for topic, _, message in again if topic == TRUTH):
        message.pose.position.x = 5.0
    later = [(topic, logged_s + 20.0, message) for topic, logged_s, message in again]
    dataset = load([*first, *later])
    assert numbers(dataset) == list(range(COUNT))
    assert dataset.left_out == 3
    assert [there.x_m for there in dataset.truth.values()] == pytest.approx([0.1 * index for index in range(COUNT)])


@pytest.mark.parametrize("unstamped", [IMAGE, TRUTH])
def test_without_stamps_the_times_of_logging_count_for_all_topics(
    unstamped: str, load: Callable[..., StreamDataset]
) -> None:
    def zero(index: int) -> float:
        return 0.0

    dataset = load(run(zero if unstamped == IMAGE else stamps, zero if unstamped == TRUTH else stamps))
    assert [time.t_s - LOGGED_S for time in (dataset.times or {}).values()] == pytest.approx(
        [index / 10 for index in range(COUNT)], abs=1e-6
    )
    assert len(dataset.truth) == COUNT
    assert dataset.notes == (
        f"bag.mcap: topic {unstamped}: all stamps are 0: the times of logging are taken, for all topics",
    )


def test_a_truth_of_another_clock_is_said_with_both_spans(load: Callable[..., StreamDataset]) -> None:
    dataset = load(run(truth_s=lambda index: 5000.0 + index / 10))
    assert dataset.truth == {}
    assert dataset.notes == (
        "bag.mcap: topic /truth/pose has poses from 5000.000 s to 5000.500 s, /camera/image_raw frames from 100.000 s"
        " to 100.500 s: no frame has a truth (do the clocks differ?)",
    )


def _with_position(index: int, message: Any, x: float) -> Any:
    if index == 2:
        message.pose.position.x = x
    return message


def _with_orientation(message: Any, *values: float) -> Any:
    q = message.pose.orientation
    q.x, q.y, q.z, q.w = values
    return message


@pytest.mark.parametrize("x", [math.nan, math.inf])
def test_a_pose_that_is_not_finite_is_no_truth(x: float, load: Callable[..., StreamDataset]) -> None:
    dataset = load(run(change=lambda index, message: _with_position(index, message, x)))
    assert sorted(dataset.truth) == [f"frame_{index:06d}" for index in (0, 1, 3, 4, 5)]
    assert dataset.notes == (
        f"bag.mcap: topic /truth/pose: 1 of 6 poses are none (the first at 100.200 s: the position is not finite ({x},"
        " -0.2, 0)): not used",
    )


@pytest.mark.parametrize("values", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0)])
def test_of_a_quaternion_that_is_no_rotation_the_position_alone_is_truth(
    values: tuple[float, ...], load: Callable[..., StreamDataset]
) -> None:
    dataset = load(run(change=lambda index, message: _with_orientation(message, *values)))
    assert [(there.x_m, there.theta_rad) for there in dataset.truth.values()] == [
        (pytest.approx(0.1 * index), None) for index in range(COUNT)
    ]
    assert "6 of 6 orientations are no rotation (the first at 100.000 s): only positions are scored" in dataset.notes[0]


def test_a_pose_that_nobody_filled_in_is_no_truth(load: Callable[..., StreamDataset]) -> None:
    def empty(index: int, message: Any) -> Any:
        if index == 1:
            _with_orientation(message, 0.0, 0.0, 0.0, 0.0)
            message.pose.position.x = message.pose.position.y = 0.0
        return message

    dataset = load(run(change=empty))
    assert "frame_000001" not in dataset.truth
    assert "1 of 6 poses are none (the first at 100.100 s: position and orientation are all 0)" in dataset.notes[0]


def test_a_quaternion_of_another_length_turns_as_far(load: Callable[..., StreamDataset]) -> None:
    half = 0.25
    dataset = load(
        run(change=lambda index, m: _with_orientation(m, 0.0, 0.0, 3.0 * math.sin(half), 3.0 * math.cos(half)))
    )
    assert [there.theta_rad for there in dataset.truth.values()] == pytest.approx([0.5] * COUNT)


def test_the_truth_is_not_taken_for_odometry(load: Callable[..., StreamDataset]) -> None:
    def odometry(index: int, message: Any) -> Any:
        still, unknown = ((0.0,) * 3, (0.0,) * 3), np.zeros(36)
        return make("nav_msgs/msg/Odometry", message.header, "base", (message.pose, unknown), (still, unknown))

    dataset = load(run(change=odometry), BagTopics(truth=TRUTH))
    assert len(dataset.truth) == COUNT
    assert all(time.odometry is None for time in (dataset.times or {}).values())


@pytest.mark.parametrize(
    "options",
    [
        {"index_types": "CHUNK"},
        {"index_types": "NONE"},
        {"use_chunking": False},
        {"use_chunking": False, "use_statistics": False, "use_summary_offsets": False},
        {"repeat_channels": False, "repeat_schemas": False},
    ],
    ids=str,
)
def test_a_file_without_indices_is_read_whole(options: dict[str, Any], camera: Path, tmp_path: Path) -> None:
    from mcap.writer import IndexType

    if "index_types" in options:
        options = {"index_types": IndexType[options["index_types"]]}
    path = write_mcap(tmp_path / "bag.mcap", run(), **options)
    dataset = load_bag(path, field="ssl_2001", camera=camera)
    assert len(dataset.truth) == COUNT
    frames = list(dataset.read_frames())
    assert len(frames) == COUNT
    assert all(np.array_equal(frame, FRAME) for frame in frames)
    assert dataset.notes == ()


@pytest.mark.parametrize("name", ["bag.MCAP", "bag.DB3"])
def test_suffixes_may_be_upper_case(name: str, camera: Path, tmp_path: Path) -> None:
    if name.endswith("MCAP"):
        write_mcap(tmp_path / name, run())
    else:
        folder = write_folder(tmp_path / "bag", run(), "SQLITE3")
        shutil.move(folder / "bag.db3", tmp_path / name)
    assert is_bag(tmp_path / name)
    assert len(load_bag(tmp_path / name, field="ssl_2001", camera=camera).truth) == COUNT


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_a_folder_is_read_without_its_metadata(plugin: str, camera: Path, tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "bag", run(), plugin)
    suffix = ".mcap" if plugin == "MCAP" else ".db3"
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: [\n")
    broken = load_bag(folder, field="ssl_2001", camera=camera)
    assert broken.notes == (f"bag: its metadata.yaml cannot be read (was the recorder killed?): read from bag{suffix}",)
    (folder / "metadata.yaml").unlink()
    assert is_bag(folder)
    dataset = load_bag(folder, field="ssl_2001", camera=camera)
    assert len(dataset.truth) == len(broken.truth) == COUNT
    assert dataset.notes == (f"bag: its metadata.yaml is missing (was the recorder killed?): read from bag{suffix}",)


def test_parts_of_a_bag_are_read_in_their_order_and_a_missing_one_is_named(camera: Path, tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    for number, part in ((10, run()[6:]), (9, run()[:6])):
        write_mcap(folder / f"bag_{number}.mcap", part)
    dataset = load_bag(folder, field="ssl_2001", camera=camera)
    assert numbers(dataset) == list(range(COUNT))
    assert len(dataset.truth) == COUNT
    (folder / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  relative_file_paths: [bag_9.mcap, bag_11.mcap]\n"
    )
    with pytest.raises(FileError, match=r"metadata.yaml: names a file that is not there, got 'bag_11.mcap'"):
        load_bag(folder, field="ssl_2001", camera=camera)
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  relative_file_paths: [bag/bag_9.mcap]\n")
    assert load_bag(folder, field="ssl_2001", camera=camera).notes == (
        "bag: its metadata.yaml does not name bag_10.mcap: left out",
    )


def test_a_database_with_a_journal_is_read_with_what_the_journal_holds(camera: Path, tmp_path: Path) -> None:
    whole = write_folder(tmp_path / "bag", run(), "SQLITE3") / "bag.db3"
    written = sqlite3.connect(whole)
    written.execute("PRAGMA journal_mode=WAL")
    [(last,)] = written.execute("SELECT max(id) FROM messages")
    written.execute("DELETE FROM messages WHERE id = ?", (last,))
    written.commit()
    killed = tmp_path / "killed"
    killed.mkdir()
    for file in whole.parent.glob("bag.db3*"):
        shutil.copy(file, killed)
    written.close()
    assert (killed / "bag.db3-wal").stat().st_size
    dataset = load_bag(killed / "bag.db3", field="ssl_2001", camera=camera)
    assert len(dataset.truth) == COUNT - 1


def test_a_file_cut_in_its_first_chunk_says_so(camera: Path, tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", run(), chunk_size=1 << 24)
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(FileError, match="was cut off before its first whole chunk: nothing of it"):
        load_bag(path, field="ssl_2001", camera=camera)


def test_a_damaged_chunk_in_the_middle_costs_itself_alone(camera: Path, tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", run(), chunk_size=1000)
    data = bytearray(path.read_bytes())
    # amid the pixels of the fourth image
    data[len(data) // 2 + 30_000] ^= 0xFF
    path.write_bytes(bytes(data))
    dataset = load_bag(path, field="ssl_2001", camera=camera)
    assert numbers(dataset) == list(range(COUNT - 1))
    assert [time.t_s for time in (dataset.times or {}).values()] == pytest.approx([100.0, 100.1, 100.2, 100.4, 100.5])
    [note] = dataset.notes
    assert "bag.mcap: is damaged: its chunk at 1700000000.200 s cannot be read (" in note
    assert note.endswith("): left out")


def test_a_damaged_end_costs_nothing(camera: Path, tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", run())
    data = path.read_bytes()
    place = data.rindex(b"ros2msg")
    path.write_bytes(data[:place] + b"\xff" + data[place + 1 :])
    dataset = load_bag(path, field="ssl_2001", camera=camera)
    assert len(dataset.truth) == COUNT
    assert dataset.notes == ()


def test_a_ros_1_bag_is_read(camera: Path, tmp_path: Path) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    time = store.types["builtin_interfaces/msg/Time"]
    with Writer(tmp_path / "run.BAG") as writer:
        connections = {}
        for topic, logged_s, message in run():
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            stamp = time(message.header.stamp.sec, message.header.stamp.nanosec)
            head = store.types["std_msgs/msg/Header"](0, stamp, message.header.frame_id)
            if topic == IMAGE:
                old = store.types[kind](head, message.height, message.width, "bgr8", 0, message.step, message.data)
            else:
                point, q = message.pose.position, message.pose.orientation
                types = (store.types[f"geometry_msgs/msg/{name}"] for name in ("Pose", "Point", "Quaternion"))
                pose, place, turn = types
                old = store.types[kind](head, pose(place(point.x, point.y, point.z), turn(q.x, q.y, q.z, q.w)))
            writer.write(connections[topic], int(logged_s * 1e9), store.serialize_ros1(old, kind))
    dataset = load_bag(tmp_path / "run.BAG", field="ssl_2001", camera=camera)
    assert [there.x_m for there in dataset.truth.values()] == pytest.approx([0.1 * index for index in range(COUNT)])
    assert all(np.array_equal(frame, FRAME) for frame in dataset.read_frames())
    (tmp_path / "killed.bag.active").write_bytes((tmp_path / "run.BAG").read_bytes()[:9000])
    with pytest.raises(FileError, match=r"killed.bag.active: is no bag that can be read \("):
        Bag(tmp_path / "killed.bag.active")


def test_messages_of_another_encoding_are_named(camera: Path, tmp_path: Path) -> None:
    from mcap.writer import Writer

    with (tmp_path / "bag.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("foxglove.CompressedImage", "protobuf", b"")
        writer.add_message(writer.register_channel("/image", "protobuf", schema), 1, b"x", 1)
        writer.finish()
    with pytest.raises(FileError, match=r"only /image of foxglove.CompressedImage \(protobuf\)"):
        load_bag(tmp_path / "bag.mcap", field="ssl_2001", camera=camera)


def test_a_jpeg_compressed_as_rgb_has_its_colours_exchanged_back(load: Callable[..., StreamDataset]) -> None:
    def of_format(text: str, frame: Any) -> StreamDataset:
        packed = cv2.imencode(".png", frame)[1].reshape(-1)
        kind = "sensor_msgs/msg/CompressedImage"
        return load([(IMAGE, LOGGED_S + k, make(kind, header(stamps(k), "c"), text, packed)) for k in range(3)])

    usual = of_format("rgb8; jpeg compressed bgr8", FRAME)
    assert usual.notes == ()
    exchanged = of_format("rgb8; jpeg compressed rgb8", FRAME[..., ::-1])
    for dataset in (usual, exchanged):
        assert all(np.array_equal(frame, FRAME) for frame in dataset.read_frames())
    assert "format 'rgb8; jpeg compressed rgb8'" in exchanged.notes[0]
    assert "red and blue are exchanged" in exchanged.notes[0]


def test_a_camera_info_of_another_camera_is_said(load: Callable[..., StreamDataset]) -> None:
    info = camera_info(make_vision().camera, 100.0, "camera")
    topic = "/camera/camera_info"
    assert load([(topic, LOGGED_S, info), *run()]).notes == ()
    info.binning_x = info.binning_y = 2
    assert load([(topic, LOGGED_S, info), *run()]).notes == (
        "bag.mcap: topic /camera/camera_info at 100.000 s: camera_info says 128x110 (after binning and region of"
        " interest), the camera file 256x220",
    )
