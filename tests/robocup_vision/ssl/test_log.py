"""Logs of the league's own programs are read to the last value and written again to the last byte."""

import gzip
import struct

import pytest

from field_models.errors import ArgumentError, FileError, PacketError
from robocup_vision.ssl.log import LogEntry, LogKind, SslLog, SslLogWriter, log_entry
from robocup_vision.ssl.protocol.mapping import encode
from robocup_vision.ssl.values.detection import DetectionFrame, VisionPacket
from robocup_vision.ssl.values.tracked import TrackedFrame, TrackerPacket

PACKET = VisionPacket(DetectionFrame(1, 2.0, 2.5, 3))


@pytest.mark.parametrize("name", ["referee.log.gz", "erforce_vision.log.gz"])
def test_a_log_written_again_from_its_values_is_the_same(recordings, tmp_path, name):
    with SslLog(recordings / name) as log, SslLogWriter(tmp_path / name) as out:
        for entry in log:
            out.write(log_entry(entry.received_ns, entry.value))
    ours, theirs = ((folder / name).read_bytes() for folder in (tmp_path, recordings))
    assert gzip.decompress(ours) == gzip.decompress(theirs)


@pytest.mark.parametrize("name", ["plain.log", "small.log.gz"])
@pytest.mark.parametrize("index", [False, True])
def test_places_lead_to_every_entry(tmp_path, name, index):
    entries = [log_entry(10, PACKET), LogEntry(20, LogKind.BLANK, b"?"), LogEntry(30, 99, b""), log_entry(40, PACKET)]
    with SslLogWriter(tmp_path / name, index=index) as out:
        for entry in entries:
            out.write(entry)
    with SslLog(tmp_path / name) as log:
        assert [log.entry_at(place) for place in log.places] == entries
        read = list(log)
        assert read[:4] == entries == list(log)[:4]
        assert [entry.kind for entry in read[4:]] == [LogKind.INDEX] * index
        assert all(entry.value is None for entry in read[4:])
        with pytest.raises(FileError, match="no entry at byte 3"):
            log.entry_at(3)


def test_an_index_is_laid_out_as_the_leagues_tools_do(tmp_path):
    with SslLogWriter(tmp_path / "a.log", index=True) as out:
        out.write(LogEntry(5, LogKind.BLANK, b"abc"))
        with pytest.raises(ArgumentError, match="an index is not copied"):
            out.write(LogEntry(5, LogKind.INDEX, b""))
    data = (tmp_path / "a.log").read_bytes()
    assert data[:16] == b"SSL_LOG_FILE\0\0\0\1"
    assert data[16:35] == struct.pack(">qii", 5, 0, 3) + b"abc"
    assert data[35:] == struct.pack(">qiiqq", 0, 6, 23, 16, 39) + b"INDEXED"


def test_the_same_entries_give_the_same_compressed_bytes(tmp_path):
    for name in ("a.log.gz", "b.log.gz"):
        with SslLogWriter(tmp_path / name) as out:
            out.write(log_entry(1, PACKET))
    assert (tmp_path / "a.log.gz").read_bytes() == (tmp_path / "b.log.gz").read_bytes()


def test_an_entry_of_unknown_kind_is_what_its_bytes_fit():
    tracker = TrackerPacket("a", "b", TrackedFrame(1, 2.0))
    assert LogEntry(0, LogKind.UNKNOWN, encode(PACKET)).value == PACKET
    assert LogEntry(0, LogKind.UNKNOWN, encode(tracker)).value == tracker
    assert LogEntry(0, LogKind.VISION_2010, encode(PACKET)).value is None
    with pytest.raises(PacketError, match="neither a vision packet"):
        _ = LogEntry(0, LogKind.UNKNOWN, b"").value
    with pytest.raises(PacketError, match="no log entry of kind 99"):
        _ = LogEntry(0, 99, b"").value
    with pytest.raises(PacketError, match=r"are no referee\.Referee"):
        _ = LogEntry(0, LogKind.REFEREE, b"\xff\xff").value


HEAD = b"SSL_LOG_FILE\0\0\0\1"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "no log of the small-size league"),
        (b"SSL_LOG_FILF\0\0\0\1", "no log of the small-size league"),
        (b"SSL_LOG_FILE\0\0\0\2", "key 'version': must be of version 1, got 2"),
        (HEAD + b"123", "ends within the head of the entry at byte 16"),
        (HEAD + struct.pack(">qii", 1, 4, -5), "damaged at byte 16: an entry's size, got -5"),
        (HEAD + struct.pack(">qii", 1, 4, 5) + b"abc", "byte 16: 3 of 5 bytes are there"),
    ],
)
@pytest.mark.parametrize("name", ["bad.log", "bad.log.gz"])
def test_a_damaged_log_is_refused_with_the_reason(tmp_path, name, data, words):
    (tmp_path / name).write_bytes(gzip.compress(data) if name.endswith("gz") else data)
    with pytest.raises(FileError, match=words) as caught, SslLog(tmp_path / name) as log:
        list(log)
    assert str(caught.value).startswith(str(tmp_path / name))


@pytest.mark.parametrize("name", ["a.log", "a.log.gz"])
def test_whole_entries_of_a_cut_log_are_read_first(tmp_path, name):
    with SslLogWriter(tmp_path / name) as out:
        for _ in range(50):
            out.write(log_entry(1, PACKET))
    data = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(data[: len(data) - 12])
    with SslLog(tmp_path / name) as log:
        entries = iter(log)
        # a compressed one loses what its last bytes hold
        for _ in range(20 if name.endswith("gz") else 49):
            assert next(entries).value == PACKET
        with pytest.raises(FileError, match=r"ends within the entry|cannot be read beyond byte"):
            list(entries)


def test_a_damaged_index_is_reported(tmp_path):
    with SslLogWriter(tmp_path / "a.log", index=True) as out:
        out.write(log_entry(1, PACKET))
    data = (tmp_path / "a.log").read_bytes()
    (tmp_path / "a.log").write_bytes(data[:-15] + struct.pack(">q", 5000) + data[-7:])
    with SslLog(tmp_path / "a.log") as log, pytest.raises(FileError, match="has a damaged index"):
        _ = log.places


def test_files_that_are_not_there_or_cannot_be_written(tmp_path):
    with pytest.raises(FileError, match="cannot be read"):
        SslLog(tmp_path / "none.log")
    with pytest.raises(FileError, match="cannot be written"):
        SslLogWriter(tmp_path / "no" / "folder.log")
