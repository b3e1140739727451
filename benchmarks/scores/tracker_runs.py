"""Trackers run over films of detections, and scored: ours, a tuned nearest neighbour, and stonesoup's."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.harness import Table, verdict
from benchmarks.peers.tracking_peers import NearestNeighbours, Reports, StoneSoup
from benchmarks.scores.tracking_score import Score
from benchmarks.worlds.crowd import Frame
from robocup_vision.tracking import MovingObjects
from robocup_vision.tracking.detections import in_field

PERIOD_S = 1 / 15
# of a table of trackers, behind their names
COLUMNS = (
    "runs: label | MOTA: score | missed %: loss | false %: loss | switches: count | false tracks: count | "
    "RMS mm: error | verdict"
)
# chosen on seeds that this program does not use
TUNED = {
    "hits": 3,
    "window": 3,
    "patience": 6,
    "gate": 9.2,
    "tentative_patience": 1,
    "acceleration_mps2": 2.0,
    "speed_mps": 1.0,
}

Tracker = Callable[[Sequence[Frame]], list[Reports] | None]


def track_splitting(frames: Sequence[Frame]) -> list[Reports]:
    """Ours."""
    tracker = MovingObjects()
    out = []
    for frame in frames:
        tracks = tracker.update(frame.t_s, frame.detections, frame.robot, frame.robot_covariance)
        out.append([(t.number, np.array([t.x_m, t.y_m])) for t in tracks])
    return out


def nearest_neighbours(frames: Sequence[Frame], settings: dict[str, float]) -> list[Reports]:
    """Track with the global nearest neighbour."""
    tracker = NearestNeighbours(**settings)  # type: ignore[arg-type]
    return [tracker.update(PERIOD_S, *in_field(f.detections, f.robot, f.robot_covariance)) for f in frames]


def stone_soup(frames: Sequence[Frame], joint: bool) -> list[Reports] | None:
    """Track with stonesoup, with the patience that suits each best on other seeds."""
    peer = StoneSoup(joint, patience=6 if joint else 5)
    return peer.reports(PERIOD_S, [in_field(f.detections, f.robot, f.robot_covariance) for f in frames])


def tracker_row(table: Table, name: str, runs: int, of: Score | None, ok: bool | None = None) -> None:
    """Print a tracker under `COLUMNS`."""
    if of is None:
        table.row(name, runs, "not installed", *(None,) * 6)
        return
    missed, false = (f"{100 * count / of.objects:.1f}" for count in (of.missed, of.false))
    judged = None if ok is None else verdict(ok)
    table.row(
        name, runs, f"{of.mota:.3f}", missed, false, of.switches, of.false_tracks, f"{1e3 * of.rms_m:.0f}", judged
    )


def score(tracker: Tracker, films: Sequence[Sequence[Frame]], in_view_only: bool = False) -> Score | None:
    """Sum up all runs, of all objects or of those marked in view; None if the tracker is not installed."""
    total = Score()
    for frames in films:
        reports = tracker(frames)
        if reports is None:
            return None
        for frame, reported in zip(frames, reports, strict=True):
            total.frame(frame.places_m, reported, frame.in_view if in_view_only else None)
        total.end_run()
    return total
