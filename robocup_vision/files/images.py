"""Reads image files strictly: truncated files and grey or 16-bit images are refused, not silently repaired.

OpenCV returns the part of a truncated PNG or JPEG that it could decode, with the rest grey or black. A localiser must
not be scored on such an image, so Pillow, which refuses it, reads the file first. OpenCV then decodes the pixels. It
keeps 16 bits and alpha channels, so that they can be refused with a specific error; opaque alpha channels are dropped.

Pixels are taken as they are stored: a camera file describes the sensor, so an EXIF orientation is not applied.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image, UnidentifiedImageError

from field_models.errors import FrameError
from robocup_vision.arrays import UInt8Array
from robocup_vision.files.output_folder import telling_write_errors

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff")
# suffixes of image formats that are not read
OTHER_SUFFIXES = (".gif", ".heic", ".heif", ".avif", ".jxl", ".jp2", ".ppm", ".pgm", ".pnm", ".tga", ".dng", ".raw")
_SIGNATURES = {b"\x89PNG\r\n\x1a\n": "PNG", b"\xff\xd8": "JPEG", b"BM": "BMP", b"II*\0": "TIFF", b"MM\0*": "TIFF"}
_KINDS = "a PNG, JPEG, BMP, WebP or TIFF file"
# a PNG's last chunk is empty, so its bytes are the same in every file; Pillow does not read its checksum
_PNG_END = b"\x00\x00\x00\x00IEND\xaeB`\x82"
_EXIF_ORIENTATION, _UPRIGHT = 0x0112, 1


def read_image(path: str | Path, size_px: tuple[int, int] | None = None) -> UInt8Array:
    """Read a colour image, (H, W, 3) uint8 BGR, its pixels as they are stored; it must have the size if one is given.

    Raises
    ------
    FrameError
        If the file is missing, damaged or truncated, not 8-bit colour, not opaque or of another size.
    """
    return decode_image(file_bytes(path), Path(path).name, size_px)


def file_bytes(path: str | Path) -> bytes:
    """Return the bytes of a file.

    Raises
    ------
    FrameError
        If it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise FrameError(f"{Path(path).name}: cannot be read ({error.strerror or error})") from None


def decode_image(data: bytes, name: str, size_px: tuple[int, int] | None = None) -> UInt8Array:
    """Decode the bytes of an image file, as `read_image` does.

    Raises
    ------
    FrameError
        If it is damaged or truncated, not 8-bit colour, not opaque or of another size.
    """
    image = opaque_bgr(_decode(data, name), name)
    height, width = image.shape[:2]
    if size_px is not None and (width, height) != tuple(size_px):
        turned = "" if _orientation(data) == _UPRIGHT else " (its EXIF orientation is not applied)"
        raise FrameError(f"{name}: is {width}x{height}{turned}, the camera file says {size_px[0]}x{size_px[1]}")
    return image


def opaque_bgr(image: npt.NDArray[np.uint8] | npt.NDArray[np.uint16], name: str) -> UInt8Array:
    """Return an image that OpenCV has decoded as (H, W, 3) uint8, without an opaque alpha channel.

    Raises
    ------
    FrameError
        If it is not 8-bit colour, or not opaque.
    """
    if image.dtype != np.uint8:
        raise FrameError(f"{name}: has {8 * image.itemsize} bits per channel, must have 8")
    if image.ndim == 2:
        raise FrameError(f"{name}: is a grey image, must be in colour")
    pixels = np.asarray(image, dtype=np.uint8)
    if pixels.shape[2] == 4 and (pixels[..., 3] == 255).all():
        return np.ascontiguousarray(pixels[..., :3])
    if pixels.shape[2] != 3:
        kind = "an alpha channel that is not opaque" if pixels.shape[2] == 4 else f"{pixels.shape[2]} channels"
        raise FrameError(f"{name}: has {kind}, must have 3 channels")
    return pixels


def other_pictures(folder: Path) -> list[str]:
    """Return the names of pictures in a folder whose formats are not read."""
    return sorted(entry.name for entry in folder.iterdir() if entry.suffix.lower() in OTHER_SUFFIXES)


def orientation_note(folder: Path, names: Iterable[str]) -> tuple[str, ...]:
    """Return a note that names the first image with an EXIF orientation; empty if there is none."""
    for name in names:
        try:
            with (folder / name).open("rb") as stream, Image.open(stream) as image:
                found = image.getexif().get(_EXIF_ORIENTATION, _UPRIGHT)
        except Exception:  # a file that is not an image is refused when it is read
            continue
        if found != _UPRIGHT:
            return (f"{name} has the EXIF orientation {found}, which is not applied: pixels are taken as stored",)
    return ()


def read_mask(path: str | Path) -> UInt8Array:
    """Read a mask as (H, W) uint8, 255 where any colour channel of the file is non-zero; alpha is ignored.

    Raises
    ------
    FrameError
        If the file is missing, damaged or truncated.
    """
    set_pixels = _decode(file_bytes(path), Path(path).name) != 0
    if set_pixels.ndim == 3:
        set_pixels = np.any(set_pixels[..., :3], axis=2)
    return np.where(set_pixels, 255, 0).astype(np.uint8)


def write_png(path: Path, image: UInt8Array) -> None:
    """Write an image as PNG.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    encoded, data = cv2.imencode(".png", np.ascontiguousarray(image), [cv2.IMWRITE_PNG_COMPRESSION, 3])
    assert encoded, "OpenCV encodes every (H, W, 3) uint8 array"
    with telling_write_errors(path):
        path.write_bytes(data.tobytes())


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
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        # OpenCV and Pillow silently repair a truncated WebP
        kind = "WEBP" if len(data) >= 8 + int.from_bytes(data[4:8], "little") else None
        if kind is None:
            return "is a truncated or damaged WEBP (its end is missing)"
    if kind is None:
        return f"is not {_KINDS}"
    try:
        with Image.open(io.BytesIO(data), formats=[kind]) as image:
            count = getattr(image, "n_frames", 1) if kind in ("WEBP", "TIFF") else 1
            # every reader applies a TIFF's orientation, and that cannot be switched off
            if kind == "TIFF" and (turn := image.getexif().get(_EXIF_ORIENTATION, _UPRIGHT)) != _UPRIGHT:
                return f"is a TIFF with the orientation {turn}, must be stored upright (1)"
            # a PNG's checksums reveal any damage; others must be decoded to their end
            image.verify() if kind == "PNG" else image.load()
    except Exception as error:  # Pillow's readers raise errors of many kinds
        return f"is a truncated or damaged {kind} ({_reason(error)})"
    if count != 1:
        return f"holds {count} images, must hold one"
    if kind == "PNG" and _PNG_END not in data:
        return "is a truncated or damaged PNG (its end is missing)"
    return None


def _reason(error: Exception) -> str:
    return "its header cannot be read" if isinstance(error, UnidentifiedImageError) else str(error)


def _orientation(data: bytes) -> int:
    try:
        with Image.open(io.BytesIO(data)) as image:
            return int(image.getexif().get(_EXIF_ORIENTATION, _UPRIGHT))
    except Exception:  # Pillow cannot read the image, so its orientation is unknown
        return _UPRIGHT
