"""Mirror cameras of unlike curves over carpets whose lines lie beside where the field file has them.

Paint errs by a third of a line's width, things stand about on and off the carpet, white strips lie beside it: what one
photograph of a laboratory shows.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Literal, NamedTuple

import cv2
import numpy as np

from field_models import Field
from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.calibration.omni.model import BentCurve, hyperboloid_of
from robocup_vision.camera import OmniCamera, Table
from robocup_vision.geometry import Pose2

MirrorKind = Literal["hyperboloid", "bent", "kinked"]
SIDE_PX, FINE = 480, 2
PAINT_ERROR, CARPET_MARGIN_M, BODY_RATIO = 0.3, 0.5, 0.11
MIN_FARTHEST_M, MAX_TABLE_M = 2.6, 25.0
BLUR_PX, NOISE = 0.7, 9.0


class Carpet(NamedTuple):
    """One picture, and the camera that took it."""

    frame: UInt8Array
    camera: OmniCamera


def mirror(kind: MirrorKind, rng: np.random.Generator) -> OmniCamera:
    """Draw a mirror camera half a metre and more high: centre, tilt and curve."""
    outer, height_m = float(rng.uniform(0.42, 0.48)) * SIDE_PX, float(rng.uniform(0.5, 0.8))
    horizon = outer * float(rng.uniform(1.02, 1.5))
    root = horizon * math.exp(float(rng.normal(1.2, 0.5)))
    # a hyperboloid implies its viewpoint's height, which is in proportion to the range
    implied_m = hyperboloid_of(1.0, horizon, root).implied_height_m
    assert implied_m is not None
    curve = hyperboloid_of(implied_m / height_m, horizon, root)
    u, v = (SIDE_PX / 2 + rng.normal(0.0, 6.0, 2)).tolist()
    tilt_x, tilt_y = np.radians(rng.normal(0.0, 0.8, 2)).tolist()
    inner = BODY_RATIO * SIDE_PX
    camera = OmniCamera(
        (SIDE_PX, SIDE_PX), (u, v), (inner, outer), curve, tilt_rad=(tilt_x, tilt_y), viewpoint_height_m=height_m
    )
    if kind == "hyperboloid":
        return camera
    bent = BentCurve(curve, np.linspace(inner, outer, 6), rng.normal(0.0, 0.006, 6))
    radius = np.linspace(0.5 * inner, outer, 200)
    range_m = 1.0 / bent.inverse_range_per_m(radius)
    if kind == "kinked":
        kink = float(rng.uniform(0.45, 0.65)) * outer
        range_m = np.where(radius > kink, range_m * (radius / kink) ** float(rng.uniform(0.5, 1.2)), range_m)
    usable = np.isfinite(range_m) & (range_m > 0) & (range_m < MAX_TABLE_M)
    count = len(usable) if usable.all() else int(np.argmin(usable))
    return dataclasses.replace(
        camera, floor_range=Table(radius[:count], range_m[:count]), usable_radius_px=(inner, float(radius[count - 1]))
    )


def measured_table(camera: OmniCamera, error: float, rng: np.random.Generator) -> OmniCamera:
    """Return the camera as a team would have measured it: a table so far off, level, the picture's middle as centre."""
    radius = np.linspace(0.95 * camera.usable_radius_px[0], camera.usable_radius_px[1], 18)
    along = np.linspace(0.0, 1.0, len(radius))
    off = error * np.sin(rng.uniform(0.0, math.tau) + along * rng.uniform(1.0, 4.0)) + rng.normal(0.0, 0.01, 18)
    range_m = np.exp(off) / camera.floor_range.inverse_range_per_m(radius)
    kept = np.concatenate([[True], range_m[1:] > np.maximum.accumulate(range_m)[:-1] + 1e-3])
    middle = SIDE_PX / 2, SIDE_PX / 2
    table = Table(radius[kept], range_m[kept])
    return dataclasses.replace(
        camera, floor_range=table, center_px=middle, tilt_rad=(0.0, 0.0), viewpoint_height_m=None
    )


def carpet(field: Field, kind: MirrorKind, seed: int, index: int) -> Carpet:
    """Render one picture from anywhere on a field."""
    rng = np.random.default_rng([seed, index])
    farthest_m = 0.0
    while farthest_m < MIN_FARTHEST_M:
        camera = mirror(kind, rng)
        farthest_m = float(1.0 / camera.floor_range.inverse_range_per_m(0.97 * camera.usable_radius_px[1]))
    x, y = (rng.uniform(-0.46, 0.46, 2) * (field.length_m, field.width_m)).tolist()
    return Carpet(_render(camera, field, Pose2(x, y, float(rng.uniform(-math.pi, math.pi))), rng), camera)


def map_error(camera: OmniCamera, true: OmniCamera) -> float:
    """Return how far a camera's floor map is off at worst, 0.8 to 2.5 m away, as a fraction of the range.

    NaN where one of the places is in one camera's picture alone; the cameras may be turned about their axes.
    """
    around = np.linspace(0.0, math.tau, 12, endpoint=False)
    directions = np.column_stack([np.cos(around), np.sin(around)])
    return float(
        np.max(
            [
                np.abs(np.linalg.norm(camera.pixel_to_floor(true.floor_to_pixel(r * directions)), axis=1) / r - 1)
                for r in (0.8, 1.5, 2.5)
            ]
        )
    )


