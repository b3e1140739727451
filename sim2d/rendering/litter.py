"""Paints over a mirror camera's picture what a laboratory has: worn lines, cables, rulers, robots and their parts."""

from __future__ import annotations

import cv2
import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera import OmniCamera

THINGS = (3, 40)
# of the picture's smaller side: a cable's steps, a ruler's sides, a robot's reach
CABLE_STEP, RULER_WIDTH, RULER_LENGTH, ROBOT_REACH = 0.03, (0.03, 0.12), (0.1, 0.4), 0.05
BRIGHT_RATE = 0.5
# spots of worn paint, their radii and the filter that takes lines away, of the picture's smaller side
WORN_SPOTS, WORN_RADIUS, WORN_FILTER = 200, (0.01, 0.05), 0.04


def littered(frame: UInt8Array, camera: OmniCamera, rng: np.random.Generator) -> UInt8Array:
    """Return a picture (H, W, 3) with things painted over it, some bright, some with straight edges, at random."""
    picture = frame.copy()
    for _ in range(int(rng.integers(THINGS[0], THINGS[1] + 1))):
        angle, radius = rng.uniform(0.0, 2 * np.pi), rng.uniform(*camera.usable_radius_px)
        at = np.asarray(camera.center_px) + radius * np.array([np.cos(angle), np.sin(angle)])
        (_cable, _ruler, _robot, _robot)[int(rng.integers(4))](picture, at, rng)
    return picture


def worn(frame: UInt8Array, rng: np.random.Generator) -> UInt8Array:
    """Return a picture (H, W, 3) in which what is narrow has gone from spots at random."""
    height, width = frame.shape[:2]
    side = min(height, width)
    spots = np.zeros((height, width), dtype=np.uint8)
    for _ in range(int(rng.integers(WORN_SPOTS))):
        at, radius = (int(rng.integers(width)), int(rng.integers(height))), round(side * rng.uniform(*WORN_RADIUS))
        cv2.circle(spots, at, radius, 1, -1)
    smooth = cv2.medianBlur(frame, 2 * round(WORN_FILTER * side / 2) + 1)
    return np.asarray(np.where(spots[..., None] > 0, smooth, frame), dtype=np.uint8)


def _color(rng: np.random.Generator) -> tuple[int, ...]:
    if rng.random() < BRIGHT_RATE:
        return (int(rng.integers(150, 250)),) * 3
    return tuple(rng.integers(0, 256, 3).tolist())


def _cable(picture: UInt8Array, at: FloatArray, rng: np.random.Generator) -> None:
    side = min(picture.shape[:2])
    turns = rng.uniform(0.0, 2 * np.pi) + np.cumsum(rng.normal(0.0, 0.3, 20))
    path = at + CABLE_STEP * side * np.cumsum(np.stack([np.cos(turns), np.sin(turns)], axis=1), axis=0)
    thick = int(rng.integers(1, max(3, side // 80)))
    cv2.polylines(picture, [np.rint(path).astype(np.int32)], False, _color(rng), thick, cv2.LINE_AA)


def _ruler(picture: UInt8Array, at: FloatArray, rng: np.random.Generator) -> None:
    side = min(picture.shape[:2])
    size = side * rng.uniform(*RULER_WIDTH), side * rng.uniform(*RULER_LENGTH)
    corners = cv2.boxPoints(((float(at[0]), float(at[1])), size, float(rng.uniform(0.0, 180.0))))
    cv2.fillPoly(picture, [corners.astype(np.int32)], _color(rng))
    marks = int(rng.integers(14))
    for along in (np.arange(marks) + 0.5) / max(marks, 1):
        ends = corners[[0, 3]] + along * (corners[[1, 2]] - corners[[0, 3]])
        cv2.polylines(picture, [ends.astype(np.int32)], False, _color(rng), int(rng.integers(1, max(2, side // 80))))


def _robot(picture: UInt8Array, at: FloatArray, rng: np.random.Generator) -> None:
    side = min(picture.shape[:2])
    for _ in range(int(rng.integers(3, 25))):
        u, v = np.rint(at + rng.normal(0.0, ROBOT_REACH * side, 2)).astype(int).tolist()
        if rng.random() < 0.5:
            cv2.circle(picture, (u, v), int(rng.integers(1, max(2, side // 25))), _color(rng), -1)
        else:
            du, dv = np.rint(rng.normal(0.0, ROBOT_REACH * side, 2)).astype(int).tolist()
            cv2.line(picture, (u, v), (u + du, v + dv), _color(rng), int(rng.integers(1, max(2, side // 50))))
