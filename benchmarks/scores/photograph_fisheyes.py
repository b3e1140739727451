"""Rows on photographs of middle-size robots by a fisheye: calibrated and located by lines; none of other things.

The lens is that of the notes on the photographs, found by the field's lines in one robot's pictures; other robots of
the team share it. Its circle, and which rows show the robot's own wheels, are read off the pictures. Reference poses
are good to 2 cm and 0.1 degrees; errors count modulo a half turn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.scores.photograph_rows import REAL, PhotographRow, photographs, photographs_of_other_things, table_of
from field_models import load_field
from robocup_vision import Vision
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.forward.calibrate import ForwardCalibration, calibrate_forward
from robocup_vision.calibration.forward.starts import KnownOfCamera
from robocup_vision.camera import FisheyeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.view import View

FOLDER, HOME = "msl_fisheye", "2026"
DATA = Path(__file__).resolve().parents[2] / "tests" / "data"
FIELD = DATA / "msl_fisheye_field.toml"
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
THINGS, BOX_KEYS = ("obstacle", "human"), ("xmin", "xmax", "ymax")
# boxes are 4 px too wide
BOX_RIM_PX, NEAR_M = 2.0, 6.0
# the pictures of one camera, and what is asked of a lens by them
CALIBRATED = "20260503_r5_cam0"
HALL, HALL_TARGET = "20220716", "0.55 px; 75 %; 0 wrong"
LENS_TARGET = "0.35 px; 325.9 +-2; 304.7, 393.7 +-2; 0.769 +-0.01 m; 20 mm"


@dataclass(frozen=True, eq=False)
class Event:
    """A year's camera with its lens's circle, and the mask that hides the robot's own wheels."""

    camera: FisheyeCamera
    own_parts: UInt8Array | None


def _events() -> dict[str, Event]:
    wheels = np.zeros((800, 608), dtype=np.uint8)
    wheels[755:] = 255
    first = replace(CAMERA, focal_px=(338.0, 338.0), usable_radius_px=(0.0, 420.0))
    later = Event(replace(CAMERA, usable_radius_px=(0.0, 382.0)), wheels)
    return {"2022": Event(first, None), "2024": later, "2025": later, "2026": later}


EVENTS = _events()


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


def floor_before_things() -> PhotographRow | None:
    """Measure where the floor ends in the direction of robots and people whose feet are nearer than 6 m.

    A box's feet are at its lower end; its direction is the middle half of it, and its floor ends where the first of
    these directions does. Boxes that another one hides, or that the picture cuts, are left out.
    """
    if not (REAL / FOLDER).is_dir():
        return None
    boxes: dict[str, list[dict[str, str]]] = {}
    for row in table_of(FOLDER, "boxes.csv"):
        boxes.setdefault(row["image"], []).append(row)
    held = {row["image"]: row for row in table_of(FOLDER, "poses.csv")}
    field = load_field(FIELD)
    ratios: dict[str, list[float]] = {}
    for name, frame in photographs(FOLDER):
        event = EVENTS[name[:4]]
        camera = event.camera
        if name in held:
            tilt, roll, height = (float(held[name][key]) for key in ("tilt_rad", "roll_rad", "height_m"))
            camera = replace(camera, tilt_rad=tilt, roll_rad=roll, height_m=height)
        view = Vision(field, camera, mask=event.own_parts).look(frame)
        found = _floor_ratios(
            view, [[float(row[key]) for key in BOX_KEYS] + [row["kind"] in THINGS] for row in boxes.get(name, [])]
        )
        ratios.setdefault(name[:4], []).extend(found)
    parts = [f"{event} {sum(map(_is_at_feet, found))}/{len(found)}" for event, found in sorted(ratios.items())]
    together = [ratio for found in ratios.values() for ratio in found]
    share = sum(map(_is_at_feet, together)) / len(together)
    return PhotographRow(
        "msl_fisheye, floor ends at feet", f"{100 * share:.0f} %: {', '.join(parts)}", "95 %", share >= 0.95
    )


def _is_at_feet(ratio: float) -> bool:
    return 0.8 <= ratio <= 1.1


def _floor_ratios(view: View, boxes: list[list[float]]) -> list[float]:
    """Return where floor ends, of the range of their feet, before those of the boxes that are things near by."""
    found = []
    bearing, free_m = view.free_space.bearing_rad, view.free_space.range_m
    for n, (left, right, low, is_thing) in enumerate(boxes):
        quarter = 0.25 * (right - left)
        hidden = any(
            other[2] > low and other[0] < right - quarter and other[1] > left + quarter
            for k, other in enumerate(boxes)
            if k != n
        )
        if not is_thing or hidden or low >= view.camera.size_px[1] - 3:
            continue
        across = np.array([(u, low - BOX_RIM_PX) for u in (left + quarter, 0.5 * (left + right), right - quarter)])
        feet = view.camera.pixel_to_floor(across)
        range_m = float(np.hypot(*feet[1]))
        if not range_m <= NEAR_M:
            continue
        turn = np.arctan2(feet[:, 1], feet[:, 0])
        within = (bearing >= turn.min()) & (bearing <= turn.max())
        within[np.argmin(np.abs(bearing - turn[1]))] = True
        found.append(float(free_m[within].min()) / range_m)
    return found


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
    if not isinstance(whole, ForwardCalibration) or len(good) < 2:
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


def hall() -> PhotographRow | None:
    """Calibrate the cameras of three robots as one by their pictures in a hall, and locate each picture alone by it."""
    if not (REAL / FOLDER).is_dir():
        return None
    frames = {name: frame for name, frame in photographs(FOLDER) if name.startswith(HALL)}
    field = load_field(DATA / "msl_2022_field.toml")
    found = calibrate_forward(field, list(frames.values()), KnownOfCamera("fisheye", height_m=0.75, tilt_rad=0.0))
    if not isinstance(found, ForwardCalibration):
        return PhotographRow("msl_fisheye, hall of 2022", "not calibrated", HALL_TARGET, False)
    truths = {row["image"]: row for row in table_of(FOLDER, "poses.csv")}
    vision = Vision(field, found.camera)
    located = wrong = 0
    for name, frame in frames.items():
        vision.forget()
        pose = vision.look(frame).pose
        located += bool(pose)
        if pose and name in truths:
            truth = Pose2(*(float(truths[name][key]) for key in ("x_m", "y_m", "theta_rad")))
            wrong += pose.pose.error_to(truth, symmetric=True)[0] > WRONG_M
    measured = (
        f"{len(found.frames)} of {len(frames)} images: {found.residual_px:.2f} px rms; located {located}, {wrong} wrong"
    )
    is_met = found.residual_px <= 0.55 and located >= 0.75 * len(frames) and not wrong
    return PhotographRow("msl_fisheye, hall of 2022", measured, HALL_TARGET, is_met)


ROWS: tuple[Callable[[], PhotographRow | None], ...] = (lens, hall, home, floor_before_things, other_things)
