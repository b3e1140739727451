"""Colours with nothing given, while the light changes; colour files; and pinhole cameras from pictures of goals.

LIGHT. A mirror robot (ssl_2001, 256 x 220) drives a tour of 60 frames (--quick: 20) between four boxes, with odometry,
from learnt colours of its first frame on: light falls from 1.0 to 0.3; its hue turns to warm (gains of blue, green, red
0.5, 0.9, 1.35); both. 4 tours each (--quick: 1, --full: 12). "lost": frames not located, or off by more than 5 cm or 3
degrees.

HOSTILE. The same robot stands still for 32 frames while robots of radius 0.09 m are parked around it 0.19 m away from
frame 4 to 26, or a board 3 m wide stands 0.12 m before it, or lights are switched (level 1, 0.02, 1, 0.02; 1, 0.3, 1.6,
1; neutral, warm, cold, neutral), or a strip of shade wanders over a sunny floor. "learnt wrongly": frames after which
the colour of the thing (of white, where there is none), under that frame's light, is taken for floor, or the carpet's
is not; "lost" as above. Frames at level 0.02 count for neither: nothing can be seen.

FILES. `calibrate_colors` on 12 images (--quick: 2, --full: 40) of a condition, no camera, no poses: greatest relative
error of R/G and B/G of floor and white against the paint under that light.

REAL. Six photographs of ../shared/real/onboard_ssl ("not installed" without them): intersection over union of the floor
seen, from the outline in `View.boundary_px` downwards, and the carpet projected from the given pose; "half": with the
carpet ending 0.3 m behind the halfway line, since the photographs show a hall of half a field. Blur: whether the
variance of the picture's Laplacian is below 60.

PINHOLE. `calibrate_forward` on 12 rendered pictures (--quick: 2) of a goal from anywhere, from starts that are 12 % off
in focal length and 3 cm in height; and on goal_spl from its own file. A consistent standard deviation s puts the error
within 3 s.
"""

from __future__ import annotations

import itertools
import math
from argparse import Namespace
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from benchmarks.harness import Table, program, verdict
from benchmarks.scores.photograph_rows import REAL, known_poses, photographs
from field_models import load_field
from robocup_vision import Vision, load_camera
from robocup_vision.calibration.colors import calibrate_colors
from robocup_vision.calibration.forward.calibrate import ForwardCalibration, calibrate_forward
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.perception.color_table import CLASS_NAMES, Colors, ColorTable, build_color_table
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, sample_goal
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.random_scenes import CONDITIONS, sample
from sim2d.rendering.scene import BOX_COLORS, Box, Light, Robot, Room, Scene, Shadow
from sim2d.rendering.sensor import Sensor

ONBOARD_FIELD = Path(__file__).resolve().parents[2] / "tests" / "data" / "onboard_ssl_field.toml"
FIELD, CAMERA = load_field("ssl_2001"), sekimori_camera()
NEUTRAL, WARM, COLD = (1.0, 1.0, 1.0), (0.5, 0.9, 1.35), (1.4, 0.95, 0.6)
GREEN, WHITE = (50, 130, 45), (230, 230, 230)
ROBOTS = {"black": (45, 42, 40), "grey": (125, 125, 125), "red": (40, 40, 200), "white": (235, 235, 235)}
WALLS = {"white": (235, 235, 235), "black": (35, 35, 35), "wood": (105, 155, 190)}
NEAR_M, NEAR_RAD = 0.05, math.radians(3)
STAND = 32
DARK = 0.1
MIN_OVERLAP, BLURRED = 0.97, 60.0
MAX_COLOR_ERROR = 0.06


@dataclass(frozen=True)
class Shot:
    """One frame's light and things."""

    level: float = 1.0
    cast: tuple[float, float, float] = NEUTRAL
    shadow: Shadow | None = None
    robots: tuple[Robot, ...] = ()
    boxes: tuple[Box, ...] = ()


