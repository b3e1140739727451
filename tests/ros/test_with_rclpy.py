"""The node over real ROS 2: rclpy reads every standard message, images arrive, commands drive, evo agrees.

Run by `make ros-test` in an environment of its own, in a network namespace without any network but loopback.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed: make ros-test")

from recorded_runs import make_vision, record_run, run_frames  # noqa: E402

from robocup_vision import cli  # noqa: E402
from robocup_vision.camera.files import save_camera  # noqa: E402
from robocup_vision.live.sources.opening import open_source  # noqa: E402
from robocup_vision.live.sources.source import SourceFrame, SourceOptions  # noqa: E402
from robocup_vision.messages.images import ImageFormat, image_message  # noqa: E402
from robocup_vision.messages.types import decode, encode, type_hash  # noqa: E402
from robocup_vision.recording.log_reader import LogReader  # noqa: E402
from robocup_vision.ros.type_support import raw_class  # noqa: E402

HERE = Path(__file__).parent
_PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "run.mcap"
    record_run(path)
    return path


@pytest.fixture
def camera(tmp_path: Path) -> Path:
    save_camera(make_vision().camera, tmp_path / "camera.toml")
    return tmp_path / "camera.toml"


@pytest.fixture
def ros() -> Iterator[None]:
    rclpy.init()
    yield
    rclpy.try_shutdown()


@contextlib.contextmanager
def program(*command: object) -> Iterator[subprocess.Popen[str]]:
    """Run a program; end it at the end."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    arguments = [sys.executable, *map(str, command)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True, env=environment) as process:
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()


def test_rclpys_own_deserialiser_reads_every_standard_message(recorded: Path) -> None:
    from rclpy.serialization import deserialize_message, serialize_message

    read: set[str] = set()
    for logged in LogReader(recorded).messages():
        package, _, name = logged.type_name.split("/")
        try:
            kind = getattr(import_module(f"{package}.msg"), name)
        except ImportError:
            continue
        message = deserialize_message(logged.data, kind)
        # what rclpy writes of it is what we wrote, but for padding, which it leaves as it is
        again = encode(decode(serialize_message(message), logged.type_name))
        assert again == logged.data, logged.type_name
        read.add(logged.type_name)
    assert read >= {
        "sensor_msgs/msg/Image",
        "sensor_msgs/msg/CameraInfo",
        "sensor_msgs/msg/LaserScan",
        "nav_msgs/msg/Odometry",
        "nav_msgs/msg/OccupancyGrid",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PointStamped",
        "geometry_msgs/msg/TwistStamped",
    }


@pytest.mark.parametrize("image_format", ["raw", "jpeg"])
def test_an_image_topic_is_a_source_of_the_live_page(ros: None, image_format: ImageFormat) -> None:
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import CompressedImage, Image

    frame = np.full((48, 64, 3), 90, dtype=np.uint8)
    node = rclpy.create_node("camera_and_wheels")
    images = node.create_publisher(Image if image_format == "raw" else CompressedImage, "/camera/image", 5)
    wheels = node.create_publisher(Odometry, "/odom", 5)
    source = open_source("ros:/camera/image,odometry=/odom", SourceOptions(field="ssl_2001"))
    read: list[SourceFrame] = []
    motion = Odometry()
    until_s, number = time.monotonic() + _PATIENCE_S, 0
    try:
        while len(read) < 10 and time.monotonic() < until_s:
            number += 1
            motion.pose.pose.position.x = 0.01 * number
            wheels.publish(motion)
            images.publish(encode(image_message(frame, 100.0 + number / 30, "camera", image_format)))
            read += source.read(1 / 30) or ()
    finally:
        source.close()
        node.destroy_node()
    assert len(read) == 10
    assert source.problem == ""
    assert all(np.abs(one.frame.astype(int) - 90).max() <= 2 for one in read)
    assert all(after.t_s > before.t_s for before, after in itertools.pairwise(read))
    moved = sum(one.odometry.x_m for one in read[1:] if one.odometry is not None)
    # one message may pass the image that it belongs to
    assert moved == pytest.approx(0.3 * (read[-1].t_s - read[0].t_s), abs=0.021)


def test_commands_drive_the_simulated_robot_round_a_square(camera: Path, tmp_path: Path) -> None:
    half = 0.5
    square = [(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)]
    options = ["--field", "ssl_2001", "--camera", camera, "--cmd-vel"]
    drive = [HERE / "simulated_robot.py", json.dumps(square), tmp_path / "path.json"]
    with program("-m", "robocup_vision.cli", "ros", *options), program(*drive) as robot:
        robot.wait(4 * _PATIENCE_S)
    result = json.loads((tmp_path / "path.json").read_text())
    assert [tuple(goal) for goal in result["reached"]] == square[1:]
    off = [abs(max(abs(x), abs(y)) - half) for x, y in result["path"]]
    print(f"largest distance from the square: {1e3 * max(off):.0f} mm in {len(off)} steps")
    assert max(off) < 0.05
    assert result["steps_without_a_command"] <= 0.02 * len(off)


@pytest.fixture
def watcher(ros: None) -> Iterator[tuple[Any, list[str]]]:
    """Return a node, and the warnings that it hears."""
    from rcl_interfaces.msg import Log
    from rclpy.qos import DurabilityPolicy, QoSProfile

    node, logged = rclpy.create_node("watcher"), list[str]()
    quality = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(Log, "/rosout", lambda log: logged.append(log.msg) if log.level == 30 else None, quality)
    yield node, logged
    node.destroy_node()


