"""The clutter around a field: people, furniture, windows and dark corners, drawn once from a seed."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

HEIGHT_M = 4.0
ROWS_PER_M = 24
COLUMNS = 1440


@lru_cache(maxsize=32)
def room_panorama(seed: int) -> npt.NDArray[np.float32]:
    """Return a room's round wall (rows, columns, 3) float32 BGR, row 0 at the floor, columns counter-clockwise."""
    rng = np.random.default_rng([seed, 0x600D])
    rows = round(HEIGHT_M * ROWS_PER_M)
    wall = rng.uniform(110, 200) * rng.uniform(0.85, 1.1, 3)
    shade = np.interp(np.arange(COLUMNS), np.linspace(0, COLUMNS, 13), _closed(rng.uniform(0.6, 1.1, 12)))
    view = np.ones((rows, COLUMNS, 1)) * wall * shade[None, :, None]

    def draw(bearing: float, width: float, low_m: float, high_m: float, color: npt.NDArray[np.float64]) -> None:
        columns = (round(bearing * COLUMNS) + np.arange(max(1, round(width * COLUMNS)))) % COLUMNS
        view[round(low_m * ROWS_PER_M) : round(high_m * ROWS_PER_M), columns] = color

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
    view *= np.repeat(rng.normal(1.0, 0.04, (rows, COLUMNS // 4, 1)), 4, axis=1)
    panorama = np.clip(view, 0, 320).astype(np.float32)
    panorama.flags.writeable = False
    return panorama


def _closed(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.append(values, values[0])


def _tint(rng: np.random.Generator, spread: float) -> npt.NDArray[np.float64]:
    return rng.uniform(1 - spread, 1 + spread, 3)
