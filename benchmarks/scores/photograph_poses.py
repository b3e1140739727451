"""Poses in photographs: right where something is known of them, and none where no field is.

A pose is right within 5 cm and 2 degrees of the known one (two_zone, whose truth is good to 0.1 m: 15 cm), modulo a
half turn for mirror cameras. Photographs of other things are scaled to each camera's size and looked at once without
and once with a random prior (0.1 m, 0.1 m, 5 degrees, one standard deviation, anywhere on the field); every pose that
comes back counts as one too many. Priors on the photographs of a field are drawn about the known pose with the same
standard deviations.
"""

from __future__ import annotations

import itertools
import math

import cv2
import numpy as np

from benchmarks.harness import DEFAULT_SEED
from benchmarks.scores.photograph_rows import (
    ONBOARD_FIELD,
    PRIOR_STD,
    REAL,
    Look,
    PhotographRow,
    known_poses,
    looks,
    needs,
    onboard_looks,
    photographs,
    photographs_of_other_things,
    table_of,
)
from benchmarks.worlds.painted_carpets import map_error
from field_models import Field, load_field
from robocup_vision import PoseEstimate, Vision, load_camera
from robocup_vision.calibration.omni.calibrate import calibrate_omni
from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.cameras import sekimori_camera

PRIORS = 6
RIGHT_M, RIGHT_RAD, ROUGH_M = 0.05, math.radians(2.0), 0.15
# folder and image of each calibration from a single photograph
SINGLE = (
    ("omni_msl_6x4", "a_center.png"),
    ("omni_msl_6x4_b", "b_center.png"),
    ("omni_msl_noisy", "y_1bakbak_pic0.png"),
    ("omni_msl_noisy", "y_2_pic0.png"),
    ("omni_msl_noisy", "y_100_pic0.png"),
    ("omni_msl_table", "d100.png"),
    ("omni_msl_table", "d175.png"),
    ("omni_msl_table", "d250.png"),
)


def _field_of(folder: str) -> Field:
    if folder == "onboard_ssl_more":
        return load_field(ONBOARD_FIELD)
    own = REAL / folder / "field.toml"
    return load_field(own if own.is_file() else "msl_6x4")


def _is_right(look: Look, max_m: float = RIGHT_M) -> bool:
    """Whether a look gave the known pose, modulo a half turn."""
    if not look.view.pose or look.truth is None:
        return False
    off_m, off_rad = look.view.pose.pose.error_to(look.truth, symmetric=True)
    return off_m <= max_m and off_rad <= RIGHT_RAD


def _pinhole_rows() -> list[tuple[Field, PinholeCamera]]:
    out = []
    for folder in ("onboard_ssl_more", "goal_spl"):
        camera = load_camera(REAL / folder / "camera.toml")
        assert isinstance(camera, PinholeCamera)
        out.append((load_field("spl_2020") if folder == "goal_spl" else _field_of(folder), camera))
    return out


@needs("negatives")
def other_things(kind: str, *, with_prior: bool) -> PhotographRow:
    """Look at photographs of other things, by a mirror camera among walls or lines, or by pinhole cameras."""
    rng = np.random.default_rng(DEFAULT_SEED)
    visions: list[Vision]
    if kind == "walls":
        visions = [Vision(load_field("ssl_2001"), sekimori_camera())]
    elif kind == "lines":
        visions = [Vision(load_field("msl_6x4"), load_camera(REAL / "omni_msl_6x4" / "camera.toml"))]
    else:
        visions = []
        for field, camera in _pinhole_rows():
            if kind == "pinhole":
                visions.append(Vision(field, camera))
            elif camera.tilt_rad is not None:
                visions.append(Vision(field, camera, method=kind))
    found = count = 0
    for vision in visions:
        for frame in photographs_of_other_things(vision.camera.size_px):
            vision.forget()
            half = vision.field.length_m / 2, vision.field.width_m / 2
            there = Pose2(
                rng.uniform(-half[0], half[0]), rng.uniform(-half[1], half[1]), rng.uniform(-math.pi, math.pi)
            )
            prior = PoseEstimate(there, np.diag(PRIOR_STD**2), 1.0, 0.0) if with_prior else None
            found += bool(vision.look(frame, prior=prior).pose)
            count += 1
    words = "random prior" if with_prior else "no prior"
    return PhotographRow(f"other things, {kind}, {words}", f"{found} poses of {count}", "none", found == 0)


