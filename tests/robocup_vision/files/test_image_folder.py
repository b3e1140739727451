"""Images named on a command line: files, folders, datasets; read when asked for, refused by name."""

import cv2
import numpy as np
import pytest

from field_models.errors import FileError, FrameError
from robocup_vision.files.image_folder import ImageFiles


@pytest.fixture
def folder(tmp_path):
    for i, name in enumerate(["b.png", "a.png", "c.jpg"]):
        cv2.imwrite(str(tmp_path / name), np.full((20, 30, 3), 50 * i, dtype=np.uint8))
    (tmp_path / "notes.txt").write_text("none of them")
    return tmp_path


def test_a_folder_gives_its_images_by_name(folder):
    images = ImageFiles([folder])
    assert images.names == ["a.png", "b.png", "c.jpg"]
    assert len(images) == 3
    assert images.size_px == (30, 20)
    assert images[0][0, 0, 0] == 50
    assert [frame[0, 0, 0] for frame in images[:2]] == [50, 0]


def test_files_and_folders_in_the_order_given(folder):
    assert ImageFiles([folder / "c.jpg", folder]).names == ["c.jpg", "a.png", "b.png", "c.jpg"]


def test_a_dataset_gives_its_images(folder):
    (folder / "images").mkdir()
    (folder / "dataset.toml").write_text("format = 1\n")
    cv2.imwrite(str(folder / "images" / "z.png"), np.zeros((20, 30, 3), dtype=np.uint8))
    cv2.imwrite(str(folder / "images" / "mask.png"), np.zeros((20, 30, 3), dtype=np.uint8))
    assert ImageFiles([folder]).names == ["z.png"]


def test_what_cannot_be_read_is_named(folder, tmp_path):
    with pytest.raises(FileError, match="absent: does not exist"):
        ImageFiles([folder / "absent"])
    with pytest.raises(FileError, match="is no image file"):
        ImageFiles([folder / "notes.txt"])
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(FileError, match="no images found"):
        ImageFiles([empty])
    (empty / "x.png").write_bytes(b"nothing")
    with pytest.raises(FrameError, match=r"x\.png: is not a PNG"):
        ImageFiles([empty])
    with pytest.raises(FrameError, match=r"x\.png"):
        ImageFiles([empty], (30, 20))[0]
