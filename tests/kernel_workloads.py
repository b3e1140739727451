"""Frames, odometry and targets as varied as a robot meets them, to find every loop that the calls of an object reach.

``python tests/kernel_workloads.py [GROUP...]`` writes `signatures.json` beside the kernels of each package by them: for
each loop the types of its arguments. Run it where they have changed; a slow test finds what is missing.
"""

from __future__ import annotations

import json
import math
import os
import runpy
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from field_models import COLOR_NAMES, Field, load_field
from robocup_vision import Memory, MotionLimits, Pose2, PoseEstimate, Steering, Vision, Wayfinder, load_camera
from robocup_vision.calibration.forward.by_edges import calibrate_by_edges
from robocup_vision.calibration.omni.calibrate import calibrate_omni
from robocup_vision.calibration.online import OnlineCalibration, OnlineSettings
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera import PinholeCamera
from robocup_vision.compiling.prepared_kernels import spelled_type
from robocup_vision.disc import Disc
from robocup_vision.mapping import ViewMotion

ROOT = Path(__file__).parents[1]
STEP = Pose2(0.01, 0.002, 0.01)
# every frame that tells something is used
OFTEN = OnlineSettings(every_s=0.01, min_step_s=0.01)
LIMITS = MotionLimits(speed_mps=0.4, acceleration_mps2=0.3, dead_time_s=0.03)

# what a workload has made before its first `yield` belongs to other groups; before its second, to its constructors
Workload = Iterator[None]


def images(name: str) -> list[Any]:
    return [cv2.imread(str(path)) for path in sorted((ROOT / "images" / name / "images").iterdir())]


def empty_frames(size_px: tuple[int, int], rng: np.random.Generator) -> list[Any]:
    """Return frames that show no field."""
    shape = (size_px[1], size_px[0], 3)
    levels = [np.full(shape, level, dtype=np.uint8) for level in (0, 90, 255)]
    green = np.full(shape, (50, 130, 45), dtype=np.uint8)
    return [*levels, green, rng.integers(0, 256, shape).astype(np.uint8)]


def mirror_frames(seed: int, count: int, field: str = "ssl_2001") -> list[Any]:
    from sim2d.rendering.cameras import sekimori_camera
    from sim2d.rendering.random_scenes import CONDITIONS, sample

    frames = []
    for name in ("nominal", "crowd", "bad_day", "dark", "miscalibrated"):
        drawn = sample(load_field(field), sekimori_camera(), CONDITIONS[name], seed, count, supersample=2)
        frames += [(one.frame, one.pose) for one in drawn]
    return frames


def look_at(vision: Vision, frames: list[tuple[Any, Pose2]]) -> None:
    """Look at frames alone, in a sequence, and by priors of both kinds, right and wrong."""
    for frame, pose in frames:
        vision.forget()
        _ = vision.look(frame).obstacles
        vision.look(frame, odometry=STEP)
        vision.look(frame, prior=pose)
        for off_m in (0.0, 1.0):
            near = Pose2(pose.x_m + off_m, pose.y_m, pose.theta_rad)
            vision.look(frame, prior=PoseEstimate(near, np.diag([0.05, 0.05, 0.05]) ** 2, 1.0, 0.0))


def mirror(method: str, seed: int = 1, count: int = 4) -> Workload:
    yield
    camera = load_camera(ROOT / "images" / "omni_ssl_2001" / "camera.toml")
    mask = np.zeros((220, 256), dtype=np.uint8)
    mask[100:120, 110:140] = 1
    visions = [Vision(load_field("ssl_2001"), camera, method=method)]
    visions.append(Vision(load_field("ssl_2001"), camera, method=method, mask=mask))
    if method == "field":
        by_lines = Vision(load_field("msl_6x4"), camera)
        visions += [by_lines, Vision(load_field("ssl_division_b"), camera)]
        # a calibration looks by this method too
        Vision(load_field("ssl_2001"), camera, method="floor")
    yield
    rng = np.random.default_rng(seed)
    frames = [(frame, Pose2(0.0, 0.0, 0.0)) for frame in [*images("omni_ssl_2001"), *empty_frames((256, 220), rng)]]
    # balls that the picture cuts
    frames += [(cv2.circle(frame.copy(), (128, 217), 4, COLOR_NAMES["orange"], -1), pose) for frame, pose in frames[:6]]
    frames += mirror_frames(seed, count)
    for vision in visions:
        look_at(vision, frames)
    vision = visions[0]
    vision.forget()
    vision.look(frames[0][0])
    look_at(Vision(load_field("ssl_2001"), camera, vision.colors, method=method), frames[:30])
    if method == "field":
        look_at(by_lines, mirror_frames(seed, count, "msl_6x4"))
        calibrate_omni(load_field("ssl_2001"), images("omni_ssl_2001")[:3])
        online = OnlineCalibration(load_field("ssl_2001"), camera, settings=OFTEN)
        look_at(Vision(load_field("ssl_2001"), camera, online=online), frames[:10])


