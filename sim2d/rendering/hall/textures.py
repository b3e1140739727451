"""Random textures of a hall and its people: pictures, posters, shelves, walls, repeated patterns, clothes.

Photographs are those that come with scikit-image; drawn posters replace missing ones.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array

# resolution of repeated textures
TEXELS_PER_M = 160
_PICTURES = (
    "astronaut.png",
    "coffee.png",
    "chelsea.png",
    "rocket.jpg",
    "hubble_deep_field.jpg",
    "motorcycle_left.png",
    "retina.jpg",
    "camera.png",
    "coins.png",
    "ihc.png",
    "moon.png",
)
_PICTURE_SIDE_PX = 512
_WORDS = (
    "ROBOCUP",
    "KICK-OFF",
    "EXIT",
    "TEAM 7",
    "2001",
    "FIELD B",
    "GOAL",
    "STAFF",
    "VISION",
    "REFEREE",
    "WLAN",
    "LAB",
)


@lru_cache(maxsize=1)
def bundled_pictures() -> tuple[UInt8Array, ...]:
    """Return pictures of scikit-image, each (H, W, 3) uint8 BGR; empty if it is not installed."""
    spec = find_spec("skimage")
    if spec is None or spec.origin is None:
        return ()
    folder = Path(spec.origin).parent / "data"
    found = []
    for name in _PICTURES:
        picture = cv2.imread(str(folder / name)) if (folder / name).is_file() else None
        if picture is not None:
            shrink = min(1.0, _PICTURE_SIDE_PX / max(picture.shape[:2]))
            small = cv2.resize(picture, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
            found.append(np.asarray(small, dtype=np.uint8))
    return tuple(found)


def some_color(rng: np.random.Generator, low: float = 20, high: float = 235) -> tuple[float, float, float]:
    """Draw a random colour, BGR, each channel between `low` and `high`."""
    blue, green, red = rng.uniform(low, high, 3)
    return float(blue), float(green), float(red)


def grain(rng: np.random.Generator, drawn: UInt8Array, sigma: float) -> UInt8Array:
    """Return a picture with added noise, on scales from a texel to an eighth of the picture."""
    picture = drawn.astype(np.float32)
    rows, columns = picture.shape[:2]
    for cell, fraction in ((1, 0.5), (8, 0.6), (max(rows // 8, 2), 1.0)):
        noise = rng.standard_normal((rows // cell + 2, columns // cell + 2)).astype(np.float32)
        spread = np.asarray(cv2.resize(noise, (columns, rows), interpolation=cv2.INTER_CUBIC), dtype=np.float32)
        picture = picture + spread[..., None] * np.float32(fraction * sigma)
    return np.asarray(np.clip(picture, 0, 255), dtype=np.uint8)


def wall(rng: np.random.Generator, width_m: float, height_m: float, *, bricks: bool) -> UInt8Array:
    """Draw a wall at 160 texels a metre: plaster with stains, sockets and pipes, or uneven bricks."""
    columns, rows = round(width_m * 160), round(height_m * 160)
    picture = np.full((rows, columns, 3), rng.uniform(120, 190, 3), dtype=np.uint8)
    if bricks:
        for row in range(0, rows, 12):
            for column in range(-40 + (row // 12 % 2) * 20, columns, 40):
                shade = rng.uniform(0.75, 1.1)
                low = (max(column, 0) + 1, row + 1)
                cv2.rectangle(picture, low, (column + 37, row + 10), (90 * shade, 105 * shade, 160 * shade), -1)
    for _ in range(rng.integers(2, 5)):
        x = int(rng.integers(0, columns))
        cv2.line(picture, (x, 0), (x, rows), some_color(rng, 80, 200), int(rng.integers(3, 9)))
    for _ in range(rng.integers(8, 16)):
        x, y = int(rng.integers(0, columns)), int(rng.integers(0, rows))
        cv2.rectangle(picture, (x, y), (x + 12, y + 12), some_color(rng, 150, 250), -1)
        cv2.circle(picture, (x + 6, y + 6), 3, (30, 30, 30), -1)
    for _ in range(rng.integers(15, 30)):
        center = (int(rng.integers(0, columns)), int(rng.integers(0, rows)))
        axes = (int(rng.integers(4, 40)), int(rng.integers(4, 40)))
        stain = tuple(float(v) for v in picture[center[1], center[0]] * rng.uniform(0.8, 1.1))
        cv2.ellipse(picture, center, axes, float(rng.uniform(0, 180)), 0, 360, stain, -1)
    return grain(rng, picture, 3.0)


def floor(rng: np.random.Generator, width_m: float, depth_m: float, field_m: tuple[float, float]) -> UInt8Array:
    """Draw grey ground with a green carpet and its lines in the middle, at 100 texels a metre."""
    columns, rows = round(width_m * 100), round(depth_m * 100)
    picture = np.full((rows, columns, 3), rng.uniform(90, 130, 3), dtype=np.uint8)
    half = np.array(field_m) * 50
    middle = np.array([columns, rows]) / 2

    def box(grow: float) -> tuple[tuple[int, int], tuple[int, int]]:
        low, high = middle - half - grow, middle + half + grow
        return (int(low[0]), int(low[1])), (int(high[0]), int(high[1]))

    cv2.rectangle(picture, *box(30), (60, 130, 45), -1)
    cv2.rectangle(picture, *box(0), (215, 225, 220), 4)
    cv2.line(
        picture, (columns // 2, int(middle[1] - half[1])), (columns // 2, int(middle[1] + half[1])), (215, 225, 220), 4
    )
    cv2.circle(picture, (columns // 2, rows // 2), 50, (215, 225, 220), 4)
    return grain(rng, picture, 6.0)


def ceiling(rng: np.random.Generator, width_m: float, depth_m: float) -> UInt8Array:
    """Draw ceiling tiles with lamps, at 60 texels a metre."""
    columns, rows = round(width_m * 60), round(depth_m * 60)
    picture = np.full((rows, columns, 3), 190, dtype=np.uint8)
    for row in range(0, rows, 36):
        for column in range(0, columns, 36):
            level = 245.0 if rng.random() < 0.08 else rng.uniform(170, 200)
            cv2.rectangle(picture, (column, row), (column + 34, row + 34), (level, level, level), -1)
    return grain(rng, picture, 3.0)


def notice(rng: np.random.Generator) -> UInt8Array:
    """Draw a poster: blocks of colour, shapes and large and small words."""
    rows, columns = int(rng.integers(256, 512)), int(rng.integers(256, 512))
    picture = np.full((rows, columns, 3), some_color(rng, 120, 250), dtype=np.uint8)
    for _ in range(rng.integers(6, 16)):
        x, y = int(rng.integers(0, columns)), int(rng.integers(0, rows))
        w, h = int(rng.integers(10, columns // 2)), int(rng.integers(10, rows // 2))
        shape = rng.integers(0, 3)
        if shape == 0:
            cv2.rectangle(picture, (x, y), (x + w, y + h), some_color(rng), -1)
        elif shape == 1:
            cv2.ellipse(picture, (x, y), (w // 2, h // 2), float(rng.uniform(0, 180)), 0, 360, some_color(rng), -1)
        else:
            corners = rng.integers(-80, 80, (3, 2)) + np.array([x, y])
            cv2.fillPoly(picture, [corners.astype(np.int32)], some_color(rng))
    for _ in range(rng.integers(3, 9)):
        word = str(rng.choice(_WORDS))
        place = (int(rng.integers(0, columns * 2 // 3)), int(rng.integers(20, rows)))
        cv2.putText(
            picture,
            word,
            place,
            int(rng.integers(0, 5)),
            rng.uniform(0.5, 2.2),
            some_color(rng, 0, 120),
            int(rng.integers(1, 5)),
        )
    return grain(rng, picture, 2.0)


def shelf(rng: np.random.Generator) -> UInt8Array:
    """Draw a shelf full of books and boxes."""
    picture = np.full((384, 256, 3), (40, 60, 80), dtype=np.uint8)
    for board in range(0, 384, 64):
        x = 4
        while x < 250:
            thick, high = int(rng.integers(6, 26)), int(rng.integers(34, 56))
            right = min(x + thick, 252)
            cv2.rectangle(picture, (x, board + 60 - high), (right, board + 60), some_color(rng), -1)
            if thick > 10:
                cv2.rectangle(picture, (x + 2, board + 40), (right - 2, board + 46), some_color(rng, 150, 250), -1)
            x += thick + int(rng.integers(1, 8))
        cv2.rectangle(picture, (0, board + 60), (256, board + 64), (70, 110, 150), -1)
    return grain(rng, picture, 2.0)


def crate(rng: np.random.Generator) -> UInt8Array:
    """Draw the side of a crate or cupboard: boards, a label, handles."""
    picture = np.full((256, 256, 3), rng.uniform(60, 190, 3), dtype=np.uint8)
    for x in range(0, 256, int(rng.integers(24, 72))):
        cv2.line(picture, (x, 0), (x, 255), some_color(rng, 20, 90), 2)
    for _ in range(rng.integers(3, 8)):
        x, y = int(rng.integers(0, 200)), int(rng.integers(0, 220))
        cv2.rectangle(
            picture, (x, y), (x + int(rng.integers(15, 90)), y + int(rng.integers(10, 50))), some_color(rng), -1
        )
    cv2.putText(
        picture,
        str(rng.choice(_WORDS)),
        (10, int(rng.integers(40, 240))),
        2,
        rng.uniform(0.8, 1.6),
        some_color(rng, 0, 80),
        2,
    )
    return grain(rng, picture, 4.0)


def sheet(rng: np.random.Generator) -> UInt8Array:
    """Draw a plain sheet that covers a poster."""
    return grain(rng, np.full((64, 64, 3), rng.uniform(100, 220, 3), dtype=np.uint8), 2.0)


def tiled(tile: UInt8Array, width_m: float, height_m: float) -> UInt8Array:
    """Repeat a tile over a surface."""
    rows, columns = round(height_m * TEXELS_PER_M), round(width_m * TEXELS_PER_M)
    times = (-(-rows // tile.shape[0]), -(-columns // tile.shape[1]), 1)
    return np.ascontiguousarray(np.tile(tile, times)[:rows, :columns])


def bricks(rng: np.random.Generator) -> UInt8Array:
    """Draw 2 m of a painted brick wall that can be repeated."""
    picture = np.full((320, 320, 3), 160, dtype=np.uint8)
    for row in range(32):
        for column in range(16):
            shade = rng.uniform(0.76, 1.12)
            color = (170 * shade, 184 * shade, 194 * shade)
            x = column * 20 + row % 2 * 10
            for left in (x, x - 320):
                cv2.rectangle(picture, (left + 1, row * 10 + 1), (left + 18, row * 10 + 8), color, -1)
    return grain(rng, picture, 5.0)


def carpet_tile(rng: np.random.Generator) -> UInt8Array:
    """Draw 2 m of a carpet with woven flecks, in tiles of 0.5 m."""
    picture = np.full((320, 320, 3), (104, 92, 86), dtype=np.uint8)
    for _ in range(2200):
        x, y = (int(v) for v in rng.integers(0, 318, 2))
        shade = rng.uniform(0.5, 1.6)
        end = (x + int(rng.integers(2, 6)), y + int(rng.integers(1, 4)))
        cv2.rectangle(picture, (x, y), end, (124 * shade, 106 * shade, 96 * shade), -1)
    for k in range(0, 320, 80):
        cv2.line(picture, (k, 0), (k, 319), (66, 60, 58), 2)
        cv2.line(picture, (0, k), (319, k), (66, 60, 58), 2)
    return grain(rng, picture, 5.0)


def ceiling_tile(rng: np.random.Generator) -> UInt8Array:
    """Draw four ceiling tiles of 0.6 m, one of them a lamp."""
    picture = np.full((192, 192, 3), 196, dtype=np.uint8)
    for row in (0, 96):
        for column in (0, 96):
            level = 250 if row == column == 0 else 205
            cv2.rectangle(picture, (column + 2, row + 2), (column + 93, row + 93), (level, level, level), -1)
            if level < 250:
                for _ in range(60):
                    x, y = (int(v) for v in rng.integers(6, 90, 2))
                    cv2.circle(picture, (column + x, row + y), 1, (170, 170, 170), -1)
    return grain(rng, picture, 1.5)


def fabric(rng: np.random.Generator) -> UInt8Array:
    """Draw a chair's cloth: a small pattern and a label."""
    picture = np.full((72, 96, 3), (120, 62, 40), dtype=np.uint8)
    for y in range(6, 72, 12):
        for x in range(6, 96, 12):
            cv2.circle(picture, (x, y), 2, (170, 120, 96), -1)
    cv2.rectangle(picture, (36, 26), (60, 44), (210, 214, 216), -1)
    cv2.putText(picture, "R", (42, 41), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40, 40, 40), 1)
    return grain(rng, picture, 2.0)


