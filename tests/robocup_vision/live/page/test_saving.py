"""One frame as a dataset: it is looked at again as it was."""

from dataclasses import replace

import numpy as np
import pytest

from field_models.errors import ArgumentError, FileError
from robocup_vision import Pose2
from robocup_vision.evaluation.dataset import load_dataset
from robocup_vision.live.handover.page_settings import FeedSettings
from robocup_vision.live.page.feed import Feed
from robocup_vision.live.page.saving import save_from, save_moment


def test_a_saved_moment_is_a_dataset(setup, moment, tmp_path):
    shown = replace(moment(3.25), truth=Pose2(0.1, -0.2, 0.3))
    folder = save_moment(tmp_path / "out", setup, shown)
    dataset = load_dataset(folder)
    assert np.array_equal(dataset.read_frame(0), shown.frame)
    assert dataset.field.name == "ssl_2001"
    assert dataset.camera.center_px == setup.camera.center_px
    assert dataset.colors is not None
    assert dataset.method == "field"
    assert dataset.times["000000.png"].t_s == 3.25
    assert dataset.truth["000000.png"].theta_rad == 0.3
    assert save_moment(tmp_path / "out", setup, shown) != folder


def test_what_a_dataset_cannot_say_is_refused(setup, moment, tmp_path):
    with pytest.raises(ArgumentError, match="needs a camera file"):
        save_moment(tmp_path, replace(setup, camera=None), moment())
    own = replace(setup, field=replace(setup.field, name="my_field"))
    with pytest.raises(ArgumentError, match="'my_field' is no built-in one"):
        save_moment(tmp_path, own, moment())
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot be written"):
        save_moment(tmp_path / "file", setup, moment())


def said(feed):
    import time

    deadline = time.monotonic() + 20.0
    while not feed.status[1]["lines"] and time.monotonic() < deadline:
        time.sleep(0.01)
    return feed.status[1]["lines"][-1]


def test_a_picture_that_is_shown_is_saved_without_loss_while_its_frame_is_kept(setup, moment, tmp_path):
    feed = Feed()
    feed.set_robots((setup,))
    feed.put(moment(1.0))
    assert feed.wait_until_made(20.0)
    save_from(feed, "robot", 1, tmp_path)
    assert "saved" in said(feed)
    assert "JPEG" not in said(feed)
    assert np.array_equal(load_dataset(tmp_path / "frame_000").read_frame(0), feed.raw("robot", 1).frame)
    with pytest.raises(ArgumentError, match="not kept any more"):
        save_from(feed, "robot", 9, tmp_path)
    feed.close()


def test_an_older_picture_is_saved_from_its_jpeg_and_that_is_said(setup, moment, tmp_path):
    feed = Feed(FeedSettings(max_raw_bytes=1))
    feed.set_robots((setup,))
    for t_s in (0.0, 1.0):
        feed.put(moment(t_s))
        assert feed.wait_until_made(20.0)
    save_from(feed, "robot", 1, tmp_path)
    assert "from the JPEG" in said(feed)
    dataset = load_dataset(tmp_path / "frame_000")
    assert dataset.times["000000.png"].t_s == 0.0
    feed.close()
