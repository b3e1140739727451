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

import numpy as np

from benchmarks.scores.photograph_consistency import ONBOARD
from benchmarks.scores.photograph_rows import ONBOARD_FIELD, PhotographRow, needs, onboard_looks
from field_models import load_field
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.scene import Scene

PRIORS = 3
TOLERANCE, MAX_PAST, MAX_SHORT = 0.15, 0.08, 0.05


def walls_near_m(scene: Scene, pose: Pose2, bearing_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest free range by poses a standard deviation of the reference off, (K,) each."""
    std = np.sqrt(np.diag(ONBOARD))
    off = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3))) * std
    away = np.array([scene.free_range_m(Pose2(*(pose.array + one).tolist()), bearing_rad) for one in off])
    return away.min(axis=0), away.max(axis=0)


@needs("onboard_ssl_more")
def free_floor(method: str | None, *, with_prior: bool) -> PhotographRow:
    """Look at the frames, with priors about the known poses or without."""
    scene = Scene(load_field(ONBOARD_FIELD))
    past = short = sure_past = sure_short = bearings = count = located = 0
    for look in onboard_looks(PRIORS if with_prior else 0, method):
        camera, free_space = look.view.camera, look.view.free_space
        assert isinstance(camera, PinholeCamera)
        assert look.truth is not None
        angle = free_space.bearing_rad
        board = scene.free_range_m(look.truth, angle)
        foot = camera.floor_to_pixel(board[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        shown = ((foot >= 0) & (foot < camera.size_px)).all(axis=1)
        free_m = free_space.range_m[shown]
        ratio = free_m / board[shown]
        nearest, farthest = walls_near_m(scene, look.truth, angle[shown])
        sure_past += int(np.count_nonzero(free_m > (1 + TOLERANCE) * farthest))
        sure_short += int(np.count_nonzero(free_m < (1 - TOLERANCE) * nearest))
        past += int(np.count_nonzero(ratio > 1 + TOLERANCE))
        short += int(np.count_nonzero(ratio < 1 - TOLERANCE))
        bearings, count, located = bearings + len(ratio), count + 1, located + bool(look.view.pose)
    words = f"method {method or 'edges'}, {'prior' if with_prior else 'no prior'}"
    return PhotographRow(
        f"free floor, {words}",
        f"{past / bearings:.0%} past, {short / bearings:.0%} short; {located}/{count} located; beyond the reference's "
        f"error {sure_past / bearings:.0%}, {sure_short / bearings:.0%}",
        f"<= {MAX_PAST:.0%} past, {MAX_SHORT:.0%} short",
        past <= MAX_PAST * bearings and short <= MAX_SHORT * bearings,
    )


ROWS = (
    lambda: free_floor(None, with_prior=False),
    lambda: free_floor("field", with_prior=False),
    lambda: free_floor(None, with_prior=True),
    lambda: free_floor("field", with_prior=True),
)
