"""White balls with dark patches in rendered pictures of a forward camera: found, and where nothing lies.

Two in three pictures show a ball, 0.45 to 3.5 m away, every other one within some centimetres of a white line. Up to
two other robots stand about, patches of sunlight lie on the carpet, all kinds of things stand beyond it. Each picture
is searched by itself, once with the camera's tilt known and once without. A hit is a find within half the ball's radius
and a pixel of its centre; a ball that another robot may hide does not count. "error": distance of a found ball from
its true place.
"""

from __future__ import annotations

import dataclasses
import math
from argparse import Namespace
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Table, program, verdict
from field_models import COLOR_NAMES, load_field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.perception.balls.finder import BallFinder
from robocup_vision.perception.balls.projection import BallFrame
from sim2d.rendering.backdrop import Backdrop, BackdropKind
from sim2d.rendering.goal.scenes import ROUGH_SHOT, nao_camera
from sim2d.rendering.goal.surroundings import sun_patch
from sim2d.rendering.pinhole import render_pinhole, smear
from sim2d.rendering.scene import Ball, Light, Robot, Room, Scene

FIELD = load_field("spl_2020")
NEAREST_M, FARTHEST_M, HALF_VIEW_RAD = 0.45, 3.5, 0.45
# a robot so near to the ray to a ball may hide it
HIDING_M = 0.2
BACKDROPS: tuple[BackdropKind, ...] = ("plain", "hall", "hall")
MIN_FOUND, MAX_FALSE = 0.85, 0.05


class Picture(NamedTuple):
    """A picture, its camera as held, and the ball's place in robot frame and picture, unless there is none."""

    frame: UInt8Array
    camera: PinholeCamera
    place_m: tuple[float, float] | None
    center_px: tuple[float, float]
    radius_px: float
    is_hidden: bool


def _ball(pose: Pose2, camera: PinholeCamera, rng: np.random.Generator) -> Ball | None:
    on_lines = FIELD.line_points(0.05)
    for _ in range(200):
        if rng.random() < 0.5:
            x, y = on_lines[rng.integers(len(on_lines))] + rng.normal(0.0, 0.04, 2)
        else:
            away, bearing = rng.uniform(NEAREST_M, FARTHEST_M), rng.uniform(-HALF_VIEW_RAD, HALF_VIEW_RAD)
            x, y = pose.transform([away * math.cos(bearing), away * math.sin(bearing)])
        on_robot = pose.inverse().transform([x, y])
        if not FIELD.contains([x, y]) or not NEAREST_M <= float(np.hypot(*on_robot)) <= FARTHEST_M:
            continue
        u, v = camera.floor_to_pixel(on_robot).tolist()
        if 20 <= u <= camera.size_px[0] - 20 and 20 <= v <= camera.size_px[1] - 10:
            turn = rng.uniform(-math.pi, math.pi, 3)
            color, patches = COLOR_NAMES[FIELD.ball_color], COLOR_NAMES[FIELD.ball_patches]
            return Ball(float(x), float(y), FIELD.ball_radius_m, color, patches, (turn[0], turn[1], turn[2]))
    return None


