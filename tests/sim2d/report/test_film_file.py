"""The film: as many pictures as were written, at their rate, like what was drawn, and of a limited size."""

import cv2
import numpy as np
import pytest

from field_models.errors import FrameError
from sim2d.report.video import FilmFile

SIZE = (320, 240)


def pictures(count):
    """Return a disc that moves over fine noise, which is what costs most."""
    rng = np.random.default_rng(1)
    drawn = []
    for index in range(count):
        picture = rng.integers(60, 110, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
        cv2.circle(picture, (40 + 6 * index, 120), 25, (30, 120, 240), -1)
        drawn.append(picture)
    return drawn


def written(path, drawn):
    film = FilmFile(path, 7.5, SIZE)
    assert film.problem == ""
    for picture in drawn:
        film.write(picture)
    film.close()
    return path


def test_what_is_written_is_read_again_in_time_and_comes_to_less_than_four_megabytes_a_minute(tmp_path):
    drawn = pictures(20)
    path = written(tmp_path / "film.webm", drawn)
    assert [one.name for one in tmp_path.iterdir()] == ["film.webm"]
    assert path.stat().st_size / len(drawn) * 7.5 * 60 < 4e6
    capture = cv2.VideoCapture(str(path))
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(7.5)
    assert int(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little") == b"VP80"
    for index, picture in enumerate(drawn):
        is_read, shown = capture.read()
        assert is_read
        # webm counts milliseconds
        assert capture.get(cv2.CAP_PROP_POS_MSEC) == pytest.approx(1000 * index / 7.5, abs=0.6)
        # the disc is where it was drawn
        assert cv2.PSNR(cv2.blur(shown, (9, 9)), cv2.blur(picture, (9, 9))) > 22.0
    assert not capture.read()[0]


def test_a_film_without_pictures_leaves_no_other_file(tmp_path):
    written(tmp_path / "film.webm", [])
    assert {one.name for one in tmp_path.iterdir()} <= {"film.webm"}


def test_a_picture_of_another_size_is_refused(tmp_path):
    film = FilmFile(tmp_path / "film.webm", 7.5, SIZE)
    with pytest.raises(FrameError, match=r"a video picture must be \(320, 240\), got \(200, 240\)"):
        film.write(np.zeros((240, 200, 3), dtype=np.uint8))
    film.close()
