"""How fast, among known opponents and among hidden ones: the planned speed, and constant ones.

Known surroundings (Miura 2004, section 6.2): gaps of 2 to 3.5 robot widths, 1.2 to 1.8 m ahead. The robot knows where
its opponents are up to 12 mm, and where it is by a look every 0.8 s (a landmark now and then: 20 mm from look to look,
18 mm in all looks alike) and by odometry that slips in between. The planner gets estimates only; the robot moves in
truth. Where it finds no safe speed for 4 s it goes another way: such a drive counts as refused, with its time so far
and that of the constant speed for the whole course.

Unknown surroundings (section 6.3): 5.2 m through opponents with others hidden behind them; looks every 0.2 s, 2.5 m
far, that miss an opponent one time in ten when near and six in ten when far; a cell is decided at 49 to 1. All rules
stop before what they know, and plan their way round it, by tracked places that are 10 mm off; the robot knows its own.
"""

from __future__ import annotations

import math
from argparse import Namespace

import numpy as np

from benchmarks.harness import Pool, Table, percent, program, verdict
from benchmarks.worlds import hidden_opponents
from benchmarks.worlds.uncertain_robot import (
    BIAS_STD,
    DISC_STD_M,
    LOOK_STD,
    RADIUS_M,
    SlalomDrive,
    draw_slalom,
    drive_slalom,
)

CONSTANT_MPS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0, 1.5)


def drives(widths: tuple[float, float], gaps: int, constant: float | None, runs: int, seed: int) -> list[SlalomDrive]:
    """Drive courses with gaps of so many robot widths; the same courses and errors at each speed."""
    out = []
    for k in range(runs):
        rng = np.random.default_rng([seed, 6, gaps, round(10 * widths[0]), k])
        out.append(drive_slalom(draw_slalom(rng.uniform(*widths, gaps) * 2 * RADIUS_M, rng), constant, rng))
    return out


def measure_known(runs: int, seed: int) -> None:
    """Print the tables of known surroundings."""
    fastest = CONSTANT_MPS[0]
    for gaps, title in ((1, "known surroundings: one gap of 2 to 3.5 robot widths"), (3, "three such gaps in a row")):
        columns = "speed            | drives | collided: count | refused | seconds | ratio: error | verdict"
        table = Table(columns, title, name=f"known, {gaps} gaps", samples=runs)
        ours = drives((2.0, 3.5), gaps, None, runs, seed)
        struck, refused = sum(d.collided for d in ours), sum(d.refused for d in ours)
        rows = [(v, drives((2.0, 3.5), gaps, v, runs, seed)) for v in CONSTANT_MPS]
        quick_s = math.inf
        for speed, found in rows:
            seconds = float(np.mean([d.seconds for d in found]))
            if sum(d.collided for d in found) <= struck and seconds < quick_s:
                fastest, quick_s = speed, seconds
            table.row(
                f"constant {speed:g} m/s", str(runs), str(sum(d.collided for d in found)), "0", seconds, None, None
            )
        own_s = with_refusals_s(ours, quick_s)
        ok = own_s <= 0.75 * quick_s
        # the issue asks it of gaps, not of courses in which nothing is open floor
        table.row(
            "as planned",
            str(runs),
            str(struck),
            str(refused),
            own_s,
            own_s / quick_s,
            verdict(ok) if gaps == 1 else None,
        )
        table.note(
            f"ratio: to the time of the fastest constant speed with no more collisions, {fastest:g} m/s; at most 0.75"
        )
        if gaps == 1:
            measure_widths(fastest, runs // 3, seed)


def with_refusals_s(found: list[SlalomDrive], instead_s: float) -> float:
    """Mean seconds; a drive that is refused takes the time of another way besides."""
    return float(np.mean([d.seconds + (instead_s if d.refused else 0.0) for d in found]))


def measure_widths(constant: float, runs: int, seed: int) -> None:
    """Print the table of single gaps by their width."""
    table = Table(
        (
            "robot widths | drives | collided: count | stopped | refused | seconds: error | constant collided | "
            "its s | verdict"
        ),
        f"one gap by its width, as planned, and constant {constant:g} m/s; stopped: no safe speed",
        name="widths",
        samples=runs,
    )
    for low, high in ((1.2, 1.6), (1.6, 1.8), (1.8, 2.0), (2.0, 2.5), (2.5, 3.0), (3.0, 3.5)):
        mine, others = (drives((low, high), 1, speed, runs, seed) for speed in (None, constant))
        struck, refused, stopped = (
            sum(getattr(d, name) for d in mine) for name in ("collided", "refused", "stopped")
        )  # fmt: skip
        other_struck, other_s = sum(d.collided for d in others), float(np.mean([d.seconds for d in others]))
        own_s = with_refusals_s(mine, other_s)
        # too narrow for a single look: it stops, and goes on only if more looks show that it may
        ok = stopped >= 0.95 * runs and struck == 0 if high <= 2.0 else None
        table.row(
            f"{low:g} to {high:g}", str(runs), str(struck), str(stopped), str(refused), own_s, str(other_struck),
            other_s, None if ok is None else verdict(ok),
        )  # fmt: skip
    limits = ", ".join(f"{filled_widths(looks):.2f} after {looks:g}" for looks in (1, 2, 5, math.inf))
    table.note(f"3 standard deviations fill a gap of so many widths after so many looks: {limits}")


def filled_widths(looks: float) -> float:
    """Width of the gap, in robots, that the robot and three standard deviations to either side fill."""
    sigma = math.sqrt(LOOK_STD[1] ** 2 / looks + BIAS_STD[1] ** 2 + DISC_STD_M**2)
    return 1 + 2 * 3 * sigma / (2 * RADIUS_M)


RULES = (
    ("constant 0.4 m/s", "constant", 0.4),
    ("constant 1.5 m/s", "constant", 1.5),
    ("stop before undecided", "stop", None),
    ("as planned", "planned", None),
)


def one_hidden(job: tuple[tuple[int, int], str, float | None]) -> tuple[float, bool, bool]:
    """One run among hidden opponents: seconds, whether it collided, whether it arrived."""
    found = hidden_opponents.run(*job)
    return found.seconds, found.collided, found.arrived


def measure_unknown(runs: int, others: int, seed: int, pool: Pool) -> None:
    """Print the table of unknown surroundings."""
    table = Table(
        ("rule                    | runs | collided %: loss | arrived %: rate | seconds | ratio: error | verdict"),
        f"unknown surroundings: opponents behind opponents; seconds of the first {others} runs",
        name="hidden",
        samples=others,
    )
    slow_s = math.nan
    for name, rule, constant in RULES:
        count = runs if rule == "planned" else others
        jobs = [((seed, k), rule, constant) for k in range(count)]
        found = np.array(list(pool.map(one_hidden, jobs, chunksize=10)), dtype=np.float64)
        # a run that does not arrive counts with its 40 s
        seconds, collided = float(found[:others, 0].mean()), float(found[:, 1].mean())
        slow_s = seconds if constant == 0.4 else slow_s
        ok = collided <= 0.01 and seconds <= 0.6 * slow_s
        table.row(
            name, str(count), percent(collided), percent(float(found[:, 2].mean())), seconds, seconds / slow_s,
            verdict(ok) if rule == "planned" else None,
        )  # fmt: skip
    table.note("planned: collisions at most 1 %, time at most 0.6 of constant 0.4 m/s")


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    runs = 9 if arguments.quick else 1500 if arguments.full else 300
    hidden, others = (6, 3) if arguments.quick else (1500, 150)
    measure_unknown(hidden, others, arguments.seed, pool)
    measure_known(runs, arguments.seed)
