"""Synthetic training pictures of many kinds of balls among objects that look similar, at the classifier's scale.

A scene is carpet with paint, robots, feet and clutter, seen by a camera somewhere above the floor. A ball has a radius
of about `CROP_RADIUS_PX`. Round objects much smaller or larger than that are negative examples.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.perception.balls.network import CROP_RADIUS_PX

SCENE_PX = (166, 238)
# scenes are drawn at this multiple of their size and reduced, so that edges are as smooth as behind a lens
_FINE = 2
# radii of balls, and of too small and too large ones, which are negative examples; as multiples of `CROP_RADIUS_PX`
_SIZES, _TOO_SMALL, _TOO_LARGE = (0.72, 1.4), (0.25, 0.5), (2.0, 3.5)

Floats = npt.NDArray[np.float32]


class Scene(NamedTuple):
    """A picture and the balls in it."""

    #: (H, W, 3) uint8: BGR.
    image: UInt8Array
    #: (N, 3) float64: centre u, v and radius, pixels, of the balls of which more than 60 % is visible.
    balls: FloatArray
    #: (N, 3) float64: the same of balls that are hidden more: neither positive nor negative examples.
    unsure: FloatArray


def draw_scene(rng: np.random.Generator) -> Scene:
    """Draw a scene with random light, carpet, objects and balls."""
    height, width = (_FINE * side for side in SCENE_PX)
    radius = _FINE * CROP_RADIUS_PX
    squash = float(rng.uniform(0.12, 0.8))
    carpet = _carpet_color(rng)
    canvas = _textured(rng, (height, width), carpet, 0.15)
    for _ in range(rng.integers(0, 5)):
        _draw_paint(rng, canvas, radius, squash)
    edge = int(rng.uniform(0.0, 0.6) * height) if rng.random() < 0.55 else 0
    if edge:
        _draw_background(rng, canvas, edge, radius)
    nearest = max(edge, 0.1 * height)
    # far objects, which are seen in front of the background
    at_edge = [edge + radius * float(rng.uniform(0.1, 2.5)) for _ in range(rng.integers(1, 4) if edge else 0)]
    things = sorted([*rng.uniform(nearest, height * 1.1, rng.integers(3, 11)), *at_edge])
    balls: list[tuple[float, float, float]] = []
    covered = np.zeros((height, width), dtype=np.uint8)

    def add_ball(u: float, v: float, r: float) -> None:
        _draw_ball(rng, canvas, (u, v), r, carpet, on_floor=True)
        balls.append((u, v, r))
        cv2.circle(covered, (int(u), int(v)), int(r), len(balls), -1)

    for v in things:
        u = float(rng.uniform(-0.02, 1.02) * width)
        if rng.random() < 0.62:
            r = radius * float(np.exp(rng.uniform(*np.log(_SIZES))))
            add_ball(u, v - r, r)
        else:
            before = canvas.copy()
            _draw_other(rng, canvas, (u, float(v)), radius, carpet)
            covered[(before != canvas).any(axis=2)] = 0
            if rng.random() < 0.35:
                # robots and people often stand at a ball
                r = radius * float(np.exp(rng.uniform(*np.log(_SIZES))))
                add_ball(u + radius * float(rng.uniform(-3, 3)), v - 0.7 * r, r)
    if rng.random() < 0.15:
        _draw_rim(rng, canvas, covered)
    shown: list[tuple[float, float, float]] = []
    unsure: list[tuple[float, float, float]] = []
    for number, (u, v, r) in enumerate(balls, start=1):
        ratio = np.count_nonzero(covered == number) / (np.pi * r * r)
        place = ((u + 0.5) / _FINE - 0.5, (v + 0.5) / _FINE - 0.5, r / _FINE)
        (shown if ratio > 0.6 else unsure).append(place)
    small = np.asarray(cv2.resize(canvas, SCENE_PX[::-1], interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return Scene(_taken(rng, small), np.array(shown).reshape(-1, 3), np.array(unsure).reshape(-1, 3))


def _draw_rim(rng: np.random.Generator, canvas: UInt8Array, covered: UInt8Array) -> None:
    """Blacken the picture outside a large circle: the rim of a wide lens's image, or a part of the robot itself."""
    height, width = canvas.shape[:2]
    large = rng.uniform(1.5, 6) * width
    turn = rng.uniform(0, 2 * np.pi)
    away = large + rng.uniform(0.1, 0.45) * width
    center = (int(width / 2 + away * np.cos(turn)), int(height / 2 + away * np.sin(turn)))
    shade = _tuple(np.full(3, rng.uniform(0, 25), np.float32))
    cv2.circle(canvas, center, int(large), shade, -1, cv2.LINE_AA)
    cv2.circle(covered, center, int(large), 0, -1)


