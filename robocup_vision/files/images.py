"""Image files read strictly: what a decoder would quietly patch up (a missing half, a grey or 16-bit image) is refused.

OpenCV returns the part of a truncated PNG or JPEG that it could decode, with the rest grey or black; a localiser scored
on such an image would be scored on nothing. So the file's own structure is checked before it is decoded.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import FrameError
from robocup_vision.arrays import UInt8Array

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp")
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_JPEG_START = b"\xff\xd8"


def read_image(path: str | Path, size_px: tuple[int, int]) -> UInt8Array:
    """Read a colour image of exactly the given size.

    Parameters
    ----------
    path : str or Path
        A PNG, JPEG or BMP file.
    size_px : (int, int)
        Width and height it must have.

    Returns
    -------
    (H, W, 3) uint8
        BGR.

    Raises
    ------
    FrameError
        If the file is missing, damaged or truncated, not 8-bit colour, has an alpha channel or another size.
    """
    name = Path(path).name
    image = _decode(path)
    if image.dtype != np.uint8:
        raise FrameError(f"{name}: has {8 * image.itemsize} bits per channel, must have 8")
    if image.ndim == 2:
        raise FrameError(f"{name}: is a grey image, must be in colour")
    if image.shape[2] != 3:
        raise FrameError(f"{name}: has {image.shape[2]} channels (an alpha channel?), must have 3")
    height, width = image.shape[:2]
    if (width, height) != tuple(size_px):
        raise FrameError(f"{name}: is {width}x{height}, the camera file says {size_px[0]}x{size_px[1]}")
    return np.asarray(image, dtype=np.uint8)


def read_mask(path: str | Path) -> UInt8Array:
    """Read a mask as (H, W) uint8, 255 where any channel of the file is non-zero (an opaque alpha channel is not).

    Raises
    ------
    FrameError
        If the file is missing, damaged or truncated.
    """
    set_pixels = _decode(path) != 0
    if set_pixels.ndim == 3:
        set_pixels = np.any(set_pixels[..., :3], axis=2)
    return np.where(set_pixels, 255, 0).astype(np.uint8)


def _decode(path: str | Path) -> npt.NDArray[np.uint8] | npt.NDArray[np.uint16]:
    name = Path(path).name
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise FrameError(f"{name}: cannot be read ({error.strerror or error})") from None
    problem = _damage(data)
    if problem is not None:
        raise FrameError(f"{name}: {problem}")
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None:
        raise FrameError(f"{name}: is not an image that can be decoded")
    return image  # type: ignore[return-value]


def _damage(data: bytes) -> str | None:
    if not data:
        return "is empty"
    if data.startswith(_PNG_SIGNATURE):
        return _png_damage(data)
    if data.startswith(_JPEG_START):
        return _jpeg_damage(data)
    if data.startswith(b"BM"):
        return _bmp_damage(data)
    return "is neither a PNG, a JPEG nor a BMP file"


def _png_damage(data: bytes) -> str | None:
    at = len(_PNG_SIGNATURE)
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        kind = data[at + 4 : at + 8]
        end = at + 8 + length
        if end + 4 > len(data):
            break
        if zlib.crc32(data[at + 4 : end]) != struct.unpack_from(">I", data, end)[0]:
            return f"is a damaged PNG (chunk {kind.decode('latin-1')!r} fails its checksum)"
        if kind == b"IEND":
            return None
        at = end + 4
    return "is a truncated PNG (its end is missing)"


def _jpeg_damage(data: bytes) -> str | None:
    at = len(_JPEG_START)
    while at + 4 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
            continue
        at += 2 + struct.unpack_from(">H", data, at + 2)[0]
        # an embedded thumbnail has an end marker of its own, so only one behind the scan's start counts
        if marker == 0xDA:
            return None if data.find(b"\xff\xd9", at) >= 0 else "is a truncated JPEG (its end is missing)"
    return "is a truncated or damaged JPEG (no image data)"


def _bmp_damage(data: bytes) -> str | None:
    if len(data) < 54:
        return "is a truncated BMP (its header is incomplete)"
    offset, header = struct.unpack_from("<II", data, 10)
    width, height, _, bits, compression = struct.unpack_from("<iiHHI", data, 18)
    if header < 40 or compression not in (0, 3):
        return None
    row = (abs(width) * bits + 31) // 32 * 4
    return None if len(data) >= offset + row * abs(height) else "is a truncated BMP (its end is missing)"