def steel(rng: np.random.Generator) -> UInt8Array:
    """Draw a grey tube."""
    return grain(rng, np.full((64, 8, 3), 120, dtype=np.uint8), 2.0)


def partition(rng: np.random.Generator) -> UInt8Array:
    """Draw a partition: a frame around a woven panel."""
    picture = np.full((280, 224, 3), (150, 142, 120), dtype=np.uint8)
    for x in range(8, 224, 8):
        for y in range(8, 280, 8):
            shade = float(rng.uniform(0.94, 1.05))
            cv2.rectangle(picture, (x, y), (x + 5, y + 5), (158 * shade, 148 * shade, 128 * shade), -1)
    cv2.rectangle(picture, (0, 0), (223, 279), (70, 70, 74), 10)
    return grain(rng, picture, 1.5)


def clothes(rng: np.random.Generator) -> tuple[UInt8Array, UInt8Array, UInt8Array, UInt8Array]:
    """Draw the clothes of one person: jacket, trousers, front and back of the head."""
    jacket = np.full((96, 48, 3), some_color(rng, 30, 220), dtype=np.uint8)
    stripe, at = some_color(rng, 30, 220), int(rng.integers(20, 70))
    if rng.random() < 0.6:
        cv2.rectangle(jacket, (0, at), (47, at + int(rng.integers(4, 16))), stripe, -1)
    trousers = np.full((96, 32, 3), some_color(rng, 20, 110), dtype=np.uint8)
    cv2.rectangle(trousers, (0, 86), (31, 95), (30, 30, 34), -1)
    skin = np.array((120, 160, 215)) * rng.uniform(0.45, 1.05)
    hair = np.array((40, 60, 80)) * rng.uniform(0.3, 1.8)
    face, nape = np.full((48, 24, 3), skin, dtype=np.uint8), np.full((48, 24, 3), skin, dtype=np.uint8)
    cv2.rectangle(face, (0, 0), (23, 11), hair.tolist(), -1)
    cv2.rectangle(nape, (0, 0), (23, 34), hair.tolist(), -1)
    cv2.line(face, (4, 21), (20, 21), (40, 40, 40), 2)
    return grain(rng, jacket, 3.0), grain(rng, trousers, 3.0), grain(rng, face, 2.0), grain(rng, nape, 2.0)
