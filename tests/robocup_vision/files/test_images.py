"""Every kind of file that is not the wanted image is refused with its reason."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from field_models import FrameError
from field_models.errors import FileError
from robocup_vision.files.image_folder import ImageFiles
from robocup_vision.files.images import orientation_note, other_pictures, read_image, read_mask

WIDTH, HEIGHT = 40, 30
COLOR = np.random.default_rng(7).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)


def encode(kind: str, image: np.ndarray = COLOR) -> bytes:
    return cv2.imencode(kind, image)[1].tobytes()


@pytest.mark.parametrize("kind", [".png", ".bmp", ".jpg", ".webp", ".tif"])
def test_reads_what_was_written(tmp_path: Path, kind: str) -> None:
    smooth = cv2.GaussianBlur(COLOR, (0, 0), 6.0)
    (tmp_path / f"a{kind}").write_bytes(encode(kind, smooth))
    image = read_image(tmp_path / f"a{kind}", (WIDTH, HEIGHT))
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert image.dtype == np.uint8
    assert np.abs(image.astype(int) - smooth).max() <= (8 if kind in (".jpg", ".webp") else 0)


@given(kind=st.sampled_from([".png", ".bmp", ".jpg", ".webp", ".tif"]), ratio=st.floats(0.0, 0.999))
def test_any_truncation_is_refused(tmp_path_factory: pytest.TempPathFactory, kind: str, ratio: float) -> None:
    data = encode(kind)
    path = tmp_path_factory.mktemp("cut") / f"a{kind}"
    path.write_bytes(data[: min(int(len(data) * ratio), len(data) - 2)])
    with pytest.raises(FrameError, match=r"^a\.\w+: is (a truncated or damaged|empty|not a PNG)"):
        read_image(path, (WIDTH, HEIGHT))


@given(at=st.floats(0.01, 0.9999), flip=st.integers(1, 255))
def test_a_damaged_png_is_refused(tmp_path_factory: pytest.TempPathFactory, at: float, flip: int) -> None:
    data = bytearray(encode(".png"))
    data[int(at * len(data))] ^= flip
    path = tmp_path_factory.mktemp("bent") / "a.png"
    path.write_bytes(data)
    with pytest.raises(FrameError, match=r"^a\.png: is a truncated or damaged PNG"):
        read_image(path, (WIDTH, HEIGHT))


@pytest.mark.parametrize(
    ("image", "problem"),
    [
        (COLOR[..., 0], "is a grey image, must be in colour"),
        (COLOR.astype(np.uint16) * 256, "has 16 bits per channel, must have 8"),
        (np.dstack([COLOR, COLOR[..., 0]]), "has an alpha channel that is not opaque, must have 3 channels"),
        (COLOR[:20], "is 40x20, the camera file says 40x30"),
    ],
)
def test_other_images_are_refused(tmp_path: Path, image: np.ndarray, problem: str) -> None:
    (tmp_path / "a.png").write_bytes(encode(".png", image))
    with pytest.raises(FrameError, match=rf"^a\.png: {problem}$"):
        read_image(tmp_path / "a.png", (WIDTH, HEIGHT))


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "is empty"),
        (b"GIF89a", "is not a PNG, JPEG, BMP, WebP or TIFF file"),
        (b"\xff\xd8\xff\xff\xff", r"is a truncated or damaged JPEG \(its header cannot be read\)"),
        (
            b"BM" + struct.pack("<IIIIiiHHI", 60, 0, 54, 12, 9, 9, 1, 24, 0) + bytes(22),
            r"is a truncated or damaged BMP \(.+\)",
        ),
    ],
)
def test_other_files_are_refused(tmp_path: Path, data: bytes, problem: str) -> None:
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(FrameError, match=rf"^a\.png: {problem}"):
        read_image(tmp_path / "a.png", (WIDTH, HEIGHT))


def test_a_thumbnail_does_not_hide_a_truncation(tmp_path: Path) -> None:
    data = encode(".jpg")
    thumbnail = encode(".jpg", COLOR[:8, :8].copy())
    app1 = b"\xff\xe1" + struct.pack(">H", 2 + len(thumbnail)) + thumbnail
    (tmp_path / "a.jpg").write_bytes(data[:2] + app1 + data[2:-2])
    with pytest.raises(FrameError, match="truncated or damaged JPEG"):
        read_image(tmp_path / "a.jpg", (WIDTH, HEIGHT))
    (tmp_path / "a.jpg").write_bytes(data[:2] + app1 + data[2:])
    assert read_image(tmp_path / "a.jpg", (WIDTH, HEIGHT)).shape == COLOR.shape


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FrameError, match=r"^a\.png: cannot be read \(No such file"):
        read_image(tmp_path / "a.png", (WIDTH, HEIGHT))


def test_a_mask_is_whatever_is_not_zero(tmp_path: Path) -> None:
    grey = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    grey[3, 4] = 1
    for name, image in (("grey", grey), ("color", cv2.merge([grey * 0, grey, grey * 0])),
                        ("alpha", cv2.merge([grey, grey, grey, grey + 254]))):  # fmt: skip
        (tmp_path / f"{name}.png").write_bytes(encode(".png", image))
        mask = read_mask(tmp_path / f"{name}.png")
        assert mask[3, 4] == 255
        assert np.count_nonzero(mask) == 1


def test_an_image_is_read_as_the_sensor_saw_it(tmp_path: Path) -> None:
    """An orientation tag must not turn it: the camera file describes the sensor."""
    exif = (
        b"Exif\x00\x00II*\x00\x08\x00\x00\x00\x01\x00\x12\x01\x03\x00\x01\x00\x00\x00\x06\x00\x00\x00\x00\x00\x00\x00"
    )
    data = encode(".jpg")
    app1 = b"\xff\xe1" + struct.pack(">H", 2 + len(exif)) + exif
    (tmp_path / "a.jpg").write_bytes(data[:2] + app1 + data[2:])
    assert read_image(tmp_path / "a.jpg", (WIDTH, HEIGHT)).shape == (HEIGHT, WIDTH, 3)


def test_an_opaque_alpha_channel_is_no_hindrance(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(encode(".png", np.dstack([COLOR, np.full((HEIGHT, WIDTH), 255, np.uint8)])))
    assert np.array_equal(read_image(tmp_path / "a.png", (WIDTH, HEIGHT)), COLOR)


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP"])
def test_pixels_are_as_stored_whatever_the_orientation(tmp_path: Path, kind: str) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    smooth = cv2.GaussianBlur(COLOR, (0, 0), 6.0)
    path = tmp_path / f"a.{kind.lower()}"
    Image.fromarray(np.ascontiguousarray(smooth[..., ::-1])).save(path, exif=exif, quality=95)
    assert np.abs(read_image(path, (WIDTH, HEIGHT)).astype(int) - smooth).max() <= 12
    assert ImageFiles([path]).size_px == (WIDTH, HEIGHT)
    [note] = orientation_note(tmp_path, [path.name])
    assert note == f"{path.name} has the EXIF orientation 6, which is not applied: pixels are taken as stored"
    assert ImageFiles([path]).notes == (note,)
    with pytest.raises(
        FrameError, match=r"is 40x30 \(its EXIF orientation is not applied\), the camera file says 30x40"
    ):
        read_image(path, (HEIGHT, WIDTH))


def test_a_tiff_that_readers_turn_is_refused(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(COLOR).save(tmp_path / "a.tif", exif=exif)
    with pytest.raises(FrameError, match=r"is a TIFF with the orientation 6, must be stored upright \(1\)"):
        read_image(tmp_path / "a.tif")


def test_of_several_images_in_a_file_none_is_chosen(tmp_path: Path) -> None:
    pages = [Image.fromarray(COLOR), Image.fromarray(COLOR[::-1])]
    pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:])
    with pytest.raises(FrameError, match="holds 2 images, must hold one"):
        read_image(tmp_path / "a.tif")


def test_pictures_of_other_kinds_are_named(tmp_path: Path) -> None:
    for name in ("b.HEIC", "a.gif", "notes.txt"):
        (tmp_path / name).write_bytes(b"")
    assert other_pictures(tmp_path) == ["a.gif", "b.HEIC"]
    with pytest.raises(FileError, match=r"2 pictures of other kinds, the first: a\.gif"):
        ImageFiles([tmp_path])