def _carpet_color(rng: np.random.Generator) -> Floats:
    """Return the BGR, 0 to 255, of a green carpet under random light."""
    return _of_hsv(rng.uniform(38, 85), rng.uniform(70, 230), rng.uniform(45, 200))


def _of_hsv(hue: float, saturation: float, value: float) -> Floats:
    pixel = np.array([[[hue, saturation, value]]], dtype=np.uint8)
    return np.asarray(cv2.cvtColor(pixel, cv2.COLOR_HSV2BGR)[0, 0], dtype=np.float32)


def _any_color(rng: np.random.Generator) -> Floats:
    if rng.random() < 0.45:
        return np.full(3, rng.choice([rng.uniform(8, 60), rng.uniform(60, 170), rng.uniform(170, 255)]), np.float32)
    return _of_hsv(rng.uniform(0, 180), rng.uniform(60, 255), rng.uniform(40, 255))


def _ball_color(rng: np.random.Generator) -> Floats:
    """Return the BGR of a ball's cover: mostly white, yellow or orange, sometimes any other colour."""
    kind = rng.random()
    if kind < 0.3:
        return np.full(3, rng.uniform(170, 255), np.float32) * rng.uniform(0.9, 1.0, 3).astype(np.float32)
    if kind < 0.75:
        return _of_hsv(rng.uniform(3, 33), rng.uniform(90, 255), rng.uniform(140, 255))
    # not as dark as robots and shoes
    return _of_hsv(rng.uniform(0, 180), rng.uniform(60, 255), rng.uniform(130, 255))


