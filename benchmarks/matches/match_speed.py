"""Speed of simulated matches: rendering as a ratio to cv2.cvtColor(BGR2HSV), matches to real time, and with a film.

Rendering: 256 x 220 frames of ssl_2001 with four robots and a ball at random, none alike, drawn through lens and blur
without the sensor's noise, and with it; each beside a conversion of such a frame to HSV, one thread. Ratios are of
medians of the thread's seconds. The same for forward cameras with the sensor's noise, whose heads pan at random, among
eight robots on four_legged_2007 (208 x 160) and on spl_2020 (640 x 480).

Matches: two against two on ssl_2001, every robot with its own mirror camera of 256 x 220 at 30 Hz and the built-in
player; no film, no report. Simulated seconds over the processor's seconds, in one thread: what one core needs if
nothing else runs on it; wall-clock seconds stand beside. The first second of play is left out, because colours are
learnt and compiled code is loaded in it.

Matches with forward cameras: `MatchPlan`, as `robocup-vision match --field F` plays, every disturbance that is on by
default, without film and report: four robots on four_legged_2007 (208 x 160) and twelve on division B. Simulated
seconds over the processor's, one thread, the first second left out.

With the film: `run_match`, which writes film and report, 30 simulated seconds (--quick: 1, --full: 120), on the wall
clock, since a thread of its own draws and encodes: the target needs two cores that nothing else uses. The same play
without any files is run before and after it; their mean says what the machine gave meanwhile. Both times are on the
clock and of the processor, and the film's size is that of a minute.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401 - before NumPy is loaded

# isort: split
import math
import tempfile
from argparse import Namespace
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from numpy.random import Generator

from benchmarks.harness import Table, program, verdict
from benchmarks.harness.timing import timed, unit_s
from field_models import load_field
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from sim2d.match.arena import Arena
from sim2d.match.run import MatchPlan, run_match
from sim2d.match.setups import camera_for
from sim2d.players.built_in import BuiltInPlayer
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.goal.scenes import nao_camera
from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits
from sim2d.sensors.match_camera import MATCH_SENSOR, MatchCamera
from sim2d.world.world import World

FIELD, CAMERA = load_field("ssl_2001"), sekimori_camera(256, 220)
MAX_BARE, MAX_NOISY = 6.0, 20.0
MAX_FORWARD = {"four_legged_2007": 8.0, "spl_2020": 6.0}
MIN_REAL_TIME = 2.0
# players a side, and how many times real time
FORWARD_MATCHES = (("four_legged_2007", 2, 2.0), ("ssl_division_b", 6, 0.7))
MIN_WITH_FILM, MAX_FILM_MB = 3.0, 2.0


def median_times_s(
    eyes: dict[str, MatchCamera], world: World, half_m: FloatArray, ball_half_m: FloatArray, rng: Generator, count: int
) -> dict[str, float]:
    """Return the median time of a frame by each eye, and of its "cvtColor", all robots and the ball anywhere."""
    seconds: dict[str, list[float]] = {name: [] for name in (*eyes, "cvtColor")}
    for i in range(count + 5):
        for robot in range(len(world.state.robots)):
            x, y = rng.uniform(-half_m, half_m).tolist()
            world.place(robot, Pose2(x, y, rng.uniform(-3.1, 3.1)))
        world.place_ball(*rng.uniform(-ball_half_m, ball_half_m).tolist())
        for name, eye in eyes.items():
            frame, drawn_s = timed(partial(eye.render, world.state, 0))
            if i >= 5:  # compiled code is loaded before
                seconds[name].append(drawn_s)
                seconds["cvtColor"].append(unit_s(frame, 1))
    return {name: float(np.median(taken)) for name, taken in seconds.items()}


def measure_rendering(count: int, seed: int) -> None:
    """Print the ratios of drawing a frame."""
    rng = np.random.default_rng(seed)
    world = World(FIELD, 2, RobotLimits(), rng)
    eyes = {
        "before noise": MatchCamera(FIELD, CAMERA, RobotLimits(), rng, sensor=replace(MATCH_SENSOR, noise_sigma=0.0)),
        "with noise": MatchCamera(FIELD, CAMERA, RobotLimits(), rng),
    }
    times_s = median_times_s(eyes, world, np.array([1.2, 0.65]), np.array([1.3, 0.7]), rng, count)
    table = Table(
        "one frame    | ms | ratio: time ratio | target | verdict", f"Rendering, {count} frames", name="frames"
    )
    for name, most in zip(eyes, (MAX_BARE, MAX_NOISY), strict=True):
        _ratio_row(table, name, times_s[name], times_s["cvtColor"], most)
    table.row("cvtColor", f"{1e3 * times_s['cvtColor']:.3f}", "1", None, None)


def _ratio_row(table: Table, name: str, drawn_s: float, hsv_s: float, most: float) -> None:
    ratio = drawn_s / hsv_s
    table.row(name, f"{1e3 * drawn_s:.3f}", f"{ratio:.2f}", f"{most:g}", verdict(ratio <= most))


def measure_forward(count: int, seed: int) -> None:
    """Print the ratios of drawing a forward camera's frame."""
    columns = "forward camera           | ms | ratio: time ratio | target | verdict"
    table = Table(columns, f"Rendering, {count} frames of a forward camera", name="forward frames")
    for field_name, most in MAX_FORWARD.items():
        field = load_field(field_name)
        camera = camera_for(field)
        if field_name == "spl_2020":
            camera = nao_camera().with_orientation(0.0, math.radians(-14.0), 0.0)
        rng = np.random.default_rng(seed)
        half = np.array([field.length_m, field.width_m]) / 2 - 0.2
        world = World(field, 4, RobotLimits(), rng)
        eyes = {"drawn": MatchCamera(field, camera, RobotLimits(), rng)}
        times_s = median_times_s(eyes, world, half, half, rng, count)
        width, height = camera.size_px
        _ratio_row(table, f"{field_name}, {width} x {height}", times_s["drawn"], times_s["cvtColor"], most)