def picture(seed: int, index: int) -> Picture:
    """Render one picture."""
    rng = np.random.default_rng([seed, index])
    held = nao_camera()
    height = held.height_m * float(rng.uniform(0.95, 1.05))
    camera = dataclasses.replace(held, height_m=height).with_orientation(
        0.0, float(rng.uniform(-0.35, -0.05)), float(rng.normal(0.0, 0.01))
    )
    half = FIELD.length_m / 2, FIELD.width_m / 2
    pose = Pose2(
        float(rng.uniform(-half[0], half[0])), float(rng.uniform(-half[1], half[1])), float(rng.uniform(-3.14, 3.14))
    )
    ball = _ball(pose, camera, rng) if index % 3 else None
    robots = []
    for _ in range(int(rng.integers(0, 3))):
        away, bearing, tone = rng.uniform(0.9, 4.0), rng.uniform(-0.5, 0.5), float(rng.uniform(190, 235))
        x, y = pose.transform([away * math.cos(bearing), away * math.sin(bearing)]).tolist()
        robots.append(Robot(x, y, 0.12, 0.55, (tone, tone, tone), (40.0, 40.0, 40.0)))
    scene = Scene(
        field=FIELD,
        robots=tuple(robots),
        ball=ball,
        light=Light(
            level=float(rng.uniform(0.6, 1.05)),
            gradient=float(rng.uniform(0.0, 0.3)),
            gradient_direction_rad=float(rng.uniform(-math.pi, math.pi)),
            texture=0.1,
            texture_seed=int(rng.integers(2**31)),
        ),
        room=Room(seed=int(rng.integers(2**31)), distance_m=float(rng.uniform(0.3, 1.5))),
        carpet_margin_m=float(rng.uniform(0.0, 0.5)),
    )
    backdrop = Backdrop(BACKDROPS[int(rng.integers(len(BACKDROPS)))], seed=int(rng.integers(2**31)))
    sun = tuple(sun_patch(FIELD, rng) for _ in range(int(rng.integers(4))))
    light = smear(
        render_pinhole(camera, scene, pose, backdrop=backdrop, sun=sun, supersample=2), float(rng.uniform(0.0, 2.0))
    )
    frame = ROUGH_SHOT.expose(light, rng)
    if ball is None:
        return Picture(frame, camera, None, (0.0, 0.0), 0.0, False)
    place = pose.inverse().transform([ball.x_m, ball.y_m])
    ray = np.array([*place, ball.radius_m - camera.height_m])
    away = float(np.linalg.norm(ray))
    u, v = camera.ray_to_pixel(ray / away).tolist()
    hidden = any(_may_hide(pose.inverse().transform([robot.x_m, robot.y_m]), place) for robot in robots)
    radius_px = camera.focal_px[0] * ball.radius_m / math.sqrt(away**2 - ball.radius_m**2)
    return Picture(frame, camera, (float(place[0]), float(place[1])), (u, v), radius_px, hidden)


def _may_hide(robot: np.ndarray, ball: np.ndarray) -> bool:
    away = float(np.hypot(*robot))
    off = math.atan2(robot[1], robot[0]) - math.atan2(ball[1], ball[0])
    return away < float(np.hypot(*ball)) + 0.15 and abs(off) * away < HIDING_M


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    count = 6 if arguments.quick else 600 if arguments.full else 120
    pictures = [picture(arguments.seed, index) for index in range(count)]
    with_ball = sum(one.place_m is not None and not one.is_hidden for one in pictures)
    table = Table(
        f"{count} pictures     | found: rate | false finds: count | median error m: error 0.005 | target | "
        "verdict: verdict",
        name="patterned balls",
    )
    for label, is_known in (("tilt known", True), ("tilt unknown", False)):
        hits = false = 0
        errors = []
        for one in pictures:
            camera = one.camera if is_known else dataclasses.replace(one.camera, tilt_rad=None, roll_rad=None)
            is_found = False
            for ball in BallFinder(FIELD, camera).find(BallFrame(one.frame, camera)):
                off_px = math.dist((ball.u_px, ball.v_px), one.center_px)
                if one.place_m is None or off_px > 0.5 * one.radius_px + 1.0:
                    false += 1
                elif not is_found:
                    is_found = True
                    errors.append(math.dist((ball.x_m, ball.y_m), one.place_m))
            hits += is_found and not one.is_hidden
        is_met = hits >= MIN_FOUND * with_ball and false <= MAX_FALSE * count
        error = f"{np.median(errors):.3f}" if errors else "-"
        due = f">= {MIN_FOUND:.0%}, <= {MAX_FALSE:.0%}"
        table.row(label, f"{hits}/{with_ball}", str(false), error, due, verdict(is_met))
