"""Rows on photographs of middle-size robots by a fisheye: calibrated and located by lines; none of other things.

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
from robocup_vision.calibration.forward.calibrate import calibrate_forward
from robocup_vision.calibration.forward.result import ForwardCalibration
from robocup_vision.calibration.forward.starts import KnownOfCamera
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
# the pictures of one camera, and what is asked of a lens by them
CALIBRATED = "20260503_r5_cam0"
LENS_TARGET = "0.35 px; 325.9 +-2; 304.7, 393.7 +-2; 0.769 +-0.01 m; 20 mm"


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


def lens() -> PhotographRow | None:
    """Calibrate one robot's camera, of which its height and tilt are roughly known, by its pictures at home."""
    if not (REAL / FOLDER).is_dir():
        return None
    frames = [frame for name, frame in photographs(FOLDER) if name.startswith(CALIBRATED)]
    field, known = load_field(FIELD), KnownOfCamera("fisheye", height_m=0.75, tilt_rad=0.0)
    whole, *halves = (calibrate_forward(field, some, known) for some in (frames, frames[::2], frames[1::2]))
    good = [half for half in halves if isinstance(half, ForwardCalibration)]
    if not isinstance(whole, ForwardCalibration) or len(good) < 2 or whole.residual_px is None:
        return PhotographRow("msl_fisheye, lens by lines", "not calibrated", LENS_TARGET, False)
    (focal, height), center = (whole.camera.focal_px[0], whole.camera.height_m), np.array(whole.camera.center_px)
    ahead = np.array([(3.0, -1.5), (3.0, 0.0), (3.0, 1.5)])
    pixels = whole.camera.floor_to_pixel(ahead)
    one, other = (half.camera.pixel_to_floor(pixels) for half in good)
    apart_m = float(np.hypot(*(one - other).T).max())
    off = abs(focal - CAMERA.focal_px[0]), np.abs(center - CAMERA.center_px).max(), abs(height - CAMERA.height_m)
    measured = (
        f"{len(whole.frames)} of {len(frames)} images: {whole.residual_px:.2f} px rms; f {focal:.1f}; centre "
        f"{center[0]:.1f}, {center[1]:.1f}; height {height:.3f} m; halves {1000 * apart_m:.0f} mm apart at 3 m"
    )
    is_met = whole.residual_px <= 0.35 and off[0] <= 2.0 and off[1] <= 2.0 and off[2] <= 0.01 and apart_m <= 0.02
    return PhotographRow("msl_fisheye, lens by lines", measured, LENS_TARGET, is_met)


ROWS: tuple[Callable[[], PhotographRow | None], ...] = (lens, home, other_things)
