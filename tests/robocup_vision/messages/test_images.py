"""Frames as ROS images: every encoding that names its channels comes back as BGR, others are refused by name."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from field_models.errors import FrameError
from robocup_vision.arrays import UInt8Array
from robocup_vision.messages.images import frame_of, image_message
from robocup_vision.messages.types import decode, encode, header, make


def _frame() -> UInt8Array:
    v, u = np.mgrid[:24, :32]
    return np.stack([4 * u, 5 * v, 120 + 2 * u - v], axis=-1).astype(np.uint8)


def _image(encoding: str, data: UInt8Array, width: int, height: int, step: int):  # type: ignore[no-untyped-def]
    flat = np.ascontiguousarray(data).reshape(-1)
    return make("sensor_msgs/msg/Image", header(1.0, "camera"), height, width, encoding, 0, step, flat)


@pytest.mark.parametrize("image_format", ["raw", "png"])
def test_a_frame_comes_back_in_every_bit(image_format: str) -> None:
    message = image_message(_frame(), 1.5, "camera", image_format)  # type: ignore[arg-type]
    again = decode(encode(message), message.__msgtype__)
    assert np.array_equal(frame_of(again), _frame())


def test_jpeg_comes_back_nearly() -> None:
    got = frame_of(image_message(_frame(), 1.5, "camera", "jpeg"))
    assert np.abs(got.astype(int) - _frame()).mean() < 4


@pytest.mark.parametrize(
    ("encoding", "code"), [("rgb8", cv2.COLOR_BGR2RGB), ("bgra8", cv2.COLOR_BGR2BGRA), ("rgba8", cv2.COLOR_BGR2RGBA)]
)
def test_other_orders_of_channels(encoding: str, code: int) -> None:
    data = np.asarray(cv2.cvtColor(_frame(), code), dtype=np.uint8)
    message = _image(encoding, data, 32, 24, 32 * data.shape[2])
    assert np.array_equal(frame_of(message), _frame())


def test_rows_may_be_padded() -> None:
    padded = np.zeros((24, 100), dtype=np.uint8)
    padded[:, :96] = _frame().reshape(24, 96)
    assert np.array_equal(frame_of(_image("bgr8", padded, 32, 24, 100)), _frame())


@pytest.mark.parametrize(("encoding", "first"), [("yuv422", 1), ("uyvy", 1), ("yuv422_yuy2", 0), ("yuyv", 0)])
def test_yuv_has_its_brightness_where_its_name_says(encoding: str, first: int) -> None:
    data = np.full((24, 32, 2), 128, dtype=np.uint8)
    data[..., first] = np.arange(32) * 6 + 16
    grey = frame_of(_image(encoding, data, 32, 24, 64))
    assert (np.diff(grey[5, :, 1].astype(int)) > 0).all()
    assert np.abs(grey[..., 0].astype(int) - grey[..., 2]).max() <= 2


@pytest.mark.parametrize(("encoding", "red_at"), [("bayer_rggb8", (0, 0)), ("bayer_bggr8", (1, 1))])
def test_a_bayer_pattern_shows_red_where_its_name_says(encoding: str, red_at: tuple[int, int]) -> None:
    data = np.zeros((24, 32), dtype=np.uint8)
    data[red_at[0] :: 2, red_at[1] :: 2] = 200
    frame = frame_of(_image(encoding, data, 32, 24, 32))
    assert frame[4:-4, 4:-4, 2].mean() > 150
    assert frame[4:-4, 4:-4, 0].mean() < 20


@pytest.mark.parametrize("encoding", ["8UC3", "mono8", "bgr16", "32FC1", "", "nv21"])
def test_an_encoding_that_does_not_name_colour_channels_of_8_bits_is_refused(encoding: str) -> None:
    with pytest.raises(FrameError, match=f"image encoding '{encoding}' cannot be read"):
        frame_of(_image(encoding, _frame(), 32, 24, 96))


def test_an_image_with_too_little_data_is_refused() -> None:
    with pytest.raises(FrameError, match="needs 96 bytes a row, got step 90"):
        frame_of(_image("bgr8", _frame(), 32, 24, 90))
    with pytest.raises(FrameError, match="needs 96 bytes a row"):
        frame_of(_image("bgr8", _frame()[:10], 32, 24, 96))
    with pytest.raises(FrameError, match="of 0x0"):
        frame_of(_image("bgr8", _frame()[:0], 0, 0, 0))


def test_a_compressed_image_that_is_none_is_refused() -> None:
    for data in (b"", b"\xff\xd8nothing"):
        array = np.frombuffer(data, dtype=np.uint8)
        with pytest.raises(FrameError, match="cannot be decoded"):
            frame_of(make("sensor_msgs/msg/CompressedImage", header(1.0, "camera"), "jpeg", array))
    grey = cv2.imencode(".png", _frame()[..., 0])[1].reshape(-1)
    with pytest.raises(FrameError, match="must be in colour"):
        frame_of(make("sensor_msgs/msg/CompressedImage", header(1.0, "camera"), "png", grey))