def test_types_without_a_package_are_published_and_a_wrong_encoding_is_warned_of_once(
    watcher: tuple[Any, list[str]], camera: Path
) -> None:
    from sensor_msgs.msg import Image

    node, logged = watcher
    images = node.create_publisher(Image, "camera/image", 5)
    types = {
        "/balls": "soccer_vision_3d_msgs/msg/BallArray",
        "/obstacles": "soccer_vision_3d_msgs/msg/ObstacleArray",
        "/field_boundary_in_image": "soccer_vision_2d_msgs/msg/FieldBoundary",
        "/tracks": "soccer_model_msgs/msg/ObstacleArray",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    }
    read: dict[str, Any] = {}
    levels: list[int] = []

    def listen(topic: str, name: str) -> None:
        def on_bytes(data: bytes) -> None:
            read[topic] = decode(data, name)
            if topic == "/diagnostics":
                levels.append(read[topic].status[0].level)

        node.create_subscription(raw_class(name), topic, on_bytes, 5, raw=True)

    for topic, name in types.items():
        listen(topic, name)
    now, stamp_s = run_frames()[0], itertools.count(1.0, 0.1)

    def send(encoding: str, is_enough: Callable[[], bool]) -> None:
        until_s = time.monotonic() + 4 * _PATIENCE_S
        while not is_enough() and time.monotonic() < until_s:
            message = image_message(now.frame, next(stamp_s), "camera")
            message.encoding = encoding
            images.publish(encode(message))
            rclpy.spin_once(node, timeout_sec=0.1)

    options = ["--field", "ssl_2001", "--camera", camera]
    with program("-m", "robocup_vision.cli", "ros", *options):
        send("mono8", lambda: any("mono8" in text for text in logged) and 2 in levels)
        send("bgr8", lambda: read.keys() == types.keys() and levels[-1] == 0)
        levels.clear()
        send("mono8", lambda: levels.count(2) == 2)
        published = {topic: node.get_publishers_info_by_topic(topic) for topic in types}
    assert read.keys() == types.keys()
    assert levels.count(2) == 2
    assert len(read["/field_boundary_in_image"].points) > 10
    for topic, name in types.items():
        [info] = [one for one in published[topic] if one.node_name == "robocup_vision"]
        assert (info.topic_type, str(info.topic_type_hash)) == (name, type_hash(name))
    assert sum("image encoding 'mono8' cannot be read" in text for text in logged) == 1
    assert not any("not published" in text for text in logged)


def test_under_another_middleware_what_is_missing_is_named_once(watcher: tuple[Any, list[str]], camera: Path) -> None:
    from diagnostic_msgs.msg import DiagnosticArray

    node, logged = watcher
    told: list[DiagnosticArray] = []
    node.create_subscription(DiagnosticArray, "/diagnostics", told.append, 5)
    another = "import rclpy.utilities as it; it.get_rmw_implementation_identifier = lambda: 'rmw_cyclonedds_cpp'"
    run = "import sys; from robocup_vision import cli; sys.exit(cli.main(sys.argv[1:]))"
    options = ["ros", "--field", "ssl_2001", "--camera", camera]
    with program("-c", f"{another}; {run}", *options):
        until_s = time.monotonic() + 4 * _PATIENCE_S
        while len(told) < 3 and time.monotonic() < until_s:
            rclpy.spin_once(node, timeout_sec=0.1)
    [text] = [text for text in logged if "not published" in text]
    for topic, package in (("/balls", "soccer_vision_3d_msgs"), ("/tracks", "soccer_model_msgs"), ("/tf", "tf2_msgs")):
        assert f"{topic} ({package})" in text
    assert "/scan" not in text
    notes = [pair.value for pair in told[-1].status[0].values if pair.key == "notes"]
    assert "/balls (soccer_vision_3d_msgs) is not installed" in notes[0]


def test_evo_reports_the_same_trajectory_error(recorded: Path, tmp_path: Path) -> None:
    evo = shutil.which("evo_ape", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
    if evo is None:
        pytest.skip("evo is not installed: make ros-test")
    assert cli.main(["evaluate", str(recorded), "--out", str(tmp_path / "out")]) == 0
    from robocup_vision.recording import Recording

    lines = []
    for t_s, pose in Recording(recorded).truth():
        qz, qw = math.sin(pose.theta_rad / 2), math.cos(pose.theta_rad / 2)
        lines.append(f"{t_s!r} {pose.x_m!r} {pose.y_m!r} 0 0 0 {qz!r} {qw!r}\n")
    (tmp_path / "truth.tum").write_text("".join(lines))
    command = [evo, "tum", tmp_path / "truth.tum", tmp_path / "out" / "trajectory.tum"]
    environment = {**os.environ, "HOME": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    [rmse] = re.findall(r"rmse\s+([\d.eE+-]+)", done.stdout)
    figures: dict[str, Any] = json.loads((tmp_path / "out" / "summary.json").read_text())
    ours = math.hypot(figures["rms_x_m"], figures["rms_y_m"])
    print(f"evo: {float(rmse):.6f} m, evaluate: {ours:.6f} m")
    assert float(rmse) == pytest.approx(ours, abs=2e-6)