class Watcher:
    """A robot with colours of its own that looks at one frame after the other."""

    def __init__(self, seed: int) -> None:
        self.vision = Vision(FIELD, CAMERA)
        self._renderer, self._rng = MirrorRenderer(CAMERA, 2), np.random.default_rng(seed)
        self._room = Room(seed, 1.2, bystanders=8)
        self._last: Pose2 | None = None
        self._table: tuple[Colors, ColorTable] | None = None
        self.learnt = 0

    def is_lost(self, shot: Shot, pose: Pose2) -> bool:
        """Look; return whether there is no pose, or a wrong one."""
        light = Light(level=shot.level, gradient=0.2, shadow=shot.shadow)
        scene = Scene(FIELD, boxes=shot.boxes, robots=shot.robots, light=light, room=self._room)
        frame = Sensor(8.0, 0.7, 0.25, cast_bgr=shot.cast).expose(self._renderer.render(scene, pose), self._rng)
        known = self.vision.colors
        odometry = None if self._last is None else self._last.inverse().compose(pose)
        found = self.vision.look(frame, odometry=odometry).pose
        self._last = pose
        self.learnt += self.vision.colors is not known
        if not found:
            return True
        off_m, off_rad = found.pose.error_to(pose, symmetric=True)
        return off_m > NEAR_M or off_rad > NEAR_RAD

    def is_floor(self, bgr: tuple[float, float, float], shot: Shot) -> bool:
        """Whether the colours in use take a paint for floor under this light."""
        colors = self.vision.colors
        assert colors is not None
        # a table takes longer than a frame, and most frames keep the colours
        if self._table is None or self._table[0] is not colors:
            self._table = colors, build_color_table(colors)
        seen = np.clip(np.array(bgr) * shot.cast * shot.level, 0, 255).astype(np.uint8)
        return bool(self._table[1].segment(seen[None, None])[0, 0] == CLASS_NAMES.index("floor"))


def tour(rng: np.random.Generator, frames: int) -> tuple[list[Pose2], tuple[Box, ...]]:
    """Draw poses along a closed curve, and boxes beside it."""
    phase = rng.uniform(0, math.tau, 3)
    way = np.arange(frames) / frames * 4.4
    poses = [
        Pose2(0.9 * math.sin(s + phase[0]), 0.45 * math.sin(2 * s + phase[1]), math.remainder(s + phase[2], math.tau))
        for s in way
    ]
    boxes: list[Box] = []
    while len(boxes) < 4:
        x, y = rng.uniform((-1.2, -0.65), (1.2, 0.65))
        box = Box(float(x), float(y), color_bgr=list(BOX_COLORS.values())[int(rng.integers(len(BOX_COLORS)))])
        if min(box.distance_m(p.x_m, p.y_m) for p in poses) > 0.15:
            boxes.append(box)
    return poses, tuple(boxes)


def measure_light(seed: int, tours: int, frames: int) -> None:
    """Print the tours under changing light."""
    columns = "light                         | frames | lost: count | learnt anew | target | verdict"
    table = Table(columns, "Light that changes", name="light")
    for number, (name, darker, warmer) in enumerate(
        (("falls from 1.0 to 0.3", 1, 0), ("turns to warm", 0, 1), ("falls and turns to warm", 1, 1))
    ):
        lost = learnt = 0
        for i in range(tours):
            rng = np.random.default_rng([seed, number, i])
            poses, boxes = tour(rng, frames)
            watcher = Watcher(int(rng.integers(2**31)))
            for s, pose in zip(np.linspace(0, 1, frames), poses, strict=True):
                cast = tuple(float(1 + warmer * s * (w - 1)) for w in WARM)
                shot = Shot(1 - 0.7 * darker * float(s), (cast[0], cast[1], cast[2]), boxes=boxes)
                lost += watcher.is_lost(shot, pose)
            learnt += watcher.learnt
        table.row(name, tours * frames, lost, learnt, "0 lost", verdict(lost == 0))


