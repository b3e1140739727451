"""A dask cluster: addresses that are none, and on a local one no piece lost with a worker that is killed."""

import csv
import os
import shutil
from pathlib import Path

import pytest

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision import cli
from robocup_vision.workers import dask_workers, in_order, places, run_pieces

distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
from robocup_vision.workers import cluster  # noqa: E402 - needs dask

pytestmark = pytest.mark.usefixtures("without_plots")
DATASET = Path(__file__).parents[3] / "images" / "omni_ssl_2001"


class Start:
    """Doubles each piece; the first worker to get 33 is killed."""

    def __init__(self, marker):
        self.marker = marker

    def __call__(self):  # noqa: D102
        def double(piece):
            if piece == 33 and not self.marker.exists():
                self.marker.touch()
                os._exit(1)
            return 2 * piece

        return double


def refusing():
    raise RobocupVisionError("no camera")


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Return the address of a cluster of two processes on loopback."""
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=2,
        dashboard_address=None,
        silence_logs=50,
        local_directory=tmp_path_factory.mktemp("cluster"),
    ) as running:
        yield running.scheduler_address


@pytest.mark.slow
def test_a_killed_workers_pieces_are_done_again(address, tmp_path):
    """Only this finds pieces that are lost with the machine that had them."""
    pieces = (piece for piece in range(100))
    done = list(in_order(run_pieces(Start(tmp_path / "killed"), pieces, dask_workers(address), batch=4)))
    assert done == [2 * piece for piece in range(100)]
    assert (tmp_path / "killed").exists()


@pytest.mark.slow
def test_what_a_worker_raises_is_one_line(address):
    """Only this finds an error from elsewhere that arrives as a traceback."""
    with pytest.raises(RobocupVisionError, match=r"^no camera$"):
        list(run_pieces(refusing, [1, 2], dask_workers(address)))


@pytest.mark.slow
def test_workers_of_another_version_are_refused(address, monkeypatch):
    """Only this finds results of another version among ours."""
    monkeypatch.setattr(cluster, "_version", lambda: "9.9")
    with pytest.raises(ArgumentError, match=r"worker tcp:.* has robocup-vision .*, this machine has 9\.9"):
        list(run_pieces(refusing, [1], dask_workers(address)))


@pytest.mark.slow
def test_a_cluster_that_stays_without_workers_is_told(monkeypatch):
    """Only this finds a command that waits for ever for workers."""
    monkeypatch.setattr(cluster, "_NO_WORKERS_S", 0.5)
    monkeypatch.setattr(cluster, "_COUNT_SLOTS_S", 0.1)
    monkeypatch.setattr("robocup_vision.workers.pieces._LOOK_AFTER_S", 0.2)
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=None, silence_logs=50) as running,
        pytest.raises(RobocupVisionError, match=r"the dask scheduler at 'tcp:.*' has had no workers for"),
    ):
        list(run_pieces(refusing, [1], dask_workers(running.scheduler_address)))


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("tcp://127.0.0.1:9", "Timed out"),
        ("what://is", "unknown address scheme 'what'"),
        ("localhost", "missing port number"),
        ("", "missing port number"),
    ],
)
def test_addresses_that_are_none_are_one_line(address, reason, monkeypatch):
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.1)
    with pytest.raises(ArgumentError) as told:
        dask_workers(address)
    assert str(told.value).startswith(f"no dask scheduler answers at '{address}' ({reason}")
    assert "\n" not in str(told.value)


def test_a_mistyped_address_costs_no_earlier_results(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.1)
    (tmp_path / "results.csv").write_text("of an earlier run")
    assert cli.main(["evaluate", str(DATASET), "--dask", "tcp://127.0.0.1:9", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err.startswith(
        "robocup-vision evaluate: no dask scheduler answers at 'tcp://127.0.0.1:9'"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["results.csv"]


def test_without_dask_it_is_one_line(monkeypatch):
    monkeypatch.setattr(places, "find_spec", lambda name: None)
    with pytest.raises(ArgumentError, match=r"dask\.distributed is not installed \(pip install"):
        dask_workers("tcp://127.0.0.1:9")


def but_for_times(out):
    with (out / "results.csv").open(newline="") as stream:
        return [{**row, "ms": ""} for row in csv.DictReader(stream)]


@pytest.mark.slow
@pytest.mark.parametrize(("how", "kills"), [([], True), (["--shared-folder"], False)])
def test_a_folder_is_scored_as_by_one_process(how, kills, address, tmp_path, monkeypatch):
    """Only this finds rows that depend on who scored them, or a folder that others cannot read."""
    data = tmp_path / "data"
    shutil.copytree(DATASET, data)
    (data / "images" / "0007.png").write_bytes(b"no image")
    assert cli.main(["evaluate", str(data), "--out", str(tmp_path / "one")]) == 2
    killed = not kills

    def kill_one(*_):
        nonlocal killed
        if not killed:
            killed = True
            with distributed.Client(address, set_as_default=False) as client:
                process = next(iter(client.run(os.getpid).values()))
            os.kill(process, 9)

    from robocup_vision.evaluation.result_files import RowsFile

    add = RowsFile.add
    monkeypatch.setattr(RowsFile, "add", lambda self, row: (add(self, row), kill_one()))
    assert cli.main(["evaluate", str(data), "--dask", address, *how, "--out", str(tmp_path / "many")]) == 2
    assert killed
    rows = but_for_times(tmp_path / "many")
    assert rows == but_for_times(tmp_path / "one")
    assert [row["image"] for row in rows] == sorted(path.name for path in (data / "images").iterdir())
    texts = [(tmp_path / out / "trajectory.tum").read_bytes() for out in ("one", "many")]
    assert texts[0] == texts[1]


@pytest.mark.slow
def test_a_folder_is_rendered_as_by_one_process(address, tmp_path):
    """Only this finds pictures whose painter cannot be sent elsewhere."""
    words = ["render-goal", "--count", "2", "--seed", "3", "--jpeg", "80"]
    assert cli.main([*words, str(tmp_path / "one")]) == 0
    assert cli.main([*words, "--dask", address, str(tmp_path / "many")]) == 0
    for path in (tmp_path / "one").rglob("*.*"):
        assert (tmp_path / "many" / path.relative_to(tmp_path / "one")).read_bytes() == path.read_bytes()


@pytest.mark.slow
def test_a_camera_is_calibrated_as_by_one_process(address, tmp_path):
    """Only this finds a calibration whose pieces cannot be sent elsewhere."""
    words = ["calibrate", "omni", str(DATASET / "images"), "--field", "ssl_2001", "--frames", "2", "--out"]
    assert cli.main([*words, str(tmp_path / "one.toml")]) == 0
    assert cli.main([*words, str(tmp_path / "many.toml"), "--dask", address]) == 0
    assert (tmp_path / "one.toml").read_bytes() == (tmp_path / "many.toml").read_bytes()
    assert not list(tmp_path.glob("*.jsonl"))
