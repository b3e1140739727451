"""Rows on photographs of middle-size robots by a fisheye: located by lines, each picture alone; none of other things.

The lens is that of the notes on the photographs, found by the field's lines in one robot's pictures; other robots of
the team share it. Reference poses are good to 2 cm and 0.1 degrees; errors count modulo a half turn.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.scores.photograph_rows import REAL, PhotographRow, photographs, photographs_of_other_things, table_of
from field_models import load_field
from robocup_vision import Vision
from robocup_vision.camera import FisheyeCamera
from robocup_vision.geometry import Pose2

FOLDER, HOME = "msl_fisheye", "2026"
FIELD = Path(__file__).resolve().parents[2] / "tests" / "data" / "msl_fisheye_field.toml"
CAMERA = FisheyeCamera(
    (608, 800),
    (325.9, 325.9),
    (304.7, 393.7),
    0.769,
    (-0.0216, -0.0029, 0.0, 0.0),
    pan_rad=0.0,
    tilt_rad=0.009,
    roll_rad=-0.006,
    roll_std_rad=0.01,
)
WRONG_M = 0.3


def home() -> PhotographRow | None:
    """Locate the cameras that look ahead at the team's home field."""
    if not (REAL / FOLDER).is_dir():
        return None
    truths = {
        row["image"]: Pose2(float(row["x_m"]), float(row["y_m"]), float(row["theta_rad"]))
        for row in table_of(FOLDER, "poses.csv")
    }
    vision = Vision(load_field(FIELD), CAMERA)
    located = looks = 0
    errors = []
    for name, frame in photographs(FOLDER):
        if not name.startswith(HOME) or "_cam0_" not in name:
            continue
        vision.forget()
        pose = vision.look(frame).pose
        looks += 1
        located += bool(pose)
        if pose and name in truths:
            errors.append(pose.pose.error_to(truths[name], symmetric=True)[0])
    wrong = sum(error > WRONG_M for error in errors)
    median_m = float(np.median(errors)) if errors else np.inf
    measured = f"{located} of {looks}; median {1000 * median_m:.1f} mm of {len(errors)}, {wrong} wrong"
    is_met = located >= 0.9 * looks and median_m <= 0.02 and not wrong
    return PhotographRow("msl_fisheye, home, no prior", measured, "90 %; 20 mm; 0 wrong", is_met)


def other_things() -> PhotographRow | None:
    """Locate the same camera in photographs that show no field."""
    vision = Vision(load_field(FIELD), CAMERA)
    looks = located = 0
    for frame in photographs_of_other_things(CAMERA.size_px):
        vision.forget()
        looks += 1
        located += bool(vision.look(frame).pose)
    return PhotographRow("no field: poses by a fisheye", f"{located} of {looks}", "0", not located) if looks else None


ROWS: tuple[Callable[[], PhotographRow | None], ...] = (home, other_things)
