"""Crossings of two straight stretches of line at right angles, with their visible arms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.markings.correlated_errors import FloorErrors
from robocup_vision.perception.markings.marking import GATE_SIGMAS, KINDS, MAX_STD_M, Crossing, CrossingKind
from robocup_vision.perception.markings.straight import Straight, is_bare, marked_at

# an arm is sampled from this distance to the crossing's centre (line widths, pixels) to a multiple of it
_ARM_WIDTHS, _ARM_PX = 2.0, 6.0
_ARM_ENDS = 3.0
_SAMPLES = 12
# least ratio of an arm's samples that show line, or carpet if the arm does not exist
_ARM_RATIO = 0.6
# largest distance of a line's end from its crossing, in line widths, and in pixels
_CROSSING_REACH_WIDTHS, _CROSSING_REACH_PX = 2.5, 8.0
# largest deviation from a right angle, beyond the lines' errors
_SQUARE_SLACK_RAD = math.radians(3.0)


@dataclass(frozen=True, slots=True, eq=False)
class LinePicture:
    """Pixels of a frame that show line, and those that show bare carpet."""

    points: LinePoints
    line: UInt8Array

    @classmethod
    def of(cls, points: LinePoints, size_px: tuple[int, int]) -> LinePicture:
        """Return the picture of some line points."""
        width, height = size_px
        line = np.zeros((height, width), dtype=np.uint8)
        u, v = np.rint(points.pixels).astype(np.int64).T
        line[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)] = 1
        return cls(points, np.asarray(cv2.dilate(line, np.ones((5, 5), np.uint8)), dtype=np.uint8))

    def shows_line(self, pixels: FloatArray) -> BoolArray:
        """Whether pixels (..., 2) lie on line points."""
        return marked_at(self.line, pixels)

    def shows_carpet(self, pixels: FloatArray) -> BoolArray:
        """Whether pixels (..., 2) show bare carpet."""
        return is_bare(self.points, pixels)


def find_crossings(
    lines: list[Straight], picture: LinePicture, errors: FloorErrors, line_width_m: float
) -> list[Crossing]:
    """Return the crossings of stretches of line; arguments as in `find_straight`."""
    found = []
    turns = [_turns_rad(line, errors) for line in lines]
    for i, one in enumerate(lines):
        for j in range(i):
            crossing = _crossing(one, lines[j], turns[i] - turns[j], picture, errors, line_width_m)
            if crossing is not None:
                found.append(crossing)
    return sorted(found, key=lambda one: float(np.trace(one.covariance)))


def _turns_rad(line: Straight, errors: FloorErrors) -> FloatArray:
    """Return the rotation (K,) of a line by one standard deviation of each error of the camera, radians."""
    ends = line.at(np.array(line.ends_m))
    shifts = errors.shifts_m(errors.camera.floor_to_pixel(ends))
    length_m = max(line.ends_m[1] - line.ends_m[0], 1e-9)
    return np.asarray(-(line.normal @ (shifts[1] - shifts[0])) / length_m)


def _crossing(
    one: Straight,
    two: Straight,
    turn_rad: FloatArray,
    picture: LinePicture,
    errors: FloorErrors,
    line_width_m: float,
) -> Crossing | None:
    apart = math.remainder(one.angle_rad - two.angle_rad - math.pi / 2, math.pi)
    std = math.sqrt(float(one.covariance[0, 0] + two.covariance[0, 0] + turn_rad @ turn_rad))
    if abs(apart) > GATE_SIGMAS * std + _SQUARE_SLACK_RAD or std > 0.5:
        return None
    normals = np.stack([one.normal, two.normal])
    if abs(np.linalg.det(normals)) < 0.3:
        return None
    inverse = np.linalg.inv(normals)
    place = inverse @ [one.distance_m, two.distance_m]
    camera = errors.camera
    pixel = camera.floor_to_pixel(place)
    if not np.isfinite(pixel).all():
        return None
    reach_m = _CROSSING_REACH_WIDTHS * line_width_m
    for line in (one, two):
        at, (low, high) = float(place @ line.along), line.ends_m
        nearest = line.at(np.array(min(max(at, low), high)))
        gap_px = float(np.hypot(*(camera.floor_to_pixel(nearest) - pixel)))
        if max(low - at, at - high) > reach_m and gap_px > _CROSSING_REACH_PX:
            return None
    # the lines' own errors first, then those of the camera
    own = np.zeros((2, 2))
    for k, line in enumerate((one, two)):
        row = np.array([-float(place @ line.along), 1.0])
        own[k, k] = float(row @ line.covariance @ row)
    shifts = errors.shifts_m(pixel)
    covariance = inverse @ own @ inverse.T + shifts @ shifts.T
    if not np.linalg.eigvalsh(covariance)[1] <= MAX_STD_M**2:
        return None
    arms = _arms(place, (one, two), picture, errors, line_width_m)
    if arms is None:
        return None
    kind, directions = arms
    return Crossing(float(place[0]), float(place[1]), covariance, kind, directions)


def _arms(
    place: FloatArray, lines: tuple[Straight, Straight], picture: LinePicture, errors: FloorErrors, line_width_m: float
) -> tuple[CrossingKind | None, tuple[float, ...]] | None:
    """Return the kind and the visible arms; None if one of the lines has no arm."""
    camera = errors.camera
    ways = np.stack([sign * line.along for line in lines for sign in (1, -1)])
    pixels = camera.floor_to_pixel(place + 0.5 * line_width_m * ways)
    px_per_m = np.hypot(*(pixels - camera.floor_to_pixel(place)).T) / (0.5 * line_width_m)
    begin = np.maximum(_ARM_WIDTHS * line_width_m, _ARM_PX / np.maximum(px_per_m, 1e-9))
    reach = begin[:, None] * np.linspace(1.0, _ARM_ENDS, _SAMPLES)
    samples = camera.floor_to_pixel(place + reach[..., None] * ways[:, None])
    goes_on = picture.shows_line(samples).mean(axis=1) >= _ARM_RATIO
    ends = picture.shows_carpet(samples).mean(axis=1) >= _ARM_RATIO
    known = goes_on | ends
    of_one, of_two = goes_on[:2], goes_on[2:]
    if not of_one.any() or not of_two.any():
        return None
    kind = KINDS[int(goes_on.sum())] if known.all() else None
    return kind, tuple(math.atan2(y, x) for x, y in ways[goes_on].tolist())
