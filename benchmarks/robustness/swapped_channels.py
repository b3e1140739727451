"""Swapped red and blue: told where balls, goals or beacons show it, and never in frames whose channels are right.

Pictures of every built-in field (--quick: of every third), in five conditions of light, by a mirror camera and by a
forward camera that looks at the ball or at a goal in turn, and pictures of a four-legged goal; each as it is and with
red and blue swapped. Where the photographs beside the project are there: those of the forward cameras and of the mirror
cameras, too (--quick: the first twenty of each).

Each picture alone: frames that warn, of right ones (none may) and of swapped ones; and swapped ones that show a pose in
the wrong half. In a row: after how many pictures, each of another place, one `Vision` tells (median over runs of
twenty; none: more than twenty). A white or black ball and white goals cannot tell.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401 - before NumPy is loaded

# isort: split
import math
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from benchmarks.harness import Table, percent, program, verdict
from benchmarks.scores.photograph_rows import REAL
from benchmarks.worlds.walks import camera_ahead
from field_models import Field, field_names, load_field
from field_models.errors import RobocupVisionError
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import PinholeCamera, load_camera
from robocup_vision.geometry import Pose2
from robocup_vision.vision import Vision
from sim2d.rendering.backdrop import Backdrop
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, sample_goal
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.random_scenes import CONDITIONS, sample

LIGHTS = ("nominal", "warm", "cold", "dark", "bad_day")
RUN = 20
WRONG_M = 0.5
# a forward camera's lens gathers more light than a mirror's
MAX_NOISE = 4.0
# (folder, built-in field where there is no field file)
PHOTOGRAPHS = (
    ("ball_onboard", None),
    ("onboard_ssl_more", None),
    ("goal_spl", "spl_2020"),
    ("omni_msl_6x4", "msl_6x4"),
    ("omni_msl_lab", None),
    ("omni_msl_table", None),
)


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A frame (H, W, 3) uint8 BGR, and where the robot truly was, where that is known."""

    frame: UInt8Array
    pose: Pose2 | None


@dataclass(frozen=True, slots=True)
class Told:
    """How many pictures there were, warned, and had a wrong half; after how many each run of them warned."""

    pictures: int
    warned: int
    wrong: int
    needed: tuple[int | None, ...]


def look(vision: Vision, pictures: list[Picture]) -> Told:
    """Look at pictures, each alone, and then in runs."""
    warned = wrong = 0
    for one in pictures:
        vision.forget()
        view = vision.look(one.frame)
        warned += bool(view.warnings)
        if view.pose and one.pose is not None and len(view.pose.candidates) == 1:
            wrong += view.pose.pose.error_to(one.pose)[0] > WRONG_M
    needed: list[int | None] = []
    for first in range(0, len(pictures) - RUN + 1, RUN):
        vision.forget()
        run = pictures[first : first + RUN]
        needed.append(next((n for n, one in enumerate(run, start=1) if vision.look(one.frame).warnings), None))
    return Told(len(pictures), warned, wrong, tuple(needed))


def swapped(pictures: list[Picture]) -> list[Picture]:
    """Return the same pictures with red and blue swapped."""
    return [replace(one, frame=np.ascontiguousarray(one.frame[..., ::-1])) for one in pictures]


def forward_camera(field: Field) -> PinholeCamera:
    """Return a camera of known tilt for robots of a field's size."""
    if field.length_m < 6.0:
        return camera_ahead((208, 160), 192.0, 0.185, -12.0)
    return camera_ahead((320, 240), 308.0, 0.46, -12.0)


