"""Paints pictures without a field, in which no pose may be found: constants, noise, patterns, rooms, shuffled pictures.

They are difficult: most have large areas of one colour, often green, with straight bright edges and strokes.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array

Painter = Callable[[tuple[int, int], np.random.Generator], UInt8Array]

CARPET_BGR = (50.0, 130.0, 45.0)


def constant(size_px: tuple[int, int], rng: np.random.Generator) -> UInt8Array:
    """Paint one colour."""
    width, height = size_px
    return np.full((height, width, 3), _color(rng), dtype=np.uint8)


def noise(size_px: tuple[int, int], rng: np.random.Generator) -> UInt8Array:
    """Paint independent noise of any strength about one colour."""
    width, height = size_px
    values = rng.normal(_color(rng), rng.uniform(1.0, 120.0), (height, width, 3))
    return np.clip(values, 0, 255).astype(np.uint8)


def clouds(size_px: tuple[int, int], rng: np.random.Generator) -> UInt8Array:
    """Paint smooth patches of several sizes."""
    width, height = size_px
    picture = np.full((height, width, 3), _color(rng), dtype=np.float64)
    for cells in (2, 5, 11, 30):
        coarse = rng.normal(0.0, rng.uniform(5.0, 60.0), (cells, cells, 3)).astype(np.float32)
        picture += cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.clip(picture, 0, 255).astype(np.uint8)


def stripes(size_px: tuple[int, int], rng: np.random.Generator) -> UInt8Array:
    """Paint parallel stripes, or a chequered pattern, at any angle."""
    width, height = size_px
    v, u = np.mgrid[:height, :width]
    angle, period = rng.uniform(0.0, np.pi), rng.uniform(4.0, width / 2)
    along = (u * np.cos(angle) + v * np.sin(angle)) // period
    across = (v * np.cos(angle) - u * np.sin(angle)) // period if rng.random() < 0.5 else np.zeros_like(along)
    first, second = _color(rng), _color(rng)
    return np.where(((along + across) % 2 == 0)[..., None], first, second).astype(np.uint8)


def shapes(size_px: tuple[int, int], rng: np.random.Generator) -> UInt8Array:
    """Paint rectangles, discs and triangles of any colour."""
    width, height = size_px
    picture = constant(size_px, rng)
    for _ in range(rng.integers(3, 40)):
        center = int(rng.integers(width)), int(rng.integers(height))
        color, reach = _color(rng), int(rng.integers(3, max(4, height // 2)))
        kind = rng.integers(3)
        if kind == 0:
            cv2.circle(picture, center, reach, color, -1)
        elif kind == 1:
            cv2.rectangle(picture, center, (center[0] + reach, center[1] + int(rng.integers(1, height))), color, -1)
        else:
            corners = rng.integers(0, (width, height), (3, 2)).astype(np.int32)
            cv2.fillPoly(picture, [corners], color)
    return _grained(picture, rng)


def strokes(size_px: tuple[int, int], rng: np.random.Generator) -> UInt8Array:
    """Paint bright strokes, arcs and letters on a carpet's green or any colour, unlike a pitch's lines."""
    width, height = size_px
    ground = CARPET_BGR if rng.random() < 0.6 else _color(rng)
    picture = np.full((height, width, 3), ground, dtype=np.uint8)
    for _ in range(rng.integers(2, 30)):
        start, end = rng.integers(0, (width, height), (2, 2)).tolist()
        color = (230, 230, 230) if rng.random() < 0.7 else _color(rng)
        thickness = int(rng.integers(1, 7))
        kind = rng.integers(3)
        if kind == 0:
            cv2.line(picture, start, end, color, thickness)
        elif kind == 1:
            axes = (int(rng.integers(3, width)), int(rng.integers(3, height)))
            cv2.ellipse(
                picture, start, axes, float(rng.uniform(0, 360)), 0, float(rng.uniform(20, 300)), color, thickness
            )
        else:
            cv2.putText(
                picture, "EXIT 24", start, cv2.FONT_HERSHEY_SIMPLEX, float(rng.uniform(0.4, 3)), color, thickness
            )
    return _grained(picture, rng)


def room(size_px: tuple[int, int], rng: np.random.Generator) -> UInt8Array:
    """Paint a floor, walls with doors and windows, tables and people, as seen by a level camera.

    No frame is white, because a white frame on green ground could be a goal.
    """
    width, height = size_px
    picture = np.full((height, width, 3), _color(rng), dtype=np.uint8)
    horizon = int(rng.uniform(0.2, 0.7) * height)
    floor = CARPET_BGR if rng.random() < 0.4 else _color(rng)
    picture[horizon:] = np.asarray(floor, dtype=np.uint8)
    for _ in range(rng.integers(2, 12)):
        left, wide = int(rng.integers(-20, width)), int(rng.integers(5, width // 2))
        top, tall = int(rng.integers(0, horizon + 1)), int(rng.integers(5, height))
        cv2.rectangle(picture, (left, top), (left + wide, top + tall), _color(rng), -1)
        if rng.random() < 0.4:
            cv2.rectangle(picture, (left, top), (left + wide, top + tall), _color(rng), int(rng.integers(1, 6)))
    return _grained(picture, rng)


def mosaic(size_px: tuple[int, int], rng: np.random.Generator) -> UInt8Array:
    """Paint a picture of shapes or strokes, divided into shuffled tiles."""
    picture = shapes(size_px, rng) if rng.random() < 0.5 else strokes(size_px, rng)
    tile = int(rng.integers(6, 40))
    rows, columns = picture.shape[0] // tile, picture.shape[1] // tile
    corners = [(row * tile, column * tile) for row in range(rows) for column in range(columns)]
    shuffled = picture.copy()
    for (top, left), index in zip(corners, rng.permutation(len(corners)), strict=True):
        from_top, from_left = corners[index]
        shuffled[top : top + tile, left : left + tile] = picture[
            from_top : from_top + tile, from_left : from_left + tile
        ]
    return shuffled


PAINTERS: dict[str, Painter] = {
    painter.__name__: painter for painter in (constant, noise, clouds, stripes, shapes, strokes, room, mosaic)
}


def no_field_picture(size_px: tuple[int, int], index: int, seed: int) -> tuple[str, UInt8Array]:
    """Return the kind and the picture of number `index`; it depends on size, seed and number only."""
    rng = np.random.default_rng([seed, index])
    name = list(PAINTERS)[index % len(PAINTERS)]
    return name, PAINTERS[name](size_px, rng)


def _color(rng: np.random.Generator) -> tuple[float, float, float]:
    """Return a random colour, one in four near a carpet's."""
    if rng.random() < 0.25:
        blue, green, red = np.clip(rng.normal(CARPET_BGR, 15.0), 0, 255).tolist()
    else:
        blue, green, red = rng.uniform(0, 255, 3).tolist()
    return blue, green, red


def _grained(picture: UInt8Array, rng: np.random.Generator) -> UInt8Array:
    """Add blur and noise like a sensor."""
    blurred = cv2.GaussianBlur(picture, (0, 0), float(rng.uniform(0.3, 1.5))).astype(np.float32)
    blurred += rng.normal(0.0, rng.uniform(0.5, 12.0), picture.shape).astype(np.float32)
    return np.clip(blurred, 0, 255).astype(np.uint8)