def with_balls(frames: list[tuple[Any, Pose2]], camera: PinholeCamera, field: Field) -> list[tuple[Any, Pose2]]:
    """Return frames in which balls are painted as well: whole ones, and some that the picture cuts."""
    tilt_rad = -0.17 if camera.tilt_rad is None else camera.tilt_rad
    held, radius_m = camera.with_orientation(0.0, tilt_rad, 0.0), field.ball_radius_m
    blue, green, red = COLOR_NAMES[field.ball_color]
    painted = []
    for index, (frame, pose) in enumerate(frames):
        one = frame.copy()
        lowest = held.pixel_to_floor((held.center_px[0], held.size_px[1] - 1.0))[0]
        for ahead_m, aside_m in ((lowest, 0.0), (2.0 * lowest, 0.3 * lowest * (-1) ** index)):
            place = np.array((ahead_m, aside_m, radius_m))
            u, v = np.rint(held.point_to_pixel(place)).astype(int).tolist()
            half_px = held.focal_px[0] * radius_m / float(np.linalg.norm(place - held.viewpoint_m))
            cv2.circle(one, (u, v), round(half_px), (blue, green, red), -1)
        painted.append((one, pose))
    return painted


def walk_frames(seed: int, count: int, field: Field | None = None) -> tuple[PinholeCamera, list[tuple[Any, Pose2]]]:
    from sim2d.rendering.pinhole import render_pinhole
    from sim2d.rendering.scene import Room, Scene
    from sim2d.rendering.sensor import Sensor

    camera = PinholeCamera(
        size_px=(208, 160),
        focal_px=(192.0, 192.0),
        center_px=(103.5, 79.5),
        height_m=0.185,
        height_std_m=0.006,
        pan_rad=0.0,
        tilt_rad=math.radians(-10.0),
        roll_rad=0.0,
        roll_std_rad=math.radians(1.4),
    )
    rng = np.random.default_rng(seed)
    field = load_field("four_legged_2007") if field is None else field
    scene, sensor = Scene(field, room=Room(seed=5)), Sensor(noise_sigma=3.0, blur_px=0.6)
    frames = []
    for _ in range(count):
        robot = Pose2(*rng.uniform((-2.0, -1.2, -math.pi), (2.0, 1.2, math.pi)))
        frames.append((sensor.expose(render_pinhole(camera, scene, robot, supersample=2), rng), robot))
    return camera, frames


def pinhole(method: str, seed: int = 1, count: int = 12) -> Workload:
    yield
    field = load_field("four_legged_2007")
    camera: PinholeCamera
    if method == "goal":
        from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, sample_goal

        loaded = load_camera(ROOT / "images" / "goal_four_legged" / "camera.toml")
        assert isinstance(loaded, PinholeCamera)
        camera = loaded
        frames = [(frame, Pose2(-0.5, 0.2, 0.1)) for frame in images("goal_four_legged")]
        for condition in (GOAL_CONDITIONS["heavy_glare_416x320"],):
            frames += [(one.frame, one.pose) for one in sample_goal(field, condition, seed, count)]
    else:
        camera, frames = walk_frames(seed, count, field)
    visions = [Vision(field, camera, method=method)]
    if method == "edges":
        visions.append(Vision(load_field("ssl_division_b"), camera))
        visions.append(Vision(field, replace(camera, roll_std_rad=None, height_std_m=0.0)))
    if method == "goal":
        # white goals, and lines by which the tilt is told
        white = tuple(replace(goal, color="white") for goal in field.goals)
        visions.append(Vision(replace(field, goals=white, beacons=()), camera))
        condition = GOAL_CONDITIONS["white_640x480"]
        # patterned balls' loops have a group of their own
        spl = replace(load_field("spl_2020"), ball_patches="")
        white_vision = Vision(spl, condition.camera, method=method)
        white_frames = [(one.frame, one.pose) for one in sample_goal(spl, condition, seed, count)]
    if field.ball_color not in ("white", "black"):
        frames = frames + with_balls(frames[:4], camera, field)
    yield
    if method == "goal":
        look_at(white_vision, white_frames)
        for frame, _ in white_frames:
            white_vision.look(frame)
    frames = frames + [(one, Pose2(0.0, 0.0, 0.0)) for one in empty_frames(camera.size_px, np.random.default_rng(seed))]
    for vision in visions:
        look_at(vision, frames)
        for frame, _ in frames[:5]:
            vision.look(frame, pan_rad=0.3)
    for frame, _ in frames:
        visions[0].forget()
        view = visions[0].look(frame)
        if method == "goal":
            _ = view.markings
    look_at(Vision(field, camera, visions[0].colors, method=method), frames)
    if method == "edges":
        shown, places = {0: frames[0][0], 1: frames[1][0]}, {0: frames[0][1], 1: frames[1][1]}
        calibrate_by_edges(field, shown, [camera], places, StartTrials())
        look_at(Vision(field, camera, online=OnlineCalibration(field, camera, settings=OFTEN)), frames[:8])


