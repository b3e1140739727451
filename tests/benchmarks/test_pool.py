"""The pool of the benchmarks: the same results for all workers, which stay for several rounds."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.harness import pool as pools
from benchmarks.harness.pool import Pool, add_pool_options
from robocup_vision.workers import this_process

ROOT = Path(__file__).parents[2]


def double(piece: int) -> int:
    return 2 * piece


def test_workers_stay_for_several_rounds():
    opened = []

    @contextmanager
    def open_one(start):
        opened.append(True)
        with this_process().open_pool(start) as pool:
            yield pool

    with ExitStack() as stack:
        pool = Pool(replace(this_process(), open_pool=open_one), stack)
        for _ in range(3):
            assert list(pool.map(double, range(20), chunksize=3)) == [2 * piece for piece in range(20)]
        assert list(pool.map(lambda piece: piece + 1, iter([1, 2]))) == [2, 3]
    assert opened == [True]


def test_options_of_a_pool(monkeypatch):
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    add_pool_options(parser)
    asked = []
    monkeypatch.setattr(pools, "find_workers", lambda jobs, dask: asked.append((jobs, dask)) or this_process())
    for given in ([], ["--quick"], ["--quick", "--jobs", "3"], ["--quick", "--dask", "tcp://host:8786"]):
        with pools.open_pool(parser.parse_args(given)) as pool:
            assert list(pool.map(double, [1])) == [2]
    assert asked == [(os.cpu_count(), None), (1, None), (3, None), (1, "tcp://host:8786")]


@pytest.mark.slow
def test_a_benchmark_runs_on_a_cluster(tmp_path):
    """Only this finds a benchmark whose pieces cannot be sent elsewhere, or whose figures depend on who counts."""
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    program = [sys.executable, "benchmarks/planning/gaze_refinement.py", "--quick"]
    tables = []
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, silence_logs=50, local_directory=tmp_path
    ) as cluster:
        for where in (["--dask", cluster.scheduler_address], ["--jobs", "1"]):
            run = subprocess.run(
                [*program, *where, "--json", str(tmp_path / "figures.json")], cwd=ROOT, capture_output=True, text=True
            )
            assert run.returncode == 0, run.stderr
            tables.append(run.stdout.splitlines()[2:-1])
    assert len(tables[0]) > 3
    assert tables[0] == tables[1]
