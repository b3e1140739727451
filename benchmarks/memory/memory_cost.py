"""What a memory adds to a look of the mirror camera: processor time of `Vision.look` with one, less that without.

A robot of ssl_2001 drives among four others; each of its rendered frames (400; --quick: 60; --full: 2000) is looked at
by a `Vision` without memory that carries its last pose on, by one that filters the pose, by one that tracks other
robots and maps the floor as well (`Memory.of_everything`), and by one that estimates its own motion by views besides.
Figures are medians over frames of the difference; the first 20 frames are left out.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from functools import partial

import numpy as np

from benchmarks.harness import Table, program, verdict
from benchmarks.harness.timing import timed
from benchmarks.worlds.crowd import moves
from field_models import load_field
from robocup_vision import Memory, Vision
from robocup_vision.mapping import ViewMotion
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import RobotLimits
from sim2d.sensors.match_camera import MatchCamera

FIELD = load_field("ssl_2001")
AIM_MS = 1.5
EVERYTHING = "pose, robots, map"
FIRST = 20


def memories() -> Iterator[tuple[str, Memory]]:
    """Yield each kind of memory by its name."""
    yield "pose", Memory(FIELD)
    yield EVERYTHING, Memory.of_everything(FIELD)
    every = Memory.of_everything(FIELD)
    yield "and ego-motion", Memory(FIELD, objects=every.objects, free_map=every.free_map, ego_motion=ViewMotion())


def costs_ms(count: int, seed: int) -> tuple[float, dict[str, float]]:
    """Return the median look without memory, and what each kind of memory adds to it, milliseconds."""
    rng = np.random.default_rng(seed)
    limits, camera = RobotLimits(speed_mps=0.8), sekimori_camera()
    eye = MatchCamera(FIELD, camera, limits, rng)
    bare = Vision(FIELD, camera)
    visions = {name: Vision(FIELD, camera, memory=memory) for name, memory in memories()}
    alone: list[float] = []
    added: dict[str, list[float]] = {name: [] for name in visions}
    for world in moves(FIELD, limits, 4, count, rng):
        frame, odometry = eye.render(world.state, 0), world.odometry(0)
        alone.append(timed(partial(bare.look, frame, world.t_s, odometry))[1])
        for name, vision in visions.items():
            added[name].append(timed(partial(vision.look, frame, world.t_s, odometry))[1] - alone[-1])
    medians = {name: 1e3 * float(np.median(seconds[FIRST:])) for name, seconds in added.items()}
    return 1e3 * float(np.median(alone[FIRST:])), medians


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    look_ms, added_ms = costs_ms(60 if arguments.quick else 2000 if arguments.full else 400, arguments.seed)
    columns = "memory of          | ms added | of a look: time ratio | aim ms | verdict"
    table = Table(columns, f"What a memory adds to a look of {look_ms:.2f} ms", name="cost of a memory")
    for name, added in added_ms.items():
        aim = AIM_MS if name == EVERYTHING else None
        said = None if aim is None else verdict(added <= aim)
        table.row(name, f"{added:.2f}", f"{added / look_ms:.2f}", None if aim is None else f"{aim:g}", said)
