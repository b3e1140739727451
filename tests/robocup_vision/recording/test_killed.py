"""A recorder that is killed at any moment leaves a file that reads to within its last second."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from robocup_vision.recording import Recording

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
        recorder.add_look(views[number % 24], frames[number % 24].frame, t_s)
        sys.stdout.write(f"{os.getpid()} {t_s}\\n"); sys.stdout.flush()
        time.sleep(1 / 30)
    os._exit(0)
"""


@pytest.mark.slow
def test_killed_recordings_read_to_their_last_second(tmp_path: Path) -> None:
    """Only this finds a recording that keeps more than a second in memory."""
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    seconds = np.random.default_rng(7).uniform(1.2, 3.0, 4).tolist()
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
