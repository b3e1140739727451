"""Tracking of other robots through camera images: track splitting and a tuned nearest neighbour.

The whole chain: a robot drives among four others on ssl_2001; rendered images of its mirror camera, poses and obstacles
of `Vision`, the pose filter. CLEAR MOT as in tracking.py, of the others within 1.3 m, hidden or not. The nearest
neighbour's settings are those of tracking.py. "Detections": how far the middles of the obstacles, with half a robot
added, lie from the nearest robot; 0.15 m and more is of no robot.
"""

from __future__ import annotations

from argparse import Namespace
from functools import partial

import numpy as np

from benchmarks.harness import Pool, Table, percent, program
from benchmarks.scores.tracker_runs import (
    COLUMNS,
    NEAR_M,
    TUNED,
    nearest_neighbours,
    score,
    track_splitting,
    tracker_row,
)
from benchmarks.worlds.crowd import Frame, camera_film
from field_models import load_field
from robocup_vision.arrays import FloatArray

FIELD = load_field("ssl_2001")


def errors_m(frame: Frame) -> FloatArray:
    """Distance of each detection from the nearest robot, both seen from where the robot is."""
    places = frame.truth.transform(np.array([[d.x_m, d.y_m] for d in frame.detections]).reshape(-1, 2))
    away = np.linalg.norm(places[:, None] - frame.places_m, axis=-1)
    return np.asarray(away.min(axis=1))


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    runs = 1 if arguments.quick else 60 if arguments.full else 12
    films = list(pool.map(partial(camera_film, FIELD), [[arguments.seed, k, 4] for k in range(runs)]))
    seconds = round(sum(frames[-1].t_s - frames[0].t_s for frames in films))
    table = Table(
        ("tracker        ", COLUMNS),
        name="trackers",
        # of two frames one after the other the second adds little
        samples=seconds,
    )
    ours = score(track_splitting, films, True)
    tuned = score(partial(nearest_neighbours, settings=TUNED), films, True)
    assert ours is not None
    assert tuned is not None
    tracker_row(table, "track splitting", runs, ours, ours.mota >= tuned.mota)
    tracker_row(table, "GNN, tuned", runs, tuned)
    columns = "detections | median mm: error | 90 % within mm: error | of no robot %: loss"
    table = Table(columns, name="detections", samples=seconds)
    away = np.concatenate([errors_m(frame) for frames in films for frame in frames])
    of_robots = away[away < NEAR_M]
    median, most = (1e3 * np.quantile(of_robots, (0.5, 0.9))).tolist()
    table.row("of robots", median, most, percent(1.0 - len(of_robots) / len(away)))