def hostile(pose: Pose2) -> Iterator[tuple[str, tuple[float, float, float], Callable[[int], Shot]]]:
    """Yield name, colour that must not be learnt, and each frame's shot."""

    def parked(robots: tuple[Robot, ...], boxes: tuple[Box, ...], i: int) -> Shot:
        return Shot(robots=robots, boxes=boxes) if 4 <= i < 26 else Shot()

    for name, color in ROBOTS.items():
        for count in (1, 4, 6):
            angles = np.arange(count) * math.tau / count
            places = pose.transform(0.19 * np.stack([np.cos(angles), np.sin(angles)], axis=1))
            robots = tuple(Robot(float(x), float(y), 0.09, 0.14, color) for x, y in places)
            yield f"{count} {name} robots", color, partial(parked, robots, ())
    ahead = pose.compose(Pose2(0.145, 0.0, 0.0))
    for name, color in WALLS.items():
        wall = Box(ahead.x_m, ahead.y_m, ahead.theta_rad, 0.05, 3.0, 0.2, color)
        yield f"{name} wall", color, partial(parked, (), (wall,))
    yield "lights off and on", WHITE, lambda i: Shot((1.0, 0.02, 1.0, 0.02)[i // 8])
    yield "lights dimmed and up", WHITE, lambda i: Shot((1.0, 0.3, 1.6, 1.0)[i // 8])
    yield "lights of other hues", WHITE, lambda i: Shot(1.0, (NEUTRAL, WARM, COLD, NEUTRAL)[i // 8])
    yield "sun and wandering shade", WHITE, lambda i: Shot(1.6, NEUTRAL, _strip(i))


def _strip(i: int) -> Shadow:
    low_m = -1.5 + 0.1 * i
    return Shadow(0.3, low_m, low_m + 1.0, (0.30, 0.26, 0.22))


def measure_hostile(seed: int, step: int) -> None:
    """Print what is learnt when robots, walls and lights want it otherwise."""
    table = Table(
        (
            "what                         | frames | lost: count | learnt wrongly: count | learnt anew | "
            "target | verdict"
        ),
        "Hostile surroundings",
        name="hostile",
    )
    pose = Pose2(0.3, 0.1, 0.4)
    for name, color, shot_at in itertools.islice(hostile(pose), 0, None, step):
        watcher = Watcher(seed)
        frames = lost = wrong = 0
        for i in range(STAND):
            shot = shot_at(i)
            is_lost = watcher.is_lost(shot, pose)
            if shot.level < DARK:
                continue
            frames += 1
            lost += is_lost
            wrong += watcher.is_floor(color, shot) or not watcher.is_floor(GREEN, shot)
        ok = lost == 0 and wrong == 0
        table.row(name, frames, lost, wrong, watcher.learnt, "0, 0", verdict(ok))


def measure_files(seed: int, count: int) -> None:
    """Print colour files from pictures."""
    columns = "colour file, condition | images used: rate | worst ratio off %: error | target | verdict"
    table = Table(columns, "Colour files", name="files", samples=count)
    for name in ("nominal", "warm", "cold", "dark", "bad_day"):
        condition = CONDITIONS[name]
        frames = ((str(s.index), partial(_frame, s.frame)) for s in sample(FIELD, CAMERA, condition, seed, count))
        result = calibrate_colors(FIELD, frames)
        if not result:
            table.row(name, 0, None, "<= 6", verdict(False))
            continue
        error = 0.0
        for paint, bgr in ((result.colors.floor.lit, GREEN), (result.colors.line, WHITE)):
            blue, green, red = np.array(bgr) * condition.cast_bgr
            error = max(error, abs(paint.red_ratio * green / red - 1), abs(paint.blue_ratio * green / blue - 1))
        ok = error <= MAX_COLOR_ERROR
        table.row(name, f"{result.frames}/{count}", 100 * error, "<= 6", verdict(ok))


def _frame(frame: np.ndarray) -> np.ndarray:
    return frame


def measure_real() -> None:
    """Print how well floor is separated in photographs."""
    columns = "onboard_ssl           | blur | overlap: score | half: score | target | verdict"
    # photographs do not change: a thousandth is a change
    table = Table(columns, "Real floor", name="floor", samples=10_000)
    folder = REAL / "onboard_ssl"
    if not folder.is_dir():
        table.row("photographs", "not installed", None, None, None, None)
        return
    camera = load_camera(folder / "camera.toml")
    vision = Vision(load_field(ONBOARD_FIELD), camera, method="field")
    width, height = camera.size_px
    v, u = np.mgrid[:height, :width]
    floor = np.nan_to_num(camera.pixel_to_floor(np.stack([u, v], axis=-1)), nan=99.0).reshape(-1, 2)
    for name, pose in known_poses("onboard_ssl").items():
        frame = np.asarray(cv2.imread(str(folder / "images" / name)), dtype=np.uint8)
        vision.forget()
        edge = vision.look(frame).boundary_px
        edge = edge[np.isfinite(edge).all(axis=1)]
        edge = edge[np.argsort(edge[:, 0])]
        seen = v >= np.interp(np.arange(width), edge[:, 0], edge[:, 1])
        there = pose.transform(floor).reshape(height, width, 2)
        carpet = (np.abs(there) <= (4.2, 3.0)).all(axis=-1)
        half = carpet & (there[..., 0] >= -0.3)
        overlap, overlap_half = (float((seen & c).sum() / (seen | c).sum()) for c in (carpet, half))
        blurred = float(cv2.Laplacian(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), cv2.CV_64F).var()) < BLURRED
        ok = overlap_half >= MIN_OVERLAP
        judged = (None, None) if blurred else (f">= {MIN_OVERLAP:g}, half", verdict(ok))
        table.row(name, "yes" if blurred else "no", overlap, overlap_half, *judged)


def measure_pinhole(seed: int, count: int, supersample: int) -> None:
    """Print pinhole cameras calibrated by goals."""
    table = Table(
        (
            "pictures                 | used | focal off %: error | std % | height off mm: error | std mm | "
            "target | verdict"
        ),
        "Pinhole",
        name="pinhole",
        samples=count,
    )
    for name, field_name in (("clean_416x320", "four_legged_2007"), ("mild_glare_416x320", "four_legged_2007")):
        field, true = load_field(field_name), GOAL_CONDITIONS[name].camera
        samples = list(sample_goal(field, GOAL_CONDITIONS[name], seed, count, supersample=supersample))
        for side in (1, -1):
            off = 1 + 0.12 * side
            start = replace(
                true,
                focal_px=(true.focal_px[0] * off, true.focal_px[1] * off),
                height_m=true.height_m + 0.03 * side,
            )
            result = calibrate_forward(field, [s.frame for s in samples], start)
            height_m = float(np.mean([s.camera.height_m for s in samples]))
            _pinhole_row(table, f"{name}, {12 * side:+d} %", result, true, height_m, count)
    folder = REAL / "goal_spl"
    if folder.is_dir():
        camera = load_camera(folder / "camera.toml")
        assert isinstance(camera, PinholeCamera)
        frames = [frame for _, frame in photographs("goal_spl")][:count]
        result = calibrate_forward(load_field("spl_2020"), frames, camera)
        _pinhole_row(table, "goal_spl", result, camera, camera.height_m, len(frames), judged=False)
    else:
        table.row("goal_spl", "not installed", *[None] * 6)


def _pinhole_row(
    table: Table, label: str, result: object, true: PinholeCamera, height_m: float, count: int, *, judged: bool = True
) -> None:
    if not isinstance(result, ForwardCalibration):
        table.row(label, 0, *[None] * 4, getattr(result, "reason", "")[:30], verdict(False) if judged else None)
        return
    focal_off, focal_std = result.camera.focal_px[0] / true.focal_px[0] - 1, result.std["focal_px"] / true.focal_px[0]
    height_off_m, height_std_m = result.camera.height_m - height_m, result.std["height_m"]
    ok = abs(focal_off) <= 3 * focal_std and abs(height_off_m) <= 3 * height_std_m
    table.row(
        label,
        f"{len(result.frames)}/{count}",
        100 * focal_off,
        100 * focal_std,
        1e3 * height_off_m,
        1e3 * height_std_m,
        "within 3 std" if judged else None,
        verdict(ok) if judged else None,
    )


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    tours, files, goals = (1, 2, 2) if arguments.quick else (12, 40, 12) if arguments.full else (4, 12, 12)
    measure_light(arguments.seed, tours, 20 if arguments.quick else 60)
    # quick: every sixth scene
    measure_hostile(arguments.seed, 6 if arguments.quick else 1)
    measure_files(arguments.seed, files)
    measure_real()
    measure_pinhole(arguments.seed, goals, 3 if arguments.quick else 8)
