"""A lecture hall with ambiguous landmarks, like that of Ogawa et al. (2011): many of its parts are repeated.

It has rows of one kind of chair, a few posters many times, partitions of one pattern, and tiles. People and changing
light are in `bustle.py`.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.geometry import Pose2
from sim2d.rendering.hall import textures as draw
from sim2d.rendering.hall.bustle import Bustle, populated
from sim2d.rendering.hall.hall import Hall, HallBuilder, HallLight
from sim2d.rendering.hall.solids import Panel, Vector, box, inward
from sim2d.rendering.sensor import Sensor

SIZE_M: Vector = (13.0, 7.0, 3.0)
# the way through it: straight between chairs and the wall, a quarter turn to the left, straight; 9.9 m
_START_M = (-5.2, -1.9)
_AHEAD_M, _TURN_M = 6.6, 1.2
WAY_M = 9.9
_CHAIR_PITCH_M = (0.85, 0.56)
# a small camera in poor light
LECTURE_SENSOR = Sensor(noise_sigma=3.5, blur_px=0.6)
_LAMPS = tuple((x, y, 2.7, 1.6) for x in (-4.5, -1.5, 1.5, 4.5) for y in (-1.7, 1.7))
# ways of the people: across the aisle, along it, and around its end
_WALKS_M = (
    ((1.2, -2.9), (1.2, 2.2)),
    ((3.0, -2.4), (3.4, 2.6)),
    ((-4.0, -2.5), (1.5, -2.5)),
    ((4.2, -1.6), (2.6, -3.0)),
    ((2.0, 2.6), (5.6, 1.2)),
    ((1.6, -0.6), (5.0, -2.9)),
)


def make_lecture_hall(seed: int) -> Hall:
    """Build a lecture hall; the same seed gives the same hall."""
    rng = np.random.default_rng([seed, 0x1EC7])
    length, depth, height = SIZE_M
    built = HallBuilder(SIZE_M)
    panels, wear = built.panels, built.wear
    designs = [draw.notice(rng) for _ in range(3)]
    posters = [(wear(design), design.shape[1] / design.shape[0]) for design in designs]
    brick = draw.bricks(rng)
    for wall, (corner, along, width) in enumerate(built.walls):
        built.add_wall(wall, wear(draw.tiled(brick, width, height)))
        # every wall has the same row of the same posters
        for number in range(int((width - 0.5) / 1.05)):
            texture, shape = posters[number % len(posters)]
            high = 0.78
            before = inward(along, 0.01)
            start = 0.4 + 1.05 * number
            x, y, _ = (float(c + a * start + n) for c, a, n in zip(corner, along, before, strict=True))
            panels.append(Panel((x, y, 1.05), along, (0.0, 0.0, 1.0), (high * shape, high), texture, is_poster=True))
    built.add_floor(wear(draw.tiled(draw.carpet_tile(rng), length, depth)))
    built.add_ceiling(wear(draw.tiled(draw.ceiling_tile(rng), length, depth)))

    skins = (wear(draw.fabric(rng)), wear(draw.steel(rng)))
    for row in range(8):
        for column in range(5):
            x = -4.6 + _CHAIR_PITCH_M[0] * row
            y = -0.7 + _CHAIR_PITCH_M[1] * column
            panels += _chair(Pose2(x, y, float(rng.normal(0, 0.04))), skins)
    for number in range(9):  # a row along the wall, facing the hall
        panels += _chair(Pose2(-4.8 + 0.9 * number, -3.1, math.pi / 2 + float(rng.normal(0, 0.04))), skins)
    pattern = wear(draw.partition(rng))
    for x, y, yaw in ((-0.6, 3.05, 0.0), (1.0, 3.05, 0.0), (4.6, 2.3, 0.5), (4.9, -2.3, 1.2), (5.3, -0.9, 1.5)):
        panels += box(Pose2(x, y, yaw), (1.4, 0.06, 1.75), (pattern, pattern))
    return built.hall


def visit(hall: Hall, seed: int, *, level: float = 0.9) -> tuple[Hall, Bustle]:
    """Add light and people by a seed; return the hall with the textures of their clothes added, and its movement."""
    rng = np.random.default_rng([seed, 0xB057])
    moved = [tuple(tuple((np.array(end) + rng.uniform(-0.2, 0.2, 2)).tolist()) for end in walk) for walk in _WALKS_M]
    ways = [((a[0], a[1]), (b[0], b[1])) for a, b in moved]
    return populated(hall, ways, HallLight(level=level, ambient=0.4, lamps=_LAMPS), rng)


def way(count: int, *, shift_m: float = 0.0) -> list[Pose2]:
    """Return poses evenly spaced along the way, looking ahead, `shift_m` to its left."""
    poses = []
    quarter_m = _TURN_M * math.pi / 2
    for s in np.linspace(0.0, WAY_M, count):
        turned = min(max((float(s) - _AHEAD_M) / _TURN_M, 0.0), math.pi / 2)
        on = max(float(s) - _AHEAD_M - quarter_m, 0.0)
        x = _START_M[0] + min(float(s), _AHEAD_M) + _TURN_M * math.sin(turned)
        y = _START_M[1] + _TURN_M * (1 - math.cos(turned)) + on
        poses.append(Pose2(x - shift_m * math.sin(turned), y + shift_m * math.cos(turned), turned))
    return poses


def _chair(place: Pose2, skins: tuple[int, int]) -> list[Panel]:
    """Return a chair that looks along the heading: seat and back of fabric, four legs of steel."""
    cloth, steel = skins
    seat = box(place, (0.42, 0.44, 0.05), (cloth, cloth), 0.42)
    back = box(place.compose(Pose2(-0.2, 0.0, 0.0)), (0.035, 0.42, 0.34), (cloth, cloth), 0.52)
    parts = [*seat, *back]
    for x in (-0.2, 0.19):
        for y in (-0.2, 0.2):
            high = 0.52 if x < 0 else 0.42
            parts += box(place.compose(Pose2(x, y, 0.0)), (0.025, 0.025, high), (steel, steel))[:4]
    return parts
