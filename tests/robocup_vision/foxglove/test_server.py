"""Foxglove's server: a plain WebSocket client subscribes, and gets the messages that a recording would have."""

from __future__ import annotations

import json
import struct
import threading
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("foxglove")

from recorded_runs import FIELD, make_steering, make_vision, run_frames
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.foxglove import FoxgloveServer
from robocup_vision.messages.images import frame_of
from robocup_vision.messages.topics import TOPIC_TYPES, pose_of
from robocup_vision.messages.types import decode, definition

_LAYOUT = Path(__file__).parents[3] / "ros" / "foxglove" / "layout.json"
_MESSAGE = struct.Struct("<BIQ")


def _read(server: FoxgloveServer, send: Any, wanted: set[str]) -> dict[str, tuple[int, Any]]:
    """Subscribe to all topics; return time and message of the first of each wanted one."""
    got: dict[str, tuple[int, Any]] = {}
    by_id: dict[int, dict[str, str]] = {}
    stop = threading.Event()
    thread = threading.Thread(target=send, args=(stop,))
    address = f"ws://127.0.0.1:{server.port}"
    with connect(address, subprotocols=[Subprotocol("foxglove.sdk.v1")], max_size=None) as client:
        thread.start()
        try:
            for _ in range(2000):
                data = client.recv(timeout=10)
                if isinstance(data, str):
                    said = json.loads(data)
                    for channel in said.get("channels", []) if said["op"] == "advertise" else []:
                        by_id[channel["id"]] = channel
                        request = {
                            "op": "subscribe",
                            "subscriptions": [{"id": channel["id"], "channelId": channel["id"]}],
                        }
                        client.send(json.dumps(request))
                    continue
                opcode, subscription, time_ns = _MESSAGE.unpack_from(data)
                if opcode == 1:
                    channel = by_id[subscription]
                    assert channel["encoding"] == "cdr"
                    assert channel["schema"] == definition(channel["schemaName"])
                    message = decode(data[_MESSAGE.size :], channel["schemaName"])
                    got.setdefault(channel["topic"], (time_ns, message))
                if wanted <= got.keys():
                    break
        finally:
            stop.set()
            thread.join()
    return got


def test_a_client_gets_frames_and_what_they_show() -> None:
    vision, steering = make_vision(), make_steering()
    with FoxgloveServer(FIELD, vision.camera, port=0) as server:
        assert server.host == "127.0.0.1"

        def send(stop: threading.Event) -> None:
            # again and again until the client has heard all: channels are announced with their first message
            while not stop.wait(0.03):
                for now in run_frames()[:3]:
                    view = vision.look(now.frame, None if stop.is_set() else send_s[0], now.odometry)
                    send_s[0] += 0.1
                    command = steering.steer(view.free_space, (0.0, 0.0), 0.0)
                    server.show(now.frame, view, odometry=now.odometry, command=command)

        send_s = [10.0]
        wanted = {
            "/camera/image/compressed",
            "/pose_with_covariance",
            "/scan",
            "/tf",
            "/cmd_vel",
            "/odometry",
            "/balls",
        }
        got = _read(server, send, wanted)
    assert wanted <= got.keys()
    time_ns, image = got["/camera/image/compressed"]
    assert time_ns >= 10_000_000_000
    assert frame_of(image).shape == (220, 256, 3)
    pose = pose_of(got["/pose_with_covariance"][1].pose.pose)
    assert abs(pose.x_m) < 2.0
    assert server.problem == ""


def test_the_loop_does_not_wait_and_old_frames_are_counted() -> None:
    vision, now = make_vision(), run_frames()[0]
    view = vision.look(now.frame, 0.0)
    with FoxgloveServer(FIELD, vision.camera, port=0) as server:
        for _ in range(50):
            server.show(now.frame, view)
        assert server.skipped > 0


def test_a_frame_that_cannot_be_sent_is_said_and_the_next_is_sent() -> None:
    vision, now = make_vision(), run_frames()[0]
    view = vision.look(now.frame, 0.0)
    server = FoxgloveServer(FIELD, vision.camera, port=0)
    server.show(now.frame[:0], view)
    server.close()
    assert server.problem


def test_a_taken_port_and_a_wrong_one_are_one_line() -> None:
    camera = make_vision().camera
    with (
        FoxgloveServer(FIELD, camera, port=0) as server,
        pytest.raises(RobocupVisionError, match="cannot be listened on"),
    ):
        FoxgloveServer(FIELD, camera, port=server.port)
    with pytest.raises(ArgumentError, match="from 0 to 65535, got 70000"):
        FoxgloveServer(FIELD, camera, port=70000)


def test_the_layout_shows_topics_that_there_are() -> None:
    layout = json.loads(_LAYOUT.read_text())
    panels = layout["configById"]
    named = [*panels["3D!field"]["topics"]]
    named += [panels["Image!camera"]["imageMode"][key] for key in ("imageTopic", "calibrationTopic")]
    named += [
        path["value"].partition(".")[0] for name in ("Plot!pose", "Plot!command") for path in panels[name]["paths"]
    ]
    named += [panel["topicPath"] for name, panel in panels.items() if name.startswith("RawMessages")]
    assert set(named) <= set(TOPIC_TYPES)

    def leaves(part: Any) -> list[str]:
        return [part] if isinstance(part, str) else leaves(part["first"]) + leaves(part["second"])

    assert sorted(leaves(layout["layout"])) == sorted(panels)
