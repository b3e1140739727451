"""Free floor in photographs against the boards around a small-size carpet, and the goal that stands on it.

The frames are those whose pose is known; boards and the goal's panels stand where the field file says, around one half
of a field. A bearing counts where the foot of the first of them lies in the picture at the known pose; "past": the free
range ends over 15 % beyond it, "short": over 15 % before it, which other robots and balls cause, too. Most robots move,
so that the known pose is that of another moment: three in four of the bearings that end short by method "edges" are in
two frames whose known pose puts lines in plain sight beside those in the picture, igs_02_240 and rnd_01_470. "Beyond
the reference's error": of the same bearings, those that end past or short of the board by every pose that is up to a
standard deviation of the reference (see photograph_consistency) off. A camera 17 cm high that is half a degree off sees
a board 3 m away 15 % off.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from benchmarks.scores.photograph_consistency import ONBOARD
from benchmarks.scores.photograph_rows import ONBOARD_FIELD, REAL, PhotographRow, drawn_prior, known_poses, photographs
from field_models import load_field
from robocup_vision import Vision, load_camera
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2

SEED, PRIORS = 20010305, 3
TOLERANCE, MAX_PAST, MAX_SHORT = 0.15, 0.08, 0.05


def walls_m(walls: FloatArray, pose: Pose2, bearing_rad: FloatArray) -> FloatArray:
    """Return the distances (K,) from a pose to the first of walls (N, 4), x0, y0, x1, y1, at bearings (K,)."""
    start, along = walls[:, :2] - (pose.x_m, pose.y_m), walls[:, 2:] - walls[:, :2]
    ahead = np.stack([np.cos(pose.theta_rad + bearing_rad), np.sin(pose.theta_rad + bearing_rad)])
    across = ahead[0] * along[:, 1:] - ahead[1] * along[:, :1]
    with np.errstate(divide="ignore", invalid="ignore"):
        away = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0])[:, None] / across
        part = (start[:, :1] * ahead[1] - start[:, 1:] * ahead[0]) / across
    return np.asarray(np.where((away > 1e-9) & (part >= -1e-9) & (part <= 1 + 1e-9), away, math.inf).min(axis=0))


def walls_near_m(walls: FloatArray, pose: Pose2, bearing_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest of `walls_m` by poses a standard deviation of the reference off, (K,) each."""
    std = np.sqrt(np.diag(ONBOARD))
    off = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3))) * std
    away = np.array([walls_m(walls, Pose2(*(pose.array + one).tolist()), bearing_rad) for one in off])
    return away.min(axis=0), away.max(axis=0)


def free_floor(method: str | None, *, with_prior: bool) -> PhotographRow | None:
    """Look at the frames, with priors about the known poses or without."""
    if not (REAL / "onboard_ssl_more").is_dir():
        return None
    field = load_field(ONBOARD_FIELD)
    rng = np.random.default_rng(SEED)
    past = short = sure_past = sure_short = bearings = looks = located = 0
    for folder in ("onboard_ssl", "onboard_ssl_more"):
        truths, camera = known_poses(folder), load_camera(REAL / folder / "camera.toml")
        vision = Vision(field, camera, method=method)
        for name, frame in photographs(folder):
            if name not in truths:
                continue
            for _ in range(PRIORS if with_prior else 1):
                vision.forget()
                view = vision.look(frame, prior=drawn_prior(truths[name], rng) if with_prior else None)
                assert isinstance(view.camera, PinholeCamera)
                angle, width_px = view.free_space.bearing_rad, camera.size_px[0]
                board = walls_m(field.walls, truths[name], angle)
                foot = view.camera.floor_to_pixel(board[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
                shown = ((foot >= 0) & (foot < (width_px, camera.size_px[1]))).all(axis=1)
                ratio = view.free_space.range_m[shown] / board[shown]
                nearest, farthest = walls_near_m(field.walls, truths[name], angle[shown])
                sure_past += int(np.count_nonzero(view.free_space.range_m[shown] > (1 + TOLERANCE) * farthest))
                sure_short += int(np.count_nonzero(view.free_space.range_m[shown] < (1 - TOLERANCE) * nearest))
                past += int(np.count_nonzero(ratio > 1 + TOLERANCE))
                short += int(np.count_nonzero(ratio < 1 - TOLERANCE))
                bearings, looks, located = bearings + len(ratio), looks + 1, located + bool(view.pose)
    words = f"method {method or 'edges'}, {'prior' if with_prior else 'no prior'}"
    return PhotographRow(
        f"free floor, {words}",
        f"{past / bearings:.0%} past, {short / bearings:.0%} short; {located}/{looks} located; beyond the reference's "
        f"error {sure_past / bearings:.0%}, {sure_short / bearings:.0%}",
        f"<= {MAX_PAST:.0%} past, {MAX_SHORT:.0%} short",
        past <= MAX_PAST * bearings and short <= MAX_SHORT * bearings,
    )


ROWS: tuple[Callable[[], PhotographRow | None], ...] = (
    lambda: free_floor(None, with_prior=False),
    lambda: free_floor("field", with_prior=False),
    lambda: free_floor(None, with_prior=True),
    lambda: free_floor("field", with_prior=True),
)
