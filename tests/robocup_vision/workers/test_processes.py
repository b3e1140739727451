"""Processes of this machine: nobody is left when the one that hands out the work is killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

BUSY = """
import os, time
from robocup_vision.workers import worker_processes

def work(seconds):
    # one write for each line: print may make two (PYTHONUNBUFFERED), between which the other worker's may come
    os.write(1, b"%d\\n" % os.getpid())
    time.sleep(seconds)

if __name__ == "__main__":
    with worker_processes(2) as executor:
        for seconds in (60, 60, 60):
            executor.submit(work, seconds)
"""


def is_there(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    # one that has ended and that nobody has asked about is there still
    status = Path(f"/proc/{pid}/stat")
    return not status.exists() or ") Z " not in status.read_text()


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs signals")
def test_workers_end_when_their_parent_is_killed(tmp_path):
    program = tmp_path / "busy.py"
    program.write_text(BUSY)
    with subprocess.Popen([sys.executable, str(program)], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        workers = [int(parent.stdout.readline()) for _ in range(2)]
        assert all(map(is_there, workers))
        parent.send_signal(signal.SIGKILL)
        parent.wait()
        left_s = time.monotonic() + 30.0
        while any(map(is_there, workers)) and time.monotonic() < left_s:
            time.sleep(0.05)
        left = [pid for pid in workers if is_there(pid)]
        for pid in left:
            os.kill(pid, signal.SIGKILL)
        assert not left


UNGUARDED = """
import operator
from robocup_vision.workers import worker_processes

with worker_processes(2) as executor:
    print(sorted(executor.map(operator.neg, (1, 2, 3))), flush=True)
"""
OWN_FUNCTION = """
from robocup_vision.workers import worker_processes

def work(number):
    return -number

with worker_processes(1) as executor:
    print(executor.submit(work, 1).exception(), flush=True)
"""


def test_a_script_without_a_guard_works_where_nothing_of_it_is_needed(tmp_path):
    (tmp_path / "script.py").write_text(UNGUARDED)
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("[-3, -2, -1]\n", "")


def test_a_script_whose_functions_are_needed_is_told_of_its_guard(tmp_path):
    (tmp_path / "script.py").write_text(OWN_FUNCTION)
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.stderr.splitlines()[0].startswith("a script whose own functions work in several processes must start")
    assert "Traceback" not in done.stderr