def _render(camera: OmniCamera, field: Field, pose: Pose2, rng: np.random.Generator) -> UInt8Array:
    """Draw the room, the carpet, its lines and what stands there."""
    v, u = (np.mgrid[: SIDE_PX * FINE, : SIDE_PX * FINE] + 0.5) / FINE - 0.5
    pixels = np.stack([u, v], axis=-1).reshape(-1, 2)
    floor = camera.pixel_to_floor(pixels)
    known = np.asarray(np.isfinite(floor).all(axis=1))
    places = pose.transform(np.where(known[:, None], floor, 1e3))
    away = pixels - camera.center_px
    angle, radius = np.arctan2(away[:, 1], away[:, 0]), np.hypot(away[:, 0], away[:, 1])
    half = np.array([field.length_m, field.width_m]) / 2 + CARPET_MARGIN_M
    on_carpet: BoolArray = np.asarray(known & (np.abs(places) <= half).all(axis=1))
    image = rng.uniform(30.0, 220.0, (40, 3))[((angle + math.pi) / math.tau * 39.99).astype(int)]
    image[on_carpet] = np.array([60.0, 140.0, 40.0]) * rng.uniform(0.8, 1.2)
    beside = _distance_m(places[on_carpet], field, rng)
    image[np.flatnonzero(on_carpet)[beside <= field.line_width_m / 2]] = (215.0, 225.0, 220.0)
    _clutter(image, places, on_carpet, pose, field, rng)
    image *= (1.0 + 0.25 * np.cos(angle - rng.uniform(-math.pi, math.pi)))[:, None]
    for _ in range(2):
        strut = np.abs(np.angle(np.exp(1j * (angle - rng.uniform(-math.pi, math.pi))))) * radius < 4
        image[strut] = 20.0
    image[radius < 0.9 * camera.usable_radius_px[0]] = 25.0
    image[radius > camera.usable_radius_px[1] + 6] = 10.0
    fine = image.reshape(SIDE_PX, FINE, SIDE_PX, FINE, 3).mean(axis=(1, 3))
    light = cv2.GaussianBlur(fine, (0, 0), BLUR_PX)
    noisy = light + rng.normal(0.0, NOISE, light.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), np.uint8)


def _distance_m(points: FloatArray, field: Field, rng: np.random.Generator) -> FloatArray:
    """Distances (N,) from the nearest line or arc as painted."""
    std = PAINT_ERROR * field.line_width_m
    nearest = np.full(len(points), np.inf)
    for line in np.asarray(field.lines, np.float64):
        start, way = line[:2], line[2:] - line[:2]
        across = np.array([-way[1], way[0]]) / np.hypot(*way)
        ends = np.stack([start, line[2:]]) + rng.normal(0.0, std, (2, 1)) * across
        start, way = ends[0], ends[1] - ends[0]
        part = np.clip((points - start) @ way / (way @ way), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(points - start - part[:, None] * way, axis=1))
    for x, y, radius, start_rad, extent_rad in np.asarray(field.arcs, np.float64)[:, :5]:
        off = points - (np.array([x, y]) + rng.normal(0.0, std, 2))
        on_arc = np.mod(np.arctan2(off[:, 1], off[:, 0]) - start_rad, math.tau) <= extent_rad
        gap = np.abs(np.hypot(off[:, 0], off[:, 1]) - radius - rng.normal(0.0, std))
        nearest = np.where(on_arc, np.minimum(nearest, gap), nearest)
    return nearest


def _clutter(
    image: FloatArray, places: FloatArray, on_carpet: BoolArray, pose: Pose2, field: Field, rng: np.random.Generator
) -> None:
    """Stand things about, each with what it hides; lay white strips beside the carpet and old tape on it."""
    size = np.array([field.length_m, field.width_m])
    off = places - pose.array[:2]
    bearing, away = np.arctan2(off[:, 1], off[:, 0]), np.hypot(off[:, 0], off[:, 1])
    for _ in range(int(rng.integers(3, 9))):
        x, y = rng.uniform(-0.62, 0.62, 2) * size - pose.array[:2]
        distance, width = math.hypot(x, y), float(rng.uniform(0.03, 0.25))
        aside = np.abs(np.angle(np.exp(1j * (bearing - math.atan2(y, x))))) * distance
        hidden = (aside < width) & (away > distance) & (away < distance * float(rng.uniform(1.3, 4.0)))
        if distance > 0.5:
            image[hidden] = rng.choice([15.0, 60.0, 120.0, 200.0, 235.0]) + rng.uniform(-10.0, 10.0, 3)
    for on, count, half_m in ((~on_carpet, int(rng.integers(2, 6)), (0.4, 2.5)), (on_carpet, 2, (0.2, 0.6))):
        for _ in range(count):
            turn, middle = float(rng.uniform(0.0, math.pi)), rng.uniform(-0.6, 0.6, 2) * size
            along = (places - middle) @ [math.cos(turn), math.sin(turn)]
            across = (places - middle) @ [-math.sin(turn), math.cos(turn)]
            strip = on & (np.abs(along) < rng.uniform(*half_m)) & (np.abs(across) < rng.uniform(0.02, 0.06))
            image[strip] = rng.uniform(150.0, 230.0)
