"""Programs of other people, in an environment of their own, read what the simulator sends and what we write."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.ssl.log import LogEntry, LogKind, SslLogWriter
from sim2d.network.league import Channel, LeagueSimulator
from sim2d.network.realism import REALISMS

pytestmark = pytest.mark.slow

PACKAGES = ("sslclient==1.1.2", "rc-ssl-logtools==0.0.4")
SESSION = Path(__file__).with_name("foreign_session.py")
# prints of each frame its time, its number, the robots by team and number, the ball
SSLCLIENT = """
import json, socket
from google.protobuf.json_format import MessageToDict
socket.gethostname = lambda: "localhost"
import sslclient
client = sslclient.client()
client.connect()
shown = 0
while shown < 130:
    packet = MessageToDict(client.receive())
    if "detection" in packet:
        frame = packet["detection"]
        robots = [[team, r["robotId"], r["x"], r["y"], r["orientation"]]
                  for team, key in ((1, "robotsYellow"), (2, "robotsBlue")) for r in frame[key]]
        ball = frame["balls"][0]
        print(json.dumps({"t": frame["tCapture"], "n": frame["frameNumber"], "robots": robots,
                          "ball": [ball["x"], ball["y"]]}), flush=True)
        shown += 1
"""
LOGTOOLS = """
import json, sys
from google.protobuf.json_format import MessageToDict
from rc_ssl_logtools import log_frames
for frame in log_frames(sys.argv[1]):
    print(json.dumps(MessageToDict(frame)))
"""


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """Return the interpreter of an environment with both packages."""
    folder = tmp_path_factory.mktemp("peers")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    python, quietly = folder / "bin" / "python", ["-q", "--disable-pip-version-check", "--no-compile"]
    done = subprocess.run(
        [sys.executable, "-m", "pip", "--python", python, "install", *quietly, *PACKAGES],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        pytest.skip(f"{' and '.join(PACKAGES)} cannot be installed here: {done.stderr.strip().splitlines()[-1]}")
    return python


@pytest.fixture
def namespace():
    """Return the words before a command that run it in a network namespace with a loopback alone."""
    setup = "ip link set lo up && ip route add 224.0.0.0/4 dev lo"
    words = ["unshare", "--net", "--map-root-user"]
    if not shutil.which("unshare") or not shutil.which("ip"):
        pytest.skip("there is no unshare or ip here")
    if subprocess.run([*words, "sh", "-c", setup], capture_output=True, check=False).returncode:
        pytest.skip("network namespaces are not allowed here")
    return [*words, "sh", "-c", f'{setup} && exec "$@"', "sh"]


def test_a_foreign_client_reads_a_hundred_frames_as_they_are(python, namespace, tmp_path):
    """Only this finds packets that others' programs read otherwise than ours."""
    done = subprocess.run(
        [*namespace, sys.executable, str(SESSION), str(python), SSLCLIENT],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=tmp_path,
        env=os.environ | {"PROTOCOL_BUFFERS_PYTHON_IMPLEMENTATION": "python"},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["frames"] >= 100
    assert found["consecutive"]
    assert found["things"] == 13 * found["frames"]
    assert found["wrong"] == 0


def test_a_foreign_tool_reads_our_vision_log(python, tmp_path):
    """Only this finds a log that others' programs read otherwise than ours."""
    simulator = LeagueSimulator(load_field("ssl_division_b"), 6, REALISMS["rc2021"], epoch_s=time.time())
    entries = [
        LogEntry(round(1e9 * simulator.world.t_s), LogKind.VISION, data)
        for _ in range(600)
        for channel, data in simulator.step()
        if channel is Channel.VISION
    ]
    path = tmp_path / "ours.log.gz"
    with SslLogWriter(path) as log:
        for entry in entries:
            log.write(entry)
    done = subprocess.run(
        [python, "-c", LOGTOOLS, str(path)],
        capture_output=True,
        text=True,
        timeout=120,
        env=os.environ | {"PROTOCOL_BUFFERS_PYTHON_IMPLEMENTATION": "python"},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    frames = [json.loads(line) for line in done.stdout.splitlines()]
    # it leaves out the last one
    assert len(frames) == len(entries) - 1
    for frame, entry in zip(frames, entries, strict=False):
        detection = entry.value.detection
        if detection is None:
            assert frame["geometry"]["field"]["fieldLength"] == 9000
            continue
        assert frame["detection"]["tCapture"] == detection.t_capture_s
        for theirs, ours in zip(frame["detection"].get("robotsYellow", []), detection.yellow, strict=True):
            assert theirs["robotId"] == ours.robot_id
            assert np.float32(theirs["x"]) == np.float32(1000 * ours.x_m)
            assert np.float32(theirs["orientation"]) == np.float32(ours.orientation_rad)
