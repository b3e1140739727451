"""Rows on photographs of middle-size robots by a fisheye: calibrated and located by lines; none of other things.

The lens is that of the notes on the photographs, found by the field's lines in one robot's pictures; other robots of
the team share it. Its circle, and which rows show the robot's own wheels, are read off the pictures. Reference poses
are good to 2 cm and 0.1 degrees; errors count modulo a half turn.

Kinds: a network learns from three events (500 batches) and tells those of the fourth: at the feet of boxes, at
obstacles that are told, and at places of the floor apart from all boxes. A told kind is right where the box says so;
people that no box marks count as wrong.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import cast

import numpy as np

from benchmarks.scores.photograph_rows import (
    PhotographRow,
    looks,
    needs,
    photographs,
    photographs_of_other_things,
    table_of,
)
from field_models import load_field
from robocup_vision import Vision
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.forward.calibrate import ForwardCalibration, calibrate_forward
from robocup_vision.calibration.forward.starts import KnownOfCamera
from robocup_vision.camera import FisheyeCamera, load_camera
from robocup_vision.evaluation.boxes import Box
from robocup_vision.geometry import Pose2
from robocup_vision.perception.kinds.network import KINDS, MIN_NATS, KindNetwork
from robocup_vision.view import View

FOLDER, HOME = "msl_fisheye", "2026"
DATA = Path(__file__).resolve().parents[2] / "tests" / "data"
FIELD = DATA / "msl_fisheye_field.toml"
CAMERA = cast(FisheyeCamera, load_camera(DATA / "msl_fisheye_camera.toml"))
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


def _poses() -> dict[str, Pose2]:
    return {
        row["image"]: Pose2(float(row["x_m"]), float(row["y_m"]), float(row["theta_rad"]))
        for row in table_of(FOLDER, "poses.csv")
    }


@needs(FOLDER)
def home() -> PhotographRow:
    """Locate the cameras that look ahead at the team's home field."""
    ahead = ((name, frame) for name, frame in photographs(FOLDER) if name.startswith(HOME) and "_cam0_" in name)
    count, located, errors = _located(Vision(load_field(FIELD), CAMERA), ahead)
    wrong = sum(error > WRONG_M for error in errors)
    median_m = float(np.median(errors)) if errors else np.inf
    measured = f"{located} of {count}; median {1000 * median_m:.1f} mm of {len(errors)}, {wrong} wrong"
    is_met = located >= 0.9 * count and median_m <= 0.02 and not wrong
    return PhotographRow("msl_fisheye, home, no prior", measured, "90 %; 20 mm; 0 wrong", is_met)


def _located(vision: Vision, frames: Iterable[tuple[str, UInt8Array]]) -> tuple[int, int, list[float]]:
    """Return how many photographs there are, how many are located, and the errors (m) of those whose pose is known."""
    found = list(looks(vision, frames, _poses()))
    located = [look for look in found if look.view.pose]
    errors = [
        look.view.pose.pose.error_to(look.truth, symmetric=True)[0]
        for look in located
        if look.view.pose and look.truth is not None
    ]
    return len(found), len(located), errors


@needs(FOLDER)
def floor_before_things() -> PhotographRow:
    """Measure where the floor ends in the direction of robots and people whose feet are nearer than 6 m.

    A box's feet are at its lower end; its direction is the middle half of it, and its floor ends where the first of
    these directions does. Boxes that another one hides, or that the picture cuts, are left out.
    """
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


@needs("negatives")
def other_things() -> PhotographRow:
    """Locate the same camera in photographs that show no field."""
    others = (("", frame) for frame in photographs_of_other_things(CAMERA.size_px))
    found = [bool(look.view.pose) for look in looks(Vision(load_field(FIELD), CAMERA), others)]
    return PhotographRow("no field: poses by a fisheye", f"{sum(found)} of {len(found)}", "0", not any(found))


@needs(FOLDER)
def lens() -> PhotographRow:
    """Calibrate one robot's camera, of which its height and tilt are roughly known, by its pictures at home."""
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


@needs(FOLDER)
def hall() -> PhotographRow:
    """Calibrate the cameras of three robots as one by their pictures in a hall, and locate each picture alone by it."""
    frames = {name: frame for name, frame in photographs(FOLDER) if name.startswith(HALL)}
    field = load_field(DATA / "msl_2022_field.toml")
    found = calibrate_forward(field, list(frames.values()), KnownOfCamera("fisheye", height_m=0.75, tilt_rad=0.0))
    if not isinstance(found, ForwardCalibration):
        return PhotographRow("msl_fisheye, hall of 2022", "not calibrated", HALL_TARGET, False)
    _, located, errors = _located(Vision(field, found.camera), frames.items())
    wrong = sum(error > WRONG_M for error in errors)
    measured = (
        f"{len(found.frames)} of {len(frames)} images: {found.residual_px:.2f} px rms; located {located}, {wrong} wrong"
    )
    is_met = found.residual_px <= 0.55 and located >= 0.75 * len(frames) and not wrong
    return PhotographRow("msl_fisheye, hall of 2022", measured, HALL_TARGET, is_met)


ROWS = (lens, hall, home, floor_before_things, other_things)


STEPS, MIN_RIGHT = 500, 0.95
# what the team calls its boxes of robots
ROBOT = "obstacle"
SIDES = ("xmin", "ymin", "xmax", "ymax")


@needs(FOLDER)
def kinds_left_out() -> PhotographRow | None:
    """Tell kinds in each event by a network that has not learnt from it."""
    if find_spec("torch") is None:
        return None
    from sim2d.training.kind_crops import OTHER, RIM_PX, joined, photograph_crops
    from sim2d.training.kind_training import train

    field = load_field(FIELD)
    crops = {
        event: photograph_crops(
            np.random.default_rng(1), Vision(field, known.camera, mask=known.own_parts), _pictures(event)
        )
        for event, known in EVENTS.items()
    }
    true = np.zeros((len(KINDS), 3), dtype=int)
    with tempfile.TemporaryDirectory() as folder:
        for event, unseen in crops.items():
            path = Path(folder) / "kind.onnx"
            rest = joined([one for name, one in crops.items() if name != event])
            train(path, rest, seed=1, steps=STEPS, tell=lambda _: None)
            nats = KindNetwork(path.read_bytes()).nats(unseen.images[:, RIM_PX:-RIM_PX, RIM_PX:-RIM_PX])
            told = np.where(nats.max(axis=1) >= MIN_NATS, nats.argmax(axis=1), OTHER)
            for kind in range(len(KINDS)):
                is_told, is_kind = told == kind, unseen.kinds == kind
                true[kind] += np.count_nonzero(is_told & is_kind), np.count_nonzero(is_kind), np.count_nonzero(is_told)
    parts = [f"{kind} {right} of {there}, {told} told" for kind, (right, there, told) in zip(KINDS, true, strict=True)]
    is_met = bool(true[:, 0].sum() >= MIN_RIGHT * true[:, 2].sum())
    return PhotographRow("msl_fisheye, kinds, unseen event", "; ".join(parts), "95 % of told are right", is_met)


def _pictures(event: str) -> Iterator[tuple[UInt8Array, list[Box]]]:
    boxes: dict[str, list[Box]] = {}
    for row in table_of(FOLDER, "boxes.csv"):
        kind = "robot" if row["kind"] == ROBOT else row["kind"]
        boxes.setdefault(row["image"], []).append(Box(kind, *(float(row[side]) for side in SIDES)))
    for name, frame in photographs(FOLDER):
        if name.startswith(event):
            yield frame, boxes.get(name, [])


KIND_ROWS = (kinds_left_out,)
