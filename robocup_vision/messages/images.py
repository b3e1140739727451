"""Converts camera frames to ROS images, and back: raw in any encoding that names its channels, or compressed."""

from __future__ import annotations

from typing import Any, Literal

import cv2
import numpy as np

from field_models.errors import FrameError
from robocup_vision.arrays import UInt8Array
from robocup_vision.files.images import opaque_bgr
from robocup_vision.messages.types import header, make

IMAGE_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
ImageFormat = Literal["raw", "png", "jpeg"]
_JPEG_BEGIN, _JPEG_END = b"\xff\xd8", b"\xff\xd9"
IMAGE_FORMATS: tuple[ImageFormat, ...] = ("raw", "png", "jpeg")

# by encoding: bytes per pixel, and OpenCV's conversion to BGR (None: it is BGR)
_ENCODINGS: dict[str, tuple[int, int | None]] = {
    "bgr8": (3, None),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "yuv422": (2, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUY2),
    "yuyv": (2, cv2.COLOR_YUV2BGR_YUY2),
    # ROS names a Bayer pattern by its first pixels, OpenCV by the second and third pixel of the second row
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2BGR),
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2BGR),
}


def image_message(frame: UInt8Array, t_s: float, frame_id: str, image_format: ImageFormat = "raw") -> Any:
    """Return a frame as sensor_msgs/Image, or as CompressedImage.

    Parameters
    ----------
    frame_id : str
        Name of the camera's optical frame.
    image_format : {"raw", "png", "jpeg"}
        "png" is also lossless, but takes tens of milliseconds; "jpeg" is lossy, and a tenth as large.
    """
    if image_format == "raw":
        height, width = frame.shape[:2]
        data = np.ascontiguousarray(frame).reshape(-1)
        return make("sensor_msgs/msg/Image", header(t_s, frame_id), height, width, "bgr8", 0, 3 * width, data)
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1] if image_format == "png" else [cv2.IMWRITE_JPEG_QUALITY, 90]
    done, data = cv2.imencode(f".{image_format}", frame, options)
    if not done:
        raise FrameError(f"a frame of shape {frame.shape} cannot be written as {image_format}")
    return make("sensor_msgs/msg/CompressedImage", header(t_s, frame_id), image_format, data.reshape(-1))


def frame_of(message: Any) -> UInt8Array:
    """Return the frame, (H, W, 3) uint8 BGR, in an Image or CompressedImage.

    Raises
    ------
    FrameError
        If the encoding does not name its channels or is not 8-bit colour, or the data does not match the size.
    """
    if message.__msgtype__ == "sensor_msgs/msg/CompressedImage":
        return _decompress(message)
    name = message.encoding.lower()
    if name not in _ENCODINGS:
        raise FrameError(
            f"image encoding {message.encoding!r} cannot be read: it must name its channels, be in colour and of 8 bits"
            f" ({', '.join(_ENCODINGS)})"
        )
    channels, conversion = _ENCODINGS[name]
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.asarray(message.data, dtype=np.uint8)
    if step < channels * width or data.size < step * height or not height or not width:
        raise FrameError(
            f"an image of {width}x{height} in {message.encoding} needs {channels * width} bytes a row,"
            f" got step {step} and {data.size} bytes"
        )
    rows = data[: step * height].reshape(height, step)[:, : channels * width]
    pixels = rows.reshape(height, width, channels) if channels > 1 else rows
    if conversion is None:
        return np.ascontiguousarray(pixels)
    try:
        return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), conversion), dtype=np.uint8)
    except cv2.error:
        raise FrameError(f"an image of {width}x{height} cannot be converted from {message.encoding}") from None


def is_rgb_inside(text: str) -> bool:
    """Whether a CompressedImage's format says that red and blue are exchanged in the compressed data.

    "rgb8; jpeg compressed rgb8": RGB pixels were passed to a codec that expects BGR, as image_transport interprets it.
    """
    return "compressed rgb" in text.lower()


def _decompress(message: Any) -> UInt8Array:
    data = np.asarray(message.data, dtype=np.uint8)
    image = None
    if data.size:
        try:
            image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
        except cv2.error:
            image = None
    name = f"a compressed image of format {message.format!r}"
    if image is None:
        raise FrameError(f"{name} cannot be decoded ({data.size} bytes)")
    if data[:2].tobytes() == _JPEG_BEGIN and _JPEG_END not in data.tobytes():
        raise FrameError(f"{name} is cut off: its end is missing ({data.size} bytes)")
    image = opaque_bgr(image, name)  # type: ignore[arg-type]
    return np.ascontiguousarray(image[..., ::-1]) if is_rgb_inside(message.format) else image
