"""Many matches on the processes of this machine, or on a cluster: the same code over either's executor.

Match i of a tournament is the match of seed S + i, so results do not depend on the workers. A match that is lost with
its worker is played again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, as_completed
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any

import cv2
import numpy as np

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.workers import worker_processes
from sim2d.match.run import MatchPlan
from sim2d.players.catalog import player_name
from sim2d.report.match_file import match_json

# rounds in a row in which all workers may be lost before one finishes a match
_BARREN_ROUNDS = 3
_CONNECT_S = 10.0


@dataclass(frozen=True, slots=True)
class Workers:
    """Where matches are played.

    Parameters
    ----------
    open_executor : callable
        Returns a context manager of a `concurrent.futures.Executor`; called anew when workers were lost.
    losses : tuple of exception types
        What a match fails with when its worker was lost.
    """

    open_executor: Callable[[], AbstractContextManager[Executor]]
    losses: tuple[type[BaseException], ...] = (BrokenExecutor, CancelledError)


def local_workers(jobs: int) -> Workers:
    """Return so many processes of this machine.

    Raises
    ------
    ArgumentError
        If `jobs` is not positive.
    """
    if jobs < 1:
        raise ArgumentError(f"jobs must be at least 1, got {jobs}")
    return Workers(lambda: worker_processes(jobs))


def dask_workers(address: str) -> Workers:
    """Return the workers of a dask.distributed cluster (extra `distributed`).

    Parameters
    ----------
    address : str
        Of its scheduler, such as ``tcp://10.0.0.1:8786``. This package must be installed on its workers.

    Raises
    ------
    ArgumentError
        If dask.distributed is not installed.
    """
    if find_spec("distributed") is None:
        raise ArgumentError("dask.distributed is not installed (pip install 'robocup-vision[distributed]')")
    from distributed.scheduler import KilledWorker

    return Workers(lambda: _dask_executor(address), (BrokenExecutor, CancelledError, KilledWorker))


@contextmanager
def _dask_executor(address: str) -> Iterator[Executor]:
    from distributed import Client

    try:
        client: Any = Client(address, timeout=_CONNECT_S, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise ArgumentError(f"no dask scheduler answers at '{address}' ({error})") from None
    with client, client.get_executor(pure=False) as executor:
        yield executor


def plan_matches(plan: MatchPlan, matches: int) -> list[MatchPlan]:
    """Return the plans of a tournament: the given one, with its seed counted on.

    Raises
    ------
    ArgumentError
        If there are no matches.
    """
    if matches < 1:
        raise ArgumentError(f"matches must be at least 1, got {matches}")
    return [replace(plan, seed=plan.seed + index) for index in range(matches)]


def play_plan(plan: MatchPlan) -> dict[str, Any]:
    """Play a match, and return what stands in its match.json."""
    cv2.setNumThreads(0)
    match = plan.begin()
    for _ in match.play(plan.seconds):
        pass
    ours, theirs = player_name(plan.ours), player_name(plan.theirs)
    return match_json(match.arena.field.name, plan.players, plan.seed, match.figures, ours, theirs)


def play_matches(plans: Sequence[MatchPlan], workers: Workers) -> Iterator[tuple[int, dict[str, Any]]]:
    """Play matches, yielding the index of each and what stands in its match.json, in the order they end.

    Raises
    ------
    RobocupVisionError
        If a match cannot be played, or all workers are lost again and again.
    """
    missing = dict(enumerate(plans))
    barren = 0
    while missing:
        before = len(missing)
        with workers.open_executor() as executor:
            try:
                for index, result in _play_once(missing, executor, workers.losses):
                    del missing[index]
                    yield index, result
            except (GeneratorExit, KeyboardInterrupt):
                executor.shutdown(wait=False, cancel_futures=True)
                raise
        barren = barren + 1 if len(missing) == before else 0
        if barren == _BARREN_ROUNDS:
            raise RobocupVisionError(f"{len(missing)} matches were not played: their workers end before they do")


def _play_once(
    plans: dict[int, MatchPlan], executor: Executor, losses: tuple[type[BaseException], ...]
) -> Iterator[tuple[int, dict[str, Any]]]:
    futures = {}
    try:
        for index, plan in plans.items():
            futures[executor.submit(play_plan, plan)] = index
    except losses:
        pass
    for future in as_completed(futures):
        try:
            result = future.result()
        except losses:
            continue
        yield futures[future], result


def plan_json(plan: MatchPlan) -> dict[str, Any]:
    """Return as JSON values what the matches of a tournament depend on, besides their number."""
    return {
        "format": 1,
        "field": plan.field,
        "players": plan.players,
        "seconds": plan.seconds,
        "seed": plan.seed,
        "ours": player_name(plan.ours),
        "theirs": player_name(plan.theirs),
    }


def tournament_json(plan: MatchPlan, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return a tournament as JSON values: its totals, and what stands in the match.json of each match, in order."""
    robots = [robot for result in results for robot in result["robots"]]
    scores = np.array([result["score"] for result in results])
    halves = [robot["right_half_ratio"] for robot in robots if robot["right_half_ratio"] is not None]
    lead = np.sign(scores[:, 0] - scores[:, 1])
    return {
        "format": 1,
        "field": results[0]["field"],
        "players": plan.players,
        "ours": player_name(plan.ours),
        "theirs": player_name(plan.theirs),
        "seconds": results[0]["seconds"],
        "seed": plan.seed,
        "totals": {
            "matches": len(results),
            "goals": scores.sum(axis=0).tolist(),
            "won": int((lead > 0).sum()),
            "drawn": int((lead == 0).sum()),
            "lost": int((lead < 0).sum()),
            "within_5cm_3deg": round(float(np.mean([robot["within_5cm_3deg"] for robot in robots])), 6),
            "longest_lost_s": max(robot["longest_lost_s"] for robot in robots),
            "min_right_half_ratio": min(halves, default=None),
            "longest_stuck_s": max(robot["longest_stuck_s"] for robot in robots),
            "stopped_players": sum(robot["stopped_s"] is not None for robot in robots),
        },
        "matches": list(results),
    }
