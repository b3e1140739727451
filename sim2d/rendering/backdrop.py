"""Random backgrounds of a field: a room's clutter, or a finer backdrop for cameras near the floor.

The backdrop contains white and coloured uprights, which resemble goals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import cv2
import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray

BackdropKind = Literal["plain", "hall", "orange"]

# size and resolution of the room's clutter
ROOM_HEIGHT_M, ROOM_ROWS_PER_M, _ROOM_COLUMNS = 4.0, 24, 1440
# size and resolution of the backdrop
CELL_M = 0.0125
HEIGHT_M = 3.5
DRAWN_RADIUS_M = 5.0  # radius of the room for which the wall is drawn; it is stretched in others


@dataclass(frozen=True, slots=True)
class Backdrop:
    """The wall of a round room about the field's centre."""

    #: A plain grey wall, a full hall, or a hall with an orange wall.
    kind: BackdropKind = "hall"
    #: Seed of the room.
    seed: int = 0

    def colors(self, x_m: Float32Array, y_m: Float32Array, z_m: Float32Array) -> Float32Array:
        """Return the colours (N, 3) BGR of points on the room's wall, field frame, metres."""
        picture = _panorama(self)
        rows, columns = picture.shape[:2]
        u = np.remainder(np.arctan2(y_m, x_m) / math.tau, 1.0) * (columns - 1)
        v = np.clip((1 - z_m / HEIGHT_M) * (rows - 1), 0, rows - 1)
        return sample_at(picture, u, v, cv2.BORDER_REPLICATE)

    def unrolled(self) -> tuple[Float32Array, float]:
        """Return the unrolled wall (H, W, 3) BGR and its rows per metre; column by azimuth from +x, top row first."""
        picture = _panorama(self)
        return picture[:, :-1], len(picture) / HEIGHT_M


def sample_at(
    picture: Float32Array, u: Float32Array | FloatArray, v: Float32Array | FloatArray, border_mode: int
) -> Float32Array:
    """Return a picture (H, W, ...) at columns u (N,) and rows v (N,), interpolated linearly: (N, ...) float32."""
    if not len(u):
        # OpenCV refuses empty maps
        return np.empty((0, *picture.shape[2:]), dtype=np.float32)
    width = 1024  # OpenCV's maps may not be longer than 32767 along one side
    padding = -len(u) % width
    maps = [np.pad(c, (0, padding)).astype(np.float32).reshape(-1, width) for c in (u, v)]
    found = cv2.remap(picture, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=border_mode)
    return np.asarray(found.reshape(-1, *picture.shape[2:])[: len(u)])