def _textured(rng: np.random.Generator, shape: tuple[int, int], color: Floats, max_std: float) -> UInt8Array:
    """Return a picture of one colour under uneven light; `max_std` bounds the standard deviation of log brightness."""
    height, width = (max(side // 4, 2) for side in shape)
    light = np.zeros((height, width), dtype=np.float32)
    for cells in (3, 9, 40):
        rough = rng.normal(0.0, rng.uniform(0.0, max_std), (cells, cells)).astype(np.float32)
        light += cv2.resize(rough, (width, height), interpolation=cv2.INTER_LINEAR)
    light += np.linspace(rng.uniform(-0.25, 0.25), rng.uniform(-0.25, 0.25), height, dtype=np.float32)[:, None]
    coarse = np.clip(np.exp(light)[..., None] * color, 0, 255).astype(np.uint8)
    return np.asarray(cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def _tuple(color: Floats) -> tuple[float, float, float]:
    return float(color[0]), float(color[1]), float(color[2])


def _draw_paint(rng: np.random.Generator, canvas: UInt8Array, radius: float, squash: float) -> None:
    """Draw a line, an arc or a mark of paint, flat on the floor."""
    height, width = canvas.shape[:2]
    level = rng.uniform(150, 255)
    color = _tuple(np.array([level * rng.uniform(0.8, 1.0), level, level * rng.uniform(0.9, 1.0)], np.float32))
    thick = radius * rng.uniform(0.2, 1.6)
    kind = rng.random()
    if kind < 0.15:
        center = (int(rng.uniform(0, width)), int(rng.uniform(0, height)))
        mark = radius * rng.uniform(0.5, 1.8)
        cv2.ellipse(canvas, center, (int(mark), max(int(mark * squash), 1)), 0, 0, 360, color, -1)
    elif kind < 0.35:
        large = radius * rng.uniform(3, 25)
        center = (int(rng.uniform(-width / 2, 1.5 * width)), int(rng.uniform(-height / 2, 1.5 * height)))
        axes = (int(large), max(int(large * squash), 2))
        cv2.ellipse(canvas, center, axes, 0, 0, 360, color, max(int(thick * (0.5 + squash / 2)), 1), cv2.LINE_AA)
    else:
        start = rng.uniform(0, 1, 2) * (width, height)
        angle = rng.uniform(0, np.pi)
        along = np.array([np.cos(angle), squash * np.sin(angle)])
        across = np.array([-np.sin(angle), squash * np.cos(angle)]) * thick / 2
        ends = [start - 3 * width * along, start + (0 if rng.random() < 0.3 else 3 * width) * along]
        corners = np.array([ends[0] - across, ends[0] + across, ends[1] + across, ends[1] - across])
        cv2.fillConvexPoly(canvas, corners.astype(np.int32), color, cv2.LINE_AA)


def _draw_background(rng: np.random.Generator, canvas: UInt8Array, edge: int, radius: float) -> None:
    """Draw the background above row `edge`: boards, walls, and clutter of any size."""
    width = canvas.shape[1]
    canvas[:edge] = _textured(rng, (edge, width), _any_color(rng), 0.3)
    if rng.random() < 0.5:
        # a board or wall of one colour at the carpet's end, half of them with a dark foot
        tall = min(int(radius * np.exp(rng.uniform(np.log(1.5), np.log(12)))), edge)
        level = rng.choice([rng.uniform(130, 250), rng.uniform(10, 80)])
        color = np.full(3, level, np.float32) * rng.uniform(0.85, 1.1, 3).astype(np.float32)
        canvas[edge - tall : edge] = _textured(rng, (max(tall, 1), width), color, 0.1)[:tall]
        if rng.random() < 0.5:
            foot = min(int(radius * rng.uniform(0.2, 1.2)), tall)
            canvas[edge - foot : edge] = (canvas[edge - foot : edge] * rng.uniform(0.1, 0.6)).astype(np.uint8)
    for _ in range(rng.integers(0, 40)):
        size = radius * np.exp(rng.uniform(np.log(0.3), np.log(8), 2))
        corner = rng.uniform((-10, -10), (width, edge))
        low = np.minimum(corner + size, (width + 10, edge))
        if rng.random() < 0.7:
            cv2.rectangle(canvas, corner.astype(int).tolist(), low.astype(int).tolist(), _tuple(_any_color(rng)), -1)
        else:
            middle, axes = ((corner + low) / 2).astype(int).tolist(), np.abs((low - corner) / 2).astype(int).tolist()
            angle = float(rng.uniform(0, 180))
            cv2.ellipse(canvas, middle, axes, angle, 0, 360, _tuple(_any_color(rng)), -1, cv2.LINE_AA)


def _draw_other(
    rng: np.random.Generator, canvas: UInt8Array, foot: tuple[float, float], radius: float, carpet: Floats
) -> None:
    """Draw a negative example with its foot at a pixel: a robot, a leg, a shoe, a box, a ball of another size."""
    u, v = foot
    kind = rng.random()
    color = _tuple(_any_color(rng))
    if kind < 0.22:
        ratio = rng.uniform(*(_TOO_SMALL if rng.random() < 0.4 else _TOO_LARGE))
        center = (u, v - radius * ratio)
        _draw_ball(rng, canvas, center, radius * ratio, carpet, on_floor=rng.random() < 0.6)
        return
    _draw_shadow(rng, canvas, (u, v), radius * rng.uniform(1, 4))
    if kind < 0.5:
        # a robot: a dark trunk with parts
        wide, tall = radius * rng.uniform(2, 6), radius * rng.uniform(3, 12)
        body = np.full(3, rng.uniform(10, 70), np.float32) if rng.random() < 0.75 else _any_color(rng)
        corners = np.array([(-1, 0), (1, 0), (0.8, -1), (-0.8, -1)]) * (wide / 2, tall) + (u, v)
        cv2.fillConvexPoly(canvas, corners.astype(np.int32), _tuple(body), cv2.LINE_AA)
        for _ in range(rng.integers(2, 14)):
            at = (int(u + rng.uniform(-0.5, 0.5) * wide), int(v - rng.uniform(0, 1) * tall))
            part = radius * np.exp(rng.uniform(np.log(0.15), np.log(1.3), 2))
            shade = _tuple(_any_color(rng) if rng.random() < 0.5 else body * np.float32(rng.uniform(0.4, 2.5)))
            if rng.random() < 0.5:
                cv2.ellipse(canvas, at, (int(part[0]), int(part[1])), 0, 0, 360, shade, -1, cv2.LINE_AA)
            else:
                cv2.rectangle(canvas, at, (int(at[0] + part[0]), int(at[1] + part[1])), shade, -1)
    elif kind < 0.75:
        # legs and shoes
        for side in (-1, 1)[: rng.integers(1, 3)]:
            thick = radius * rng.uniform(0.4, 1.4)
            beside = u + side * radius * rng.uniform(0.7, 1.8)
            top = (beside + radius * rng.uniform(-1, 1), v - radius * rng.uniform(3, 12))
            cv2.line(canvas, (int(beside), int(v - thick / 2)), (int(top[0]), int(top[1])), color, max(int(thick), 1))
            shoe = (int(radius * rng.uniform(0.5, 1.8)), int(radius * rng.uniform(0.3, 0.8)))
            cv2.ellipse(
                canvas, (int(beside), int(v - shoe[1])), shoe, 0, 0, 360, _tuple(_any_color(rng)), -1, cv2.LINE_AA
            )
    elif kind < 0.9:
        # boxes and posts, some as large as a ball
        size = radius * np.exp(rng.uniform(np.log(0.4), np.log(3), 2))
        if rng.random() < 0.4:
            size[1] *= rng.uniform(3, 8)
        corners = np.array([(-1, 0), (1, 0), (1, -2), (-1, -2)]) * size + (u, v)
        turn = rng.normal(0.0, 0.2)
        off = corners - (u, v)
        corners = (u, v) + off @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        cv2.fillConvexPoly(canvas, corners.astype(np.int32), color, cv2.LINE_AA)
    else:
        # long and flat things, bright spots of lamps
        axes = radius * np.exp(rng.uniform(np.log(0.3), np.log(2.5), 2))
        axes[1] = axes[0] * rng.choice([rng.uniform(0.15, 0.55), rng.uniform(1.9, 4)])
        middle = (int(u), int(v - axes[1]))
        cv2.ellipse(canvas, middle, (int(axes[0]), max(int(axes[1]), 1)), 0, 0, 360, color, -1, cv2.LINE_AA)


def _draw_shadow(rng: np.random.Generator, canvas: UInt8Array, foot: tuple[float, float], radius: float) -> None:
    """Darken the floor around a foot."""
    height, width = canvas.shape[:2]
    half = int(2.5 * radius) + 1
    x0, y0 = int(foot[0]) - half, int(foot[1]) - half
    left, top, right, low = max(x0, 0), max(y0, 0), min(x0 + 2 * half, width), min(y0 + 2 * half, height)
    if right <= left or low <= top:
        return
    du = (np.arange(left, right) - foot[0] - rng.uniform(-0.6, 0.6) * radius) / (radius * rng.uniform(0.9, 1.6))
    dv = (np.arange(top, low) - foot[1]) / (radius * rng.uniform(0.25, 0.7))
    dark = 1.0 - rng.uniform(0.1, 0.75) * np.exp(-(du[None] ** 2 + dv[:, None] ** 2))
    canvas[top:low, left:right] = (canvas[top:low, left:right] * dark[..., None]).astype(np.uint8)


def _draw_ball(
    rng: np.random.Generator,
    canvas: UInt8Array,
    center: tuple[float, float],
    radius: float,
    carpet: Floats,
    *,
    on_floor: bool,
) -> None:
    """Draw a ball of any cover in the light of a hall, on the floor with its shadow."""
    if on_floor:
        _draw_shadow(rng, canvas, (center[0], center[1] + 0.85 * radius), radius)
    height, width = canvas.shape[:2]
    half = int(radius) + 2
    x0, y0 = round(center[0]) - half, round(center[1]) - half
    left, top, right, low = max(x0, 0), max(y0, 0), min(x0 + 2 * half + 1, width), min(y0 + 2 * half + 1, height)
    if right <= left or low <= top:
        return
    du = np.broadcast_to((np.arange(left, right) - center[0]) / radius, (low - top, right - left))
    dv = np.broadcast_to(((np.arange(top, low) - center[1]) / radius)[:, None], du.shape)
    if rng.random() < 0.25:
        # a wide lens stretches objects near its rim
        turn, stretch = rng.uniform(0, np.pi), np.sqrt(rng.uniform(1.0, 1.4))
        c, s = np.cos(turn), np.sin(turn)
        long, short = (c * du + s * dv) / stretch, (c * dv - s * du) * stretch
        du, dv = c * long - s * short, s * long + c * short
    away = np.hypot(du, dv)
    cover = np.clip((1.0 - away) * radius + 0.5, 0.0, 1.0)
    ahead = np.sqrt(np.clip(1.0 - away**2, 0.0, 1.0))
    normal = np.stack([du, dv, -ahead], axis=-1)
    color = _covered(rng, normal)
    light = np.array([rng.uniform(-0.7, 0.7), -1.0, rng.uniform(-0.9, 0.4)])
    light /= np.linalg.norm(light)
    ambient = rng.uniform(0.25, 0.8)
    shade = ambient + (1 - ambient) * np.clip(normal @ light, 0.0, 1.0)
    # the carpet's light from below
    bounce = rng.uniform(0.0, 0.25) * np.clip(normal[..., 1], 0.0, 1.0)
    lit = color * shade[..., None] * rng.uniform(0.7, 1.25) + bounce[..., None] * carpet
    gloss = light - np.array([0.0, 0.0, 1.0])
    gloss /= np.linalg.norm(gloss)
    lit += (rng.uniform(0, 160) * np.clip(normal @ gloss, 0, 1) ** rng.uniform(10, 60))[..., None]
    part = canvas[top:low, left:right]
    part[:] = np.clip(part + cover[..., None] * (lit - part), 0, 255).astype(np.uint8)


def _covered(rng: np.random.Generator, normal: FloatArray) -> FloatArray:
    """Return the colours (..., 3) of a ball's surface at unit normals (..., 3).

    The cover is plain, or has patches as a football, panels or stripes, turned at random.
    """
    base, other = _ball_color(rng), _any_color(rng)
    kind = rng.random()
    if kind < 0.35:
        return np.broadcast_to(base.astype(np.float64), normal.shape)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    if kind < 0.6:
        golden = (1 + 5**0.5) / 2
        corners = [(0, a, b) for a in (-1, 1) for b in (-golden, golden)]
        seeds = np.array([np.roll(corner, k) for corner in corners for k in range(3)]) / np.hypot(1, golden)
        if rng.random() < 0.7:
            other = np.full(3, rng.uniform(5, 70), np.float32)
        is_patch = (normal @ (seeds @ turn).T).max(axis=-1) > np.cos(rng.uniform(0.3, 0.45))
    elif kind < 0.85:
        seeds = rng.normal(size=(rng.integers(6, 30), 3))
        seeds /= np.linalg.norm(seeds, axis=1, keepdims=True)
        choice = rng.random(len(seeds)) < rng.uniform(0.2, 0.6)
        is_patch = choice[(normal @ seeds.T).argmax(axis=-1)]
    else:
        is_patch = np.sin(rng.uniform(3, 9) * (normal @ turn[0])) > rng.uniform(-0.2, 0.7)
    return np.where(is_patch[..., None], other, base).astype(np.float64)


def _taken(rng: np.random.Generator, image: UInt8Array) -> UInt8Array:
    """Return a picture as a camera takes it: with blur, brightness, colour cast, noise and JPEG compression."""
    pixels: Floats = image.astype(np.float32)
    if rng.random() < 0.3:
        # a far ball's crop is enlarged from fewer pixels
        coarse = cv2.resize(pixels, None, fx=(few := rng.uniform(0.5, 0.9)), fy=few, interpolation=cv2.INTER_AREA)
        pixels = np.asarray(cv2.resize(coarse, pixels.shape[1::-1], interpolation=cv2.INTER_LINEAR), np.float32)
    if rng.random() < 0.7:
        pixels = np.asarray(cv2.GaussianBlur(pixels, (0, 0), rng.uniform(0.2, 1.1)), np.float32)
    if rng.random() < 0.15:
        length = int(rng.integers(2, 5))
        kernel = np.zeros((5, 5), np.float32)
        cv2.line(kernel, (2 - length // 2, 2), (2 + length // 2, 2 + int(rng.integers(-1, 2))), 1.0)
        pixels = np.asarray(cv2.filter2D(pixels, -1, kernel / kernel.sum()), np.float32)
    gray = pixels.mean(axis=2, keepdims=True)
    pixels = gray + rng.uniform(0.55, 1.25) * (pixels - gray)
    pixels *= np.exp(rng.normal(0.0, 0.1, 3)).astype(np.float32) * np.float32(np.exp(rng.normal(0.0, 0.3)))
    pixels = np.asarray(255 * np.clip(pixels / 255, 0, 1) ** np.exp(rng.normal(0.0, 0.2)), np.float32)
    pixels += rng.uniform(0, 40) if rng.random() < 0.3 else 0.0
    pixels += rng.normal(0.0, rng.uniform(0.0, 6.0), pixels.shape).astype(np.float32)
    taken: UInt8Array = np.clip(pixels, 0, 255).astype(np.uint8)
    if rng.random() < 0.6:
        coded = cv2.imencode(".jpg", taken, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(35, 96))])[1]
        taken = np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), dtype=np.uint8)
    return taken
