"""The command log: foreign logs told and converted as they are, ours scored against the truth in them."""

import gzip
import re
import sys
import time
from pathlib import Path

import pytest

from benchmarks.worlds.damaged_messages import REFEREE
from field_models import load_field
from robocup_vision.cli import main
from robocup_vision.ssl.log import LogEntry, LogKind, SslLog, SslLogWriter, log_entry
from robocup_vision.ssl.log_score import score_log
from robocup_vision.ssl.protocol.mapping import encode
from robocup_vision.ssl.values import simulation as sim
from sim2d.network.league import Channel, LeagueSimulator
from sim2d.network.realism import REALISMS

RECORDINGS = Path(__file__).resolve().parents[4] / "shared" / "ssl"
needs_recordings = pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the league's recordings are not here")
KINDS = {Channel.VISION: LogKind.VISION, Channel.TRACKER: LogKind.TRACKER, Channel.REFEREE: LogKind.REFEREE}


@pytest.fixture(scope="module")
def ours(tmp_path_factory):
    """Return the path of a log of our simulator: a robot drives past a ball that is kicked, with realism."""
    made = LeagueSimulator(load_field("ssl_division_b"), 3, REALISMS["rc2021"], 4, time.time())
    path = tmp_path_factory.mktemp("log") / "ours.log.gz"
    move = sim.MoveCommand(world=sim.GlobalVelocity(0.8, 0.3, 1.0))
    kicked = sim.SimulatorCommand(sim.SimulatorControl(sim.TeleportBall(vx_mps=2.0, vy_mps=1.0)))
    with SslLogWriter(path) as log:
        for step in range(900):
            if step == 300:
                made.answer_control(encode(kicked))
            if step % 20 == 0:
                made.answer_robots(sim.Team.YELLOW, encode(sim.RobotControl((sim.RobotCommand(1, move),))))
            for channel, data in made.step():
                log.write(LogEntry(round(1e9 * (made.epoch_s + made.world.t_s)), KINDS[channel], data))
    return path


def run(capsys, *arguments):
    status = main(["log", *map(str, arguments)])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@needs_recordings
def test_foreign_logs_are_reported(capsys):
    status, out, _ = run(capsys, "info", RECORDINGS / "referee.log.gz")
    assert status == 0
    assert "636 referee" in out
    assert "HALT, STOP, PREPARE_KICKOFF_YELLOW, NORMAL_START" in out
    status, out, _ = run(capsys, "info", RECORDINGS / "erforce_vision.log.gz")
    assert "264 vision" in out
    assert "264 packets, field 9 m x 6 m" in out


@needs_recordings
@pytest.mark.parametrize(("name", "table"), [("referee", "referee"), ("erforce_vision", "detections")])
def test_foreign_logs_are_converted_to_exactly_their_tables(capsys, tmp_path, name, table):
    status, out, _ = run(capsys, "convert", RECORDINGS / f"{name}.log.gz", "--out", tmp_path)
    assert status == 0
    assert re.fullmatch(rf"{tmp_path}/{table}.csv: \d+ rows\n", out)
    assert [path.name for path in tmp_path.iterdir()] == [f"{table}.csv"]
    given = gzip.decompress((RECORDINGS / f"{name}.csv.gz").read_bytes())
    assert (tmp_path / f"{table}.csv").read_bytes() == given.replace(b"\r\n", b"\n")


def test_our_log_is_reported_converted_and_scored(capsys, tmp_path, ours):
    status, out, _ = run(capsys, "info", ours)
    assert status == 0
    for words in ("camera 3", "tracker sim2d", "FORCE_START", "field 9 m x 6 m"):
        assert words in out
    status, out, _ = run(capsys, "convert", ours, "--out", tmp_path)
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["detections.csv", "referee.csv", "tracked.csv"]
    status, out, _ = run(capsys, "score", ours)
    assert status == 0
    assert "frames of sim2d" in out
    with SslLog(ours) as log:
        score = score_log(log)
    assert score.robot_rms_m < 0.6 * score.robot_last_rms_m
    assert score.robot_velocity_rms_mps < 0.08
    assert score.ball_rms_m < score.ball_last_rms_m
    assert score.ball_refound_s is None or score.ball_refound_s < 0.2


def test_what_is_wrong_with_a_log_is_reported(capsys, tmp_path):
    path = tmp_path / "odd.log"
    with SslLogWriter(path) as log:
        log.write(log_entry(5, REFEREE))
        log.write(LogEntry(6, LogKind.VISION, b"\xff"))
        log.write(LogEntry(7, 42, b""))
    status, out, _ = run(capsys, "info", path)
    assert status == 0
    assert "1 kind_42" in out
    assert "2 entries, the first is entry 1: 1 bytes are no vision" in out
    status, out, error = run(capsys, "convert", path, "--out", tmp_path / "x")
    assert status == 0
    assert "referee.csv: 1 rows" in out
    assert f"{path}: 2 unreadable entries left out, the first is entry 1: 1 bytes are no vision" in error
    path.write_bytes(path.read_bytes()[:-3])
    status, out, error = run(capsys, "info", path)
    assert status == 2
    assert "1 referee" in out
    assert "ends within the head of the entry" in error
    assert run(capsys, "info", tmp_path / "none.log")[0] == 2


def test_a_log_that_cannot_be_scored_says_why(capsys, tmp_path):
    path = tmp_path / "a.log"
    with SslLogWriter(path) as log:
        log.write(log_entry(5, REFEREE))
    assert "no tracker packets to score against" in run(capsys, "score", path)[2]
    with SslLogWriter(path):
        pass
    assert "nothing in it" in run(capsys, "convert", path, "--out", tmp_path / "t")[1]


def test_an_mcap_file_holds_the_same_datagrams_and_what_reads_them(ours, tmp_path, capsys):
    reader = pytest.importorskip("mcap.reader")
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    status, out, _ = run(capsys, "convert", ours, "--to=mcap", "--out", tmp_path)
    assert status == 0
    path = tmp_path / "ours.mcap"
    assert str(path) in out
    kinds = {"/vision": LogKind.VISION, "/tracker": LogKind.TRACKER, "/referee": LogKind.REFEREE}
    with SslLog(ours) as log:
        entries = [(entry.kind, entry.received_ns, entry.data) for entry in log]
    with path.open("rb") as file:
        found = list(reader.make_reader(file).iter_messages())
    told = [(kinds[channel.topic], message.log_time, message.data) for _, channel, message in found]
    assert sorted(told) == sorted(entries)
    # a viewer knows nothing but the file
    schema, _, message = next(one for one in found if one[1].topic == "/tracker")
    pool = descriptor_pool.DescriptorPool()
    for definition in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(definition)
    read = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name)).FromString(message.data)
    assert read.source_name == "sim2d"
    assert len(read.tracked_frame.robots) == 6


def test_without_mcap_one_line_says_what_to_install(ours, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    status, _, err = run(capsys, "convert", ours, "--to=mcap", "--out", tmp_path)
    assert status == 2
    assert "MCAP files need mcap, which is not installed" in err
