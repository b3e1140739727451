"""What a lecture hall wears: patterns that repeat exactly, and what people wear."""

from __future__ import annotations

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array
from sim2d.rendering.hall.textures import grain, some_color

TEXELS_PER_M = 160


def tiled(tile: UInt8Array, width_m: float, height_m: float) -> UInt8Array:
    """Lay a tile again and again over a surface."""
    rows, columns = round(height_m * TEXELS_PER_M), round(width_m * TEXELS_PER_M)
    times = (-(-rows // tile.shape[0]), -(-columns // tile.shape[1]), 1)
    return np.ascontiguousarray(np.tile(tile, times)[:rows, :columns])


def bricks(rng: np.random.Generator) -> UInt8Array:
    """Draw 2 m of a painted brick wall that meets itself at its edges."""
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
    """Draw what one person wears: jacket, trousers, the front and the back of the head."""
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
