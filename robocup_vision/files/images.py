"""Image files read strictly: a truncated file and a grey or 16-bit image are refused, not repaired in silence.

OpenCV returns the part of a truncated PNG or JPEG that it could decode, with the rest grey or black. A localiser must
not be scored on such an image, so Pillow, which refuses it, reads the file first. OpenCV then decodes the pixels: its
arrays keep 16 bits and alpha channels, which are refused by name.
"""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image, UnidentifiedImageError

from field_models.errors import FrameError
from robocup_vision.arrays import UInt8Array

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp")
_SIGNATURES = {b"\x89PNG\r\n\x1a\n": "PNG", b"\xff\xd8": "JPEG", b"BM": "BMP"}
# a PNG's last chunk is empty, so its bytes are the same in every file; Pillow does not read its checksum
_PNG_END = b"\x00\x00\x00\x00IEND\xaeB`\x82"


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
    return decode_image(file_bytes(path), Path(path).name, size_px)


def file_bytes(path: str | Path) -> bytes:
    """Return what stands in a file.

    Raises
    ------
    FrameError
        If it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise FrameError(f"{Path(path).name}: cannot be read ({error.strerror or error})") from None


def decode_image(data: bytes, name: str, size_px: tuple[int, int]) -> UInt8Array:
    """Decode what stands in an image file, as `read_image` does.

    Parameters
    ----------
    data : bytes
        Of a PNG, JPEG or BMP file.
    name : str
        For messages.
    size_px : (int, int)
        Width and height it must have.

    Raises
    ------
    FrameError
        If it is damaged or truncated, not 8-bit colour, has an alpha channel or another size.
    """
    image = _decode(data, name)
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
    set_pixels = _decode(file_bytes(path), Path(path).name) != 0
    if set_pixels.ndim == 3:
        set_pixels = np.any(set_pixels[..., :3], axis=2)
    return np.where(set_pixels, 255, 0).astype(np.uint8)


def _decode(data: bytes, name: str) -> npt.NDArray[np.uint8] | npt.NDArray[np.uint16]:
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
    kind = next((kind for signature, kind in _SIGNATURES.items() if data.startswith(signature)), None)
    if kind is None:
        return "is neither a PNG, a JPEG nor a BMP file"
    try:
        with Image.open(io.BytesIO(data), formats=[kind]) as image:
            # a PNG's checksums reveal any damage; a JPEG or BMP must be decoded to its end
            image.verify() if kind == "PNG" else image.load()
    except Exception as error:  # Pillow's readers raise errors of many kinds
        return f"is a truncated or damaged {kind} ({_reason(error)})"
    if kind == "PNG" and _PNG_END not in data:
        return "is a truncated or damaged PNG (its end is missing)"
    return None


def _reason(error: Exception) -> str:
    return "its header cannot be read" if isinstance(error, UnidentifiedImageError) else str(error)