def mirror_lines(folder: str, *, with_prior: bool) -> PhotographRow | None:
    """Look at mirror photographs with clutter; those without a known pose count where any is found."""
    if not (REAL / folder / "images").is_dir():
        return None
    truths = known_poses(folder) if (REAL / folder / "truth.csv").is_file() else {}
    vision = Vision(_field_of(folder), load_camera(REAL / folder / "camera.toml"))
    right = count = wrong = 0
    for look in looks(vision, photographs(folder), truths, PRIORS if with_prior else 0):
        is_right = bool(look.view.pose) if look.truth is None else _is_right(look)
        right, wrong, count = right + is_right, wrong + (bool(look.view.pose) and not is_right), count + 1
    words = "prior" if with_prior else "no prior"
    return PhotographRow(
        f"{folder}, {words}", f"{right} of {count} right, {wrong} wrong", "all, 0 wrong", right == count and not wrong
    )


@needs("omni_msl_two_zone")
def two_zones() -> PhotographRow:
    """Look through a mirror of two zones by its team's table."""
    folder = "omni_msl_two_zone"
    vision = Vision(_field_of(folder), load_camera(REAL / folder / "camera_team.toml"))
    truths = known_poses(folder)
    located = [look for look in looks(vision, photographs(folder), truths) if look.view.pose]
    wrong = sum(not _is_right(look, ROUGH_M) for look in located)
    return PhotographRow(folder, f"{len(located)} of {len(truths)} located, {wrong} wrong", "0 wrong", wrong == 0)


@needs("omni_msl_noisy")
def noisy_carpet() -> PhotographRow:
    """Look at the photographs with noise by cameras calibrated on them."""
    folder = "omni_msl_noisy"
    located = []
    for name, frame in photographs(folder):
        vision = Vision(load_field("msl_6x4"), load_camera(REAL / folder / f"camera_{name[:-4]}.toml"))
        if vision.look(frame).pose:
            located.append(name[:-9])
    return PhotographRow(folder, f"{len(located)} of 3 located ({', '.join(located)})", "all", len(located) == 3)


def single_photographs(start: str | None) -> PhotographRow | None:
    """Calibrate mirror cameras from one photograph each; right where the camera agrees with the known one."""
    cases = [(folder, [name]) for folder, name in SINGLE if start is None or folder == "omni_msl_table"]
    label = "calibrated from one photograph" + (", by the team's table" if start else "")
    return _calibrated(label, cases, start)


def several_photographs(folder: str, count: int) -> PhotographRow | None:
    """Calibrate a mirror camera from so many photographs, all choices of them, without a start."""
    names = [name for name, _ in photographs(folder)]
    cases = [(folder, list(chosen)) for chosen in itertools.combinations(names, count)]
    return _calibrated(f"{folder}, calibrated from {count}", cases, None)


@needs("omni_msl_table")
def _calibrated(label: str, cases: list[tuple[str, list[str]]], start: str | None) -> PhotographRow:
    right = wrong = 0
    for folder, names in cases:
        frames = [
            np.asarray(cv2.imread(str(REAL / folder / "images" / name), cv2.IMREAD_COLOR), dtype=np.uint8)
            for name in names
        ]
        known = load_camera(
            REAL / folder / ("camera.toml" if folder != "omni_msl_noisy" else f"camera_{names[0][:-4]}.toml")
        )
        assert isinstance(known, OmniCamera)
        first = None if start is None else load_camera(REAL / folder / start)
        assert first is None or isinstance(first, OmniCamera)
        result = calibrate_omni(_field_of(folder), frames, first)
        if result:
            agrees = map_error(result.camera, known) <= 0.08
            right, wrong = right + agrees, wrong + (not agrees)
    return PhotographRow(
        label, f"{right} of {len(cases)}, {wrong} wrong", "9 of 11, 0 wrong", not wrong and 11 * right >= 9 * len(cases)
    )


