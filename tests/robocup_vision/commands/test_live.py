"""`robocup-vision live`: it serves, ends when told to, records, and names what is wrong in one line."""

import shutil
from pathlib import Path

import pytest

from robocup_vision import cli
from robocup_vision.live.handover import page_settings
from robocup_vision.recording.recording import Recording

DATASET = Path(__file__).parents[3] / "images" / "omni_ssl_2001"


@pytest.mark.slow
def test_it_serves_a_dataset_for_some_seconds_to_foxglove_too_and_records(images, tmp_path, capfd, monkeypatch):
    """Only this finds a page, a server for Foxglove or a recording that the command does not start or end."""
    path, shown = tmp_path / "run.mcap", []
    monkeypatch.setattr("robocup_vision.foxglove.server.FoxgloveServer.show", lambda self, *now: shown.append(now))
    arguments = ["live", str(images), "--port", "0", "--seconds", "1.5", "--record", str(path), "--foxglove", "0"]
    assert cli.main([*arguments, "--out", str(tmp_path)]) == 0
    out, err = capfd.readouterr()
    assert "live at http://127.0.0.1:" in out
    assert "Foxglove: ws://127.0.0.1:" in out
    assert shown
    assert f"robocup-vision live: recording to {path}" in err
    assert list(Recording(path).frames())


@pytest.fixture
def images(tmp_path):
    folder = tmp_path / "dataset"
    shutil.copytree(DATASET, folder)
    return folder


def test_without_the_extra_it_says_what_to_install(monkeypatch, refused):
    find = page_settings.find_spec
    monkeypatch.setattr(page_settings, "find_spec", lambda name: None if name == "uvicorn" else find(name))
    line = "robocup-vision live: the page needs uvicorn: pip install 'robocup-vision[live]'\n"
    assert refused("live", "sim:ssl_2001", "--port", "0") == line