@lru_cache(maxsize=4)
def _panorama(backdrop: Backdrop) -> Float32Array:
    """Return the unrolled wall of the room (H, W, 3) float32, azimuth to the right, height upwards."""
    rng = np.random.default_rng(backdrop.seed)
    rows, columns = round(HEIGHT_M / CELL_M), round(math.tau * DRAWN_RADIUS_M / CELL_M)
    wall = rng.uniform(95, 190) * rng.uniform(0.9, 1.1, 3)
    picture = np.empty((rows, columns, 3), dtype=np.float32)
    picture[:] = wall
    if backdrop.kind != "plain":
        _draw_curtains(picture, rng)
        _draw_windows(picture, rng)
        if backdrop.kind == "orange":
            height = rng.integers(rows // 4, rows)
            picture[rows - height :] = (28, 105, 228) * rng.uniform(0.85, 1.1, 3)
        _draw_furniture(picture, rng)
        _draw_people(picture, rng)
        noise = np.empty_like(picture)
        for row in noise:  # row by row, to stay in the processor's cache
            row[:] = rng.normal(0, 12, row.shape)
        picture += cv2.GaussianBlur(noise, (0, 0), 2.0)
    for _ in range(int(rng.integers(6, 14))):  # ceiling lamps, brighter than white
        left = int(rng.integers(columns))
        _block(picture, left, 0, int(rng.integers(30, 160)), int(rng.integers(6, 20)), np.full(3, 330.0))
    blurred = cv2.GaussianBlur(picture, (0, 0), 0.8)
    blurred[:, -1] = blurred[:, 0]  # close the seam
    return np.asarray(blurred, dtype=np.float32)


def _block(picture: Float32Array, left: int, top: int, width: int, height: int, color: FloatArray) -> None:
    bottom = min(max(top + height, 0), picture.shape[0])
    picture[max(top, 0) : bottom, left : left + width] = color


def _any_color(rng: np.random.Generator) -> FloatArray:
    """Return a typical colour of a hall: mostly grey, dark or white, sometimes bright."""
    kind = rng.random()
    if kind < 0.35:
        return np.asarray(rng.uniform(25, 80) * rng.uniform(0.85, 1.15, 3))
    if kind < 0.6:
        return np.asarray(rng.uniform(190, 245) * rng.uniform(0.96, 1.04, 3))
    if kind < 0.8:
        return np.asarray(rng.uniform(90, 170) * np.array([0.6, 0.85, 1.0]))
    return np.asarray(rng.uniform(20, 220, 3))


def _draw_curtains(picture: Float32Array, rng: np.random.Generator) -> None:
    rows, columns = picture.shape[:2]
    for _ in range(int(rng.integers(3, 9))):
        left, width = int(rng.integers(columns)), int(rng.integers(150, 700))
        right = min(left + width, columns)
        fold = 1 + 0.18 * np.sin(np.arange(left, right) * math.tau / rng.uniform(10, 30) + rng.uniform(0, math.tau))
        color = _any_color(rng) if rng.random() < 0.5 else np.full(3, rng.uniform(25, 60))
        picture[: rows - int(rng.integers(0, 12)), left:right] = fold[:, None] * color


def _draw_windows(picture: Float32Array, rng: np.random.Generator) -> None:
    rows, columns = picture.shape[:2]
    for _ in range(int(rng.integers(2, 7))):
        left, width = int(rng.integers(columns)), int(rng.integers(60, 200))
        top, height = int(rng.integers(0, rows // 2)), int(rng.integers(60, rows // 2))
        _block(picture, left, top, width, height, np.full(3, rng.uniform(170, 240)))  # frame
        pane = np.array([1.05, 1.0, 0.96]) * rng.uniform(230, 320)
        for k in range(2):
            _block(picture, left + 4 + k * width // 2, top + 4, width // 2 - 8, height - 8, pane)


def _draw_furniture(picture: Float32Array, rng: np.random.Generator) -> None:
    rows, columns = picture.shape[:2]
    for _ in range(int(rng.integers(30, 70))):
        left, width = int(rng.integers(columns)), int(rng.integers(15, 170))
        height = int(rng.integers(20, 120))
        color = _any_color(rng)
        kind = rng.random()
        if kind < 0.45:  # a box or cupboard, with a lighter edge
            _block(picture, left, rows - height, width, height, color)
            _block(picture, left, rows - height, width, 3, np.minimum(color * 1.4, 250))
        elif kind < 0.75:  # a table: top and legs, light tubes as likely as not
            leg = np.full(3, 225.0) if rng.random() < 0.5 else color
            _block(picture, left, rows - height, width, 5, color)
            for at in (left, left + width - 5):
                _block(picture, at, rows - height, int(rng.integers(3, 6)), height, leg)
        else:  # a pole or a roll-up banner
            _block(picture, left, rows - 2 * height, int(rng.integers(4, 60)), 2 * height, color)


def _draw_people(picture: Float32Array, rng: np.random.Generator) -> None:
    rows, columns = picture.shape[:2]
    for _ in range(int(rng.integers(4, 14))):
        at = int(rng.integers(30, columns - 30))
        trousers, shirt = _any_color(rng), _any_color(rng)
        skin = np.array([120.0, 150.0, 205.0]) * rng.uniform(0.5, 1.1)
        stride = int(rng.integers(6, 16))
        for side in (-1, 1):
            _block(picture, at + side * stride - 6, rows - 70, 12, 68, trousers)
        _block(picture, at - 16, rows - 122, 32, 54, shirt)
        _block(picture, at - 6, rows - 140, 14, 18, skin)


@lru_cache(maxsize=32)
def room_panorama(seed: int) -> Float32Array:
    """Return a room's round wall (rows, columns, 3) float32 BGR, row 0 at the floor, columns counter-clockwise."""
    rng = np.random.default_rng([seed, 0x600D])
    rows = round(ROOM_HEIGHT_M * ROOM_ROWS_PER_M)
    wall = rng.uniform(110, 200) * rng.uniform(0.85, 1.1, 3)
    shade = np.interp(np.arange(_ROOM_COLUMNS), np.linspace(0, _ROOM_COLUMNS, 13), _closed(rng.uniform(0.6, 1.1, 12)))
    view = np.ones((rows, _ROOM_COLUMNS, 1)) * wall * shade[None, :, None]

    def draw(bearing: float, width: float, low_m: float, high_m: float, color: FloatArray) -> None:
        columns = (round(bearing * _ROOM_COLUMNS) + np.arange(max(1, round(width * _ROOM_COLUMNS)))) % _ROOM_COLUMNS
        view[round(low_m * ROOM_ROWS_PER_M) : round(high_m * ROOM_ROWS_PER_M), columns] = color

    for _ in range(rng.integers(1, 5)):  # windows
        draw(
            rng.random(), rng.uniform(0.02, 0.08), 0.9, rng.uniform(2.0, 2.8), rng.uniform(225, 300) * _tint(rng, 0.06)
        )
    for _ in range(rng.integers(2, 6)):  # doors, curtains, dark areas
        draw(rng.random(), rng.uniform(0.02, 0.10), 0.0, rng.uniform(1.2, 3.0), rng.uniform(20, 60) * _tint(rng, 0.2))
    for _ in range(rng.integers(12, 28)):  # tables, boxes, cupboards
        low = float(rng.choice([0.0, 0.0, 0.6]))
        draw(
            rng.random(),
            rng.uniform(0.01, 0.06),
            low,
            low + rng.uniform(0.2, 1.0),
            rng.uniform(40, 200) * _tint(rng, 0.3),
        )
    for _ in range(rng.integers(6, 18)):  # people: trousers, shirt, head
        bearing, width = rng.random(), rng.uniform(0.010, 0.022)
        draw(bearing, width, 0.0, 0.85, rng.uniform(25, 90) * _tint(rng, 0.25))
        draw(bearing - 0.1 * width, 1.2 * width, 0.85, 1.45, rng.uniform(20, 220, 3))
        draw(bearing + 0.25 * width, 0.5 * width, 1.48, 1.72, rng.uniform(0.5, 1.0) * np.array([125.0, 155.0, 205.0]))
    view *= np.repeat(rng.normal(1.0, 0.04, (rows, _ROOM_COLUMNS // 4, 1)), 4, axis=1)
    panorama = np.clip(view, 0, 320).astype(np.float32)
    panorama.flags.writeable = False
    return panorama


def _closed(values: FloatArray) -> FloatArray:
    return np.append(values, values[0])


def _tint(rng: np.random.Generator, spread: float) -> FloatArray:
    return rng.uniform(1 - spread, 1 + spread, 3)