@needs("onboard_ssl_more")
def forward_poses() -> PhotographRow:
    """Look by the small-size robot's camera without a prior: any right candidate counts."""
    count = right = wrong = 0
    for look in onboard_looks():
        count += 1
        if look.view.pose and look.truth is not None:
            near = min(pose.error_to(look.truth)[0] for pose in look.view.pose.candidates)
            right, wrong = right + (near < 0.3), wrong + (near >= 0.3)
    return PhotographRow(
        "onboard_ssl, no prior",
        f"{right} of {count} right, {wrong} wrong",
        "a third, 0 wrong",
        not wrong and 3 * right >= count,
    )


@needs("onboard_ssl_more")
def forward_poses_near_priors() -> PhotographRow:
    """Look by the small-size robot's camera with priors."""
    errors: list[tuple[float, float]] = []
    nearer = count = 0
    for look in onboard_looks(PRIORS):
        count += 1
        if look.view.pose and look.truth is not None and look.prior is not None:
            errors.append(look.view.pose.pose.error_to(look.truth))
            nearer += errors[-1][0] < look.prior.pose.error_to(look.truth)[0]
    away, turn = np.mean(errors, axis=0)
    measured = (
        f"{len(errors)}/{count}; {away:.3f} m, {math.degrees(turn):.1f} deg; nearer {100 * nearer / len(errors):.0f} %"
    )
    return PhotographRow(
        "onboard_ssl, prior", measured, "0.07 m; nearer 90 %", float(away) <= 0.07 and nearer >= 0.9 * len(errors)
    )


@needs("goal_spl")
def white_goals() -> PhotographRow:
    """Locate the head camera of a Nao by its white goal."""
    vision = Vision(load_field("spl_2020"), load_camera(REAL / "goal_spl" / "camera.toml"))
    truths = {row["image"]: (float(row["x_m"]), float(row["y_m"])) for row in table_of("goal_spl", "truth.csv")}
    errors = [
        min(math.dist(pose.array[:2], truths[look.name]) for pose in look.view.pose.candidates)
        for look in looks(vision, photographs("goal_spl"))
        if look.view.pose
    ]
    if not errors:
        return PhotographRow("goal_spl", f"0 of {len(truths)}", "5 of 5; 0.05, 0.10 m", False)
    mean, worst = float(np.mean(errors)), max(errors)
    measured = f"{len(errors)} of {len(truths)}; mean {mean:.3f}, worst {worst:.3f} m"
    is_met = len(errors) == len(truths) and mean <= 0.05 and worst <= 0.1
    return PhotographRow("goal_spl", measured, "5 of 5; 0.05, 0.10 m", is_met)


ROWS = (
    lambda: other_things("walls", with_prior=False),
    lambda: other_things("walls", with_prior=True),
    lambda: other_things("lines", with_prior=False),
    lambda: other_things("lines", with_prior=True),
    lambda: other_things("pinhole", with_prior=False),
    lambda: other_things("pinhole", with_prior=True),
    lambda: other_things("field", with_prior=True),
    lambda: other_things("floor", with_prior=True),
    lambda: mirror_lines("omni_msl_lab", with_prior=False),
    lambda: mirror_lines("omni_msl_table", with_prior=False),
    lambda: mirror_lines("omni_msl_table", with_prior=True),
    two_zones,
    noisy_carpet,
    lambda: single_photographs(None),
    lambda: single_photographs("camera_team.toml"),
    lambda: several_photographs("omni_msl_lab", 1),
    lambda: several_photographs("omni_msl_lab", 2),
    lambda: several_photographs("omni_msl_lab", 3),
    lambda: several_photographs("omni_msl_table", 2),
    forward_poses,
    forward_poses_near_priors,
    white_goals,
)
