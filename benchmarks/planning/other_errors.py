"""Planned speeds and gaps where errors are not distributed as the planner assumes.

The worlds of speed.py and gaps.py draw what the planner reckons with. Here they draw four laws from one seed:
"matched", that of the planner; "frames", the errors of a robot's own pose and of the places of others in rendered
images, as Student's t distributions that this program fits, in the standard deviations that were stated; "x 1.5",
normal errors of 1.5 times the stated scale, and 1.5 times as many opponents missed; and "tails", those of "frames" at
the stated scale. The images are those of camera_tracking.py: a mirror camera among four robots, `Vision`, the pose
filter.

"gap": one gap of 2 to 3.5 robot widths, as planned, and at the constant speed that speed.py finds to be the fastest
without a touch. "hidden": opponents behind opponents, as planned and at 0.4 m/s. "row": two or three gaps and a way
round, by expected time and by the shortest way, where these differ.
"""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.harness import Pool, Table, percent, program, verdict
from benchmarks.scores.tracker_runs import NEAR_M
from benchmarks.worlds import gap_choices, hidden_opponents
from benchmarks.worlds.crowd import Frame, camera_film
from benchmarks.worlds.uncertain_robot import MATCHED, RADIUS_M, ErrorLaw, Errors, draw_slalom, drive_slalom
from field_models import load_field
from robocup_vision.arrays import FloatArray

FIELD = load_field("ssl_2001")
OTHER_SCALE, CONSTANT_MPS, SLOW_MPS, ASIDE_M = 1.5, 0.6, 0.4, 2.5
MAX_COLLIDED, MAX_RATIO, MAX_HIDDEN_RATIO = 0.02, 0.75, 0.6

# "tails" is no robot's: it shows what tails do
JUDGED = ("matched", "frames", "x 1.5")

Job = tuple[int, int, Errors]


def pose_errors(frame: Frame) -> list[float]:
    """Errors of the robot's x, y and heading, in stated standard deviations."""
    off = np.array([frame.robot.x_m - frame.truth.x_m, frame.robot.y_m - frame.truth.y_m, 0.0])
    off[2] = frame.truth.inverse().compose(frame.robot).theta_rad
    return (off / np.sqrt(np.diag(frame.robot_covariance))).tolist()  # type: ignore[no-any-return]


def obstacle_errors(frame: Frame) -> list[float]:
    """Errors of the detections along and across the line of sight, in stated standard deviations."""
    others = frame.truth.inverse().transform(frame.places_m)
    out: list[float] = []
    for one in frame.detections:
        off = np.array([one.x_m, one.y_m]) - others
        nearest = off[np.argmin(np.hypot(*off.T))]
        if np.hypot(*nearest) < NEAR_M:
            ahead = np.array([one.x_m, one.y_m]) / np.hypot(one.x_m, one.y_m)
            axes = ahead, np.array([-ahead[1], ahead[0]])
            out += [float(nearest @ axis / np.sqrt(axis @ one.covariance @ axis)) for axis in axes]
    return out


def gap(job: Job) -> tuple[float, ...]:
    """Drive through one gap: touched and seconds as planned, and at the constant speed.

    A refusal takes the other's time besides.
    """
    seed, number, errors = job
    found = []
    for constant in (None, CONSTANT_MPS):
        rng = np.random.default_rng([seed, 8, number])
        course = draw_slalom(rng.uniform(2.0, 3.5, 1) * 2 * RADIUS_M, rng, errors)
        found.append(drive_slalom(course, constant, rng, errors))
    planned, other = found
    return planned.collided, planned.seconds + other.seconds * planned.refused, other.collided, other.seconds


def hidden(job: Job) -> tuple[float, ...]:
    """Drive among opponents behind opponents: touched and seconds as planned, and the same at the slow speed."""
    seed, number, errors = job
    planned = hidden_opponents.run((seed, number), "planned", None, errors)
    other = hidden_opponents.run((seed, number), "constant", SLOW_MPS, errors)
    return planned.collided, planned.seconds, other.collided, other.seconds


def row(job: Job) -> tuple[float, ...]:
    """Drive a row of gaps where the rules differ: touched in any drive, seconds by expected time and the shortest."""
    seed, number, errors = job
    of_row = gap_choices.RowJob(seed, number, ASIDE_M, "shortest way", (gap_choices.JUDGED,), 2, errors)
    found = gap_choices.row_seconds(of_row)
    if found is None:
        return ()
    shortest_s, ours_s, _, touched = found.tolist()
    return touched, ours_s, touched, shortest_s


def fit_laws(films: list[list[Frame]]) -> Errors:
    """Print the laws of the errors in frames, and return them."""
    columns = "law of frames | errors | degrees of freedom | scale | 99 % within | of a normal one"
    table = Table(columns, name="laws")
    laws = []
    frames = [frame for film in films for frame in film]
    for name, errors_of in (("own pose", pose_errors), ("places of others", obstacle_errors)):
        errors: FloatArray = np.array([error for frame in frames for error in errors_of(frame)])
        law = ErrorLaw.fitted(errors)
        table.row(name, len(errors), law.degrees, law.scale, float(np.quantile(np.abs(errors), 0.99)), 2.58)
        laws.append(law)
    pose, obstacle = laws
    return Errors(pose, obstacle)


def measure(laws: dict[str, Errors], runs: dict[str, int], seed: int, pool: Pool) -> None:
    """Print the table."""
    table = Table(
        (
            "world  | errors: label | runs | touched %: loss | seconds | other touched % | its s | "
            "ratio: error | verdict"
        ),
        f"other: constant {CONSTANT_MPS:g} m/s; {SLOW_MPS:g} m/s; shortest way",
        name="errors",
        samples=min(runs.values()),
    )
    for world, play, most in (("gap", gap, MAX_RATIO), ("hidden", hidden, MAX_HIDDEN_RATIO), ("row", row, 1.0)):
        for name, errors in laws.items():
            jobs = [(seed, number, errors) for number in range(runs[world])]
            found = np.array([one for one in pool.map(play, jobs) if one], dtype=np.float64)
            touched, ours_s, other_touched, other_s = found.mean(axis=0).tolist()
            ok = touched <= MAX_COLLIDED and ours_s <= most * other_s
            cells = percent(touched), ours_s, percent(other_touched), other_s, ours_s / other_s
            table.row(world, name, len(found), *cells, verdict(ok) if name in JUDGED else None)
    table.note(f"touched at most {percent(MAX_COLLIDED)} %, ratio at most {MAX_RATIO:g}, {MAX_HIDDEN_RATIO:g} and 1")


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    films, count = (1, 1) if arguments.quick else (12, 300) if arguments.full else (2, 24)
    runs = {"gap": count, "hidden": count, "row": count}
    frames = fit_laws(list(pool.map(partial(camera_film, FIELD), [[arguments.seed, k, 4] for k in range(films)])))
    tails = Errors(replace(frames.pose, scale=1.0), replace(frames.obstacle, scale=1.0))
    wider = ErrorLaw(scale=OTHER_SCALE)
    laws = {"matched": MATCHED, "frames": frames, "x 1.5": Errors(wider, wider, OTHER_SCALE), "tails": tails}
    measure(laws, runs, arguments.seed, pool)