def measure_match(simulated_s: float, seed: int) -> None:
    """Print how much faster than real time a match runs, and its stages."""
    arena = Arena(FIELD, 2, seed, camera=CAMERA)
    players = [BuiltInPlayer(arena.setup(index)) for index in range(4)]
    stages: dict[str, float] = {}
    began = perf_counter()
    for period in range(round((simulated_s + 1.0) / CONTROL_PERIOD_S)):
        if period * CONTROL_PERIOD_S >= 1.0 and not stages:
            stages = {"pictures and senses": 0.0, "players": 0.0, "physics": 0.0}
            began = perf_counter()
        begin = process_time()
        senses = arena.senses()
        sensed = process_time()
        commands = {index: player.act(own) for index, (player, own) in enumerate(zip(players, senses, strict=True))}
        decided = process_time()
        arena.step(commands)
        end = process_time()
        for name, spent in zip(stages, (sensed - begin, decided - sensed, end - decided), strict=False):
            stages[name] += spent
    total = sum(stages.values())
    wall = perf_counter() - began
    title = f"4 robots, {simulated_s:g} s of play in {total:.2f} s of one core ({wall:.2f} s on the wall clock)"
    table = Table("stage                 | ms a period | of all %", title, name="stages")
    for name, spent in stages.items():
        table.row(name, 1e3 * spent / simulated_s * CONTROL_PERIOD_S, f"{100 * spent / total:.0f}")
    ok = simulated_s / total >= MIN_REAL_TIME
    table = Table("match                 | times real time | target | verdict", name="real time")
    table.row("4 robots", f"{simulated_s / total:.2f}", f">= {MIN_REAL_TIME:g}", verdict(ok))


def measure_forward_matches(simulated_s: float, seed: int) -> None:
    """Print how much faster than real time matches with forward cameras run."""
    columns = "forward cameras                   | times real time | target | verdict"
    table = Table(columns, f"{simulated_s:g} s of play", name="real time, forward")
    for field_name, players, least in FORWARD_MATCHES:
        match = MatchPlan(field_name, players=players, seconds=simulated_s + 1.0, seed=seed).begin()
        for _ in match.play(min(1.0, simulated_s)):
            pass
        began = process_time()
        for _ in match.play(simulated_s):
            pass
        real_time = simulated_s / (process_time() - began)
        ok = real_time >= least
        table.row(f"{field_name}, {2 * players} robots", f"{real_time:.2f}", f">= {least:g}", verdict(ok))


def measure_film(simulated_s: float, seed: int) -> None:
    """Print how fast a match with film and report is played, and the film's size."""
    plan = MatchPlan(seconds=simulated_s, seed=seed)

    def play() -> tuple[float, float]:
        wall, processor = perf_counter(), process_time()
        for _ in plan.begin().play(simulated_s):
            pass
        return perf_counter() - wall, process_time() - processor

    with tempfile.TemporaryDirectory() as out:
        run_match(replace(plan, seconds=0.5), Path(out) / "warm")
        before = play()
        wall, processor = perf_counter(), process_time()
        summary = run_match(plan, Path(out) / "match")
        with_film = perf_counter() - wall, process_time() - processor
        after = play()
        megabytes = 0.0 if summary.video is None else summary.video.stat().st_size / 1e6
    alone = [sum(both) / 2 for both in zip(before, after, strict=True)]
    table = Table(
        "match                 | times real time | target | processor s/s | film MB/min | at most | verdict",
        f"4 robots, {simulated_s:g} s of play",
        name="with film",
    )
    table.row("play alone", f"{simulated_s / alone[0]:.2f}", None, f"{alone[1] / simulated_s:.2f}", None, None, None)
    size = 60 * megabytes / simulated_s
    ok = simulated_s / with_film[0] >= MIN_WITH_FILM and 0 < size <= MAX_FILM_MB
    table.row(
        "with film and report",
        f"{simulated_s / with_film[0]:.2f}",
        f">= {MIN_WITH_FILM:g}",
        f"{with_film[1] / simulated_s:.2f}",
        f"{size:.2f}",
        f"{MAX_FILM_MB:g}",
        verdict(ok),
    )


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    frames, simulated_s = (60, 2.0) if arguments.quick else (3000, 180.0) if arguments.full else (1000, 60.0)
    measure_rendering(frames, arguments.seed)
    measure_forward(frames, arguments.seed)
    measure_match(simulated_s, arguments.seed)
    measure_forward_matches(0.3 if arguments.quick else 30.0, arguments.seed)
    measure_film(1.0 if arguments.quick else 120.0 if arguments.full else 30.0, arguments.seed)