def forward_pictures(field: Field, camera: PinholeCamera, light: str, seed: int, count: int) -> Iterator[Picture]:
    """Yield pictures of a robot that looks at the ball or at a goal in turn."""
    condition = CONDITIONS[light]
    sensor = replace(condition.sensor, noise_sigma=min(condition.noise_sigma, MAX_NOISE))
    for one in sample(field, sekimori_camera(64, 55), condition, seed, count, supersample=1):
        rng = np.random.default_rng([seed, one.index, 1])
        ball = one.scene.ball
        target = (0.0, 0.0)
        if ball is not None and one.index % 2:
            target = (ball.x_m, ball.y_m)
        elif field.goals:
            target = (field.goals[one.index // 2 % 2].line_x_m, 0.0)
        pose = one.pose
        heading = math.atan2(target[1] - pose.y_m, target[0] - pose.x_m) + rng.normal(0.0, 0.1)
        pose = Pose2(pose.x_m, pose.y_m, heading)
        backdrop = Backdrop("hall", seed=int(rng.integers(2**31)))
        yield Picture(
            sensor.expose(render_pinhole(camera, one.scene, pose, backdrop=backdrop, supersample=3), rng), pose
        )


def rendered(seed: int, count: int, fields: Sequence[str]) -> Iterator[tuple[str, Vision, list[Picture]]]:
    """Yield name, `Vision` and pictures of each set; `count` of each light."""
    for name in fields:
        field, mirror = load_field(name), sekimori_camera()
        pictures = [
            Picture(one.frame, one.pose)
            for n, light in enumerate(LIGHTS)
            for one in sample(field, mirror, CONDITIONS[light], seed + n, count, supersample=2)
        ]
        yield f"mirror, {name}", Vision(field, mirror), pictures
        camera = forward_camera(field)
        pictures = [
            one for n, light in enumerate(LIGHTS) for one in forward_pictures(field, camera, light, seed + n, count)
        ]
        yield f"forward, {name}", Vision(field, camera), pictures
    field, goal = load_field("four_legged_2007"), GOAL_CONDITIONS["mild_glare_208x160"]
    pictures = [Picture(one.frame, one.pose) for one in sample_goal(field, goal, seed, 4 * count, supersample=4)]
    yield "goal, four_legged_2007", Vision(field, goal.camera), pictures


def photographed(most: int | None) -> Iterator[tuple[str, Vision, list[Picture]]]:
    """Yield name, `Vision` and pictures of the photographs that are there, so many of a folder or all."""
    for folder, name in PHOTOGRAPHS:
        path = REAL / folder
        if not path.is_dir():
            continue
        field = load_field(name or path / "field.toml")
        try:
            camera = load_camera(path / "camera.toml")
        except RobocupVisionError:
            continue
        frames = [cv2.imread(str(image), cv2.IMREAD_COLOR) for image in sorted((path / "images").iterdir())]
        usable = [frame for frame in frames if frame is not None and frame.shape[1::-1] == camera.size_px][:most]
        yield f"photographs, {folder}", Vision(field, camera), [Picture(np.asarray(f, np.uint8), None) for f in usable]


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    count = 1 if arguments.quick else 20 if arguments.full else 6
    fields, most = (field_names()[::3], RUN) if arguments.quick else (field_names(), None)
    table = Table(
        (
            "pictures                    | number | false warnings: count | target | swapped told % | "
            "wrong half % | in a row | verdict"
        ),
        "Red and blue as they are, and swapped",
        name="swapped",
    )
    false = total = 0
    for sets in (rendered(arguments.seed, count, fields), photographed(most)):
        for name, vision, pictures in sets:
            right, wrong = look(vision, pictures), look(vision, swapped(pictures))
            warnings = right.warned + sum(n is not None for n in right.needed)
            false, total = false + warnings, total + right.pictures
            runs = [math.inf if n is None else float(n) for n in wrong.needed]
            in_a_row = "-" if not runs else f"{median:g}" if (median := float(np.median(runs))) <= RUN else "none"
            table.row(
                name,
                right.pictures,
                warnings,
                "0",
                percent(wrong.warned / wrong.pictures),
                percent(wrong.wrong / wrong.pictures),
                in_a_row,
                verdict(warnings == 0),
            )
    table.row("all", total, false, "0", None, None, None, verdict(false == 0))
