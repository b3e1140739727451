"""Free floor in photographs against the boards around a small-size carpet.

The frames are those whose pose is known; the boards stand where the field file says, around one half of a field. A
bearing counts where the foot of its board lies in the picture at the known pose; "past": the free range ends over 15 %
beyond the board, "short": over 15 % before it, which other robots and balls cause, too. Most robots move, so that the
known pose is that of another moment. A camera 17 cm high that is half a degree off sees a board 3 m away 15 % off.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from benchmarks.scores.photograph_rows import ONBOARD_FIELD, REAL, PhotographRow, drawn_prior, known_poses, photographs
from field_models import load_field
from robocup_vision import Vision, load_camera
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2

SEED, PRIORS = 20010305, 3
TOLERANCE, MAX_PAST, MAX_SHORT = 0.15, 0.08, 0.05


def boards_m(polygon: FloatArray, pose: Pose2, bearing_rad: FloatArray) -> FloatArray:
    """Return the distances (K,) from a pose inside a convex polygon (N, 2) to its edges, at bearings (K,)."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    normal = np.stack([start[:, 1] - end[:, 1], end[:, 0] - start[:, 0]], axis=1)
    ahead = np.stack([np.cos(pose.theta_rad + bearing_rad), np.sin(pose.theta_rad + bearing_rad)])
    toward = normal @ ahead
    with np.errstate(divide="ignore", invalid="ignore"):
        away = ((start - (pose.x_m, pose.y_m)) * normal).sum(axis=1)[:, None] / toward
    return np.asarray(np.where(away > 1e-9, away, math.inf).min(axis=0))


def free_floor(method: str | None, *, with_prior: bool) -> PhotographRow | None:
    """Look at the frames, with priors about the known poses or without."""
    if not (REAL / "onboard_ssl_more").is_dir():
        return None
    field = load_field(ONBOARD_FIELD)
    rng = np.random.default_rng(SEED)
    past = short = bearings = looks = located = 0
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
                board = boards_m(field.floor_polygon, truths[name], angle)
                foot = view.camera.floor_to_pixel(board[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
                shown = ((foot >= 0) & (foot < (width_px, camera.size_px[1]))).all(axis=1)
                ratio = view.free_space.range_m[shown] / board[shown]
                past += int(np.count_nonzero(ratio > 1 + TOLERANCE))
                short += int(np.count_nonzero(ratio < 1 - TOLERANCE))
                bearings, looks, located = bearings + len(ratio), looks + 1, located + bool(view.pose)
    words = f"method {method or 'edges'}, prior" if with_prior else "no prior"
    return PhotographRow(
        f"free floor, {words}",
        f"{past / bearings:.0%} past, {short / bearings:.0%} short; {located}/{looks} located",
        f"<= {MAX_PAST:.0%} past, {MAX_SHORT:.0%} short",
        past <= MAX_PAST * bearings and short <= MAX_SHORT * bearings,
    )


ROWS: tuple[Callable[[], PhotographRow | None], ...] = (
    lambda: free_floor("field", with_prior=False),
    lambda: free_floor(None, with_prior=True),
    lambda: free_floor("field", with_prior=True),
)