def patterned_balls() -> Workload:
    camera = PinholeCamera((320, 240), (300.0, 300.0), (159.5, 119.5), 0.46, pan_rad=0.0, tilt_rad=-0.2, roll_rad=0.0)
    frame = np.full((240, 320, 3), (55, 130, 70), dtype=np.uint8)
    frames = [frame, *empty_frames(camera.size_px, np.random.default_rng(1))]
    for plain in frames:
        Vision(load_field("four_legged_2007"), camera).look(plain)
    yield
    vision = Vision(load_field("spl_2020"), camera)
    yield
    cv2.circle(frame, (160, 150), 14, (225, 225, 225), -1)
    for place in ((160, 150), (152, 143), (168, 143), (160, 160)):
        cv2.circle(frame, place, 3, (30, 30, 30), -1)
    for one in frames:
        vision.look(one)


def steering(seed: int = 1, count: int = 4) -> Workload:
    camera = load_camera(ROOT / "images" / "omni_ssl_2001" / "camera.toml")
    vision = Vision(load_field("ssl_2001"), camera)
    frames = [*images("omni_ssl_2001"), *(frame for frame, _ in mirror_frames(seed, count))]
    views = [vision.look(frame) for frame in frames]
    yield
    drivers = [Steering(robot_radius_m=0.09, limits=LIMITS)]
    ways = Wayfinder(0.09)
    yield
    rng = np.random.default_rng(seed)
    discs = [Disc(0.6, 0.2, 0.09, vx_mps=-0.3, vy_mps=0.1), Disc(-0.5, 0.1, 0.09)]
    for view in views:
        for driver in drivers:
            for velocity in ((0.0, 0.0), (0.3, -0.1)):
                bearing = float(rng.uniform(-math.pi, math.pi))
                driver.steer(view.free_space, velocity, target_bearing_rad=bearing)
                driver.steer(view.free_space, velocity, target_bearing_rad=bearing, moving=discs)
                driver.steer(view.free_space, velocity, target_bearing_rad=bearing, moving=discs[:1])
        ways.update(view.free_space, STEP)
        ways.head(float(rng.uniform(-math.pi, math.pi)), 1.0, (0.1, 0.0))


def memory(seed: int = 1, count: int = 40) -> Workload:
    from sim2d.match.arena import Arena
    from sim2d.robot_link import Command

    field = load_field("ssl_2001")
    arena = Arena(field, players=2, seed=seed)
    senses = []
    for _ in range(count):
        senses.append(arena.senses()[0])
        arena.step({0: Command(0.3, 0.0, 0.2), 1: Command(0.3, 0.0, -0.9), 2: Command(0.3, 0.0, 0.9)})
    alone = Vision(field, arena.camera)
    for one in senses:
        alone.look(one.frame, odometry=one.odometry)
        alone.look(one.frame, prior=PoseEstimate(Pose2(0.0, 0.0, 0.0), np.diag([0.05, 0.05, 0.05]) ** 2, 1.0, 0.0))
    walker, walk = walk_frames(seed, 5)
    head = Vision(load_field("four_legged_2007"), walker)
    look_at(head, walk)
    yield
    whole = Vision(field, arena.camera, memory=Memory.of_everything(field))
    seen = Vision(field, arena.camera, memory=Memory(field, ego_motion=ViewMotion()))
    forward = Vision(
        load_field("four_legged_2007"), walker, memory=Memory.of_everything(load_field("four_legged_2007"))
    )
    yield
    for one in senses:
        whole.look(one.frame, one.t_s, odometry=one.odometry)
        seen.look(one.frame, one.t_s)
    for index, (frame, _) in enumerate(walk * 3):
        forward.look(frame, 0.1 * index, odometry=STEP)


def example(*names: str) -> Workload:
    yield
    yield
    folder = os.getcwd()
    with tempfile.TemporaryDirectory() as out:
        os.chdir(out)
        for name in names:
            runpy.run_path(str(ROOT / "examples" / f"{name}.py"))
        os.chdir(folder)


