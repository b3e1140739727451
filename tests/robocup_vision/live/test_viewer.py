"""`Viewer` in a robot's loop: the page's process shows what it is shown, and never stops the loop."""

import json
import subprocess
import time

import cv2
import numpy as np
import pytest
from websockets.sync.client import connect

from field_models.errors import ArgumentError, FrameError, RobocupVisionError
from robocup_vision.live import Viewer
from robocup_vision.live.page.picture import split_picture

WAIT_S = 30.0


@pytest.fixture
def started(monkeypatch):
    """Return the processes that have been started."""
    processes, start = [], subprocess.Popen

    def kept(*arguments, **options):
        processes.append(start(*arguments, **options))
        return processes[-1]

    monkeypatch.setattr(subprocess, "Popen", kept)
    return processes


@pytest.fixture
def viewer(vision, tmp_path):
    with Viewer(vision, port=0, out=tmp_path / "out") as made:
        yield made


def link_to(viewer):
    return connect(viewer.address.replace("http", "ws") + "live", origin=viewer.address.rstrip("/"), max_size=None)


def next_picture(link):
    while True:
        got = link.recv(timeout=WAIT_S)
        if isinstance(got, bytes):
            told, jpeg, _ = split_picture(got)
            link.send(json.dumps({"type": "drawn", "robot": told["robot"], "number": told["number"]}))
            return told, jpeg


def test_what_is_shown_arrives_in_a_page_and_what_cannot_be_shown_is_refused(viewer, vision, frames, tmp_path):
    with link_to(viewer) as link:
        view = vision.look(frames[0], t_s=4.5)
        viewer.show(frames[0], view, command=(0.1, 0.2, 0.3), way=[(1.0, 0.0)], reasons=["towards the ball"])
        told, _ = next_picture(link)
        assert told["t_s"] == 4.5
        assert told["pose"]["pose"][:2] == pytest.approx(view.pose.pose.array[:2], abs=1e-4)
        assert (told["command"], told["way"], told["reasons"]) == ([0.1, 0.2, 0.3], [[1.0, 0.0]], ["towards the ball"])
        # the robot may write into its buffer as soon as show has returned
        buffer = frames[1].copy()
        viewer.show(buffer, vision.look(buffer, t_s=4.6))
        buffer[:] = 0
        number = next_picture(link)[0]["number"]
        link.send(json.dumps({"type": "save", "robot": "robot", "number": number}))
        deadline = time.monotonic() + WAIT_S
        path = tmp_path / "out" / "frame_000" / "dataset.toml"
        while not path.exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        assert path.exists()
        assert np.array_equal(cv2.imread(str(path.parent / "images" / "000000.png")), frames[1])
        # a larger frame has room in the memory that both processes share
        for frame in (np.zeros((900, 1600, 3), np.uint8), frames[0]):
            viewer.show(frame, view)
            assert next_picture(link)[0]["size_px"] == [frame.shape[1], frame.shape[0]]
    assert viewer.cpu_s > 0
    for frame in (frames[0][..., 0], frames[0].astype(np.float32)):
        with pytest.raises(FrameError, match=r"\(H, W, 3\) uint8"):
            viewer.show(frame, view)
    with pytest.raises(ArgumentError, match="forward, left and turn"):
        viewer.show(frames[0], view, command=(0.1, 0.2))


@pytest.mark.slow
def test_a_port_that_is_taken_is_named(viewer, vision):
    """Only this finds a page's process that fails unheard."""
    port = int(viewer.address.rstrip("/").rsplit(":", 1)[1])
    with pytest.raises(RobocupVisionError, match=f"port {port}"):
        Viewer(vision, port=port)
    with pytest.raises(ArgumentError, match="port must be"):
        Viewer(vision, port=99999)


def test_the_loop_goes_on_when_the_page_process_is_killed(started, vision, frames, capfd):
    viewer = Viewer(vision, port=0)
    view = vision.look(frames[0], t_s=0.0)
    viewer.show(frames[0], view)
    (process,) = started
    process.kill()
    process.wait(WAIT_S)
    for _ in range(20):
        viewer.show(frames[0], view)
    viewer.say("nobody hears this")
    viewer.close()
    assert "the robot goes on" in capfd.readouterr().err


@pytest.mark.slow
def test_the_page_process_ends_with_the_robot(started, vision):
    """Only this finds a page's process that outlives its robot."""
    viewer = Viewer(vision, port=0)
    (process,) = started
    viewer.close()
    assert process.returncode == 0
    viewer.close()