def match_frames(cameras: dict[str, str]) -> Workload:
    from sim2d.match.arena import Arena
    from sim2d.match.setups import setup_for
    from sim2d.robot_link import Command

    yield
    yield
    for field, camera in cameras.items():
        one = load_field(field)
        arena = Arena(one, players=1, seed=1, camera=setup_for(one, camera=camera).camera)
        for _ in range(3):
            arena.senses()
            arena.step({0: Command(0.3, 0.0, 0.2), 1: Command(0.3, 0.0, -0.9)})


def pictures(seed: int = 1) -> Workload:
    from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, sample_goal

    yield
    yield
    mirror_frames(seed, 1)
    for name in ("four_legged_2007", "spl_2020", "ssl_2001"):
        walk_frames(seed, 1, load_field(name))
    for _ in sample_goal(load_field("four_legged_2007"), GOAL_CONDITIONS["heavy_glare_416x320"], seed, 1):
        pass


def hall(seed: int = 1) -> Workload:
    from sim2d.rendering.hall.hall import HallCamera
    from sim2d.rendering.hall.lecture_hall import make_lecture_hall, visit, way
    from sim2d.rendering.hall.runs import HALL_CAMERA, take

    yield
    HallCamera(HALL_CAMERA)
    yield
    people, bustle = visit(make_lecture_hall(seed), seed)
    for _ in take(people, (HALL_CAMERA,), way(143)[:2], seed, bustle=bustle):
        pass


# of each package with kernels
WORKLOADS: dict[str, dict[str, Callable[[], Workload]]] = {
    "robocup_vision": {
        **{f"mirror_{name}": (lambda name=name: mirror(name)) for name in ("field", "floor", "hull")},
        **{f"pinhole_{name}": (lambda name=name: pinhole(name)) for name in ("edges", "goal")},
        "patterned_balls": patterned_balls,
        "steering": steering,
        "memory": memory,
        "planning": lambda: example("planning"),
        "landmarks": lambda: example("landmarks"),
    },
    "sim2d": {
        "mirror_frames": lambda: match_frames({"ssl_2001": "sekimori", "msl_18x12": "msl_mirror"}),
        "forward_frames": lambda: match_frames(
            {"four_legged_2007": "ers7", "spl_2020": "nao", "humanoid_kid_2025": "kid_fisheye"}
        ),
        "pictures": pictures,
        "hall": hall,
    },
}


def overloads(package: str) -> dict[str, set[Any]]:
    """Return the types of arguments that each loop of a package has been compiled or loaded for so far."""
    found: dict[str, set[Any]] = {}
    kernels = ROOT / package / "kernels"
    for path in sorted(kernels.rglob("*.py")):
        module = ".".join(path.relative_to(kernels).with_suffix("").parts)
        if path.name == "__init__.py":
            continue
        in_full = f"{package}.kernels.{module}"
        for name, value in vars(import_module(in_full)).items():
            # a loop that another module imports is listed where it stands
            if hasattr(value, "overloads") and value.py_func.__module__ == in_full:
                found[f"{module}.{name}"] = set(value.overloads)
    return found


def record(package: str, group: str) -> list[Any]:
    """Return the loops that a group's calls reach, with the types of their arguments."""
    workload = WORKLOADS[package][group]()
    next(workload)
    before = overloads(package)
    for _ in workload:
        pass
    entries = []
    for kernel, found in overloads(package).items():
        entries += [[kernel, [spelled_type(one) for one in types]] for types in found - before[kernel]]
    return sorted(entries, key=json.dumps)


def signatures(package: str) -> Path:
    return ROOT / package / "kernels" / "signatures.json"


def listed(package: str) -> dict[str, list[Any]]:
    path = signatures(package)
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write(package: str, groups: dict[str, list[Any]]) -> None:
    lines = [
        f' "{group}": [\n  ' + ",\n  ".join(json.dumps(entry) for entry in entries) + "\n ]"
        for group, entries in sorted(groups.items())
    ]
    signatures(package).write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def list_anew(package: str, group: str) -> None:
    groups = listed(package)
    # constructors compile what is listed: what is no longer called would stay in the list
    groups.pop(group, None)
    write(package, groups)
    command = [sys.executable, __file__, "record", package, group]
    # callees of a loop that is compiled anew would be taken for loops that are called: the second run loads all
    subprocess.run(command, capture_output=True, check=False)
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    groups[group] = json.loads(done.stdout.splitlines()[-1])
    write(package, groups)
    print(group, len(groups[group]))


if __name__ == "__main__":
    if sys.argv[1:2] == ["record"]:
        cv2.setNumThreads(0)
        print(json.dumps(record(*sys.argv[2:])))
    else:
        for package, workloads in WORKLOADS.items():
            for group in workloads:
                if group in sys.argv[1:] or len(sys.argv) == 1:
                    list_anew(package, group)
