"""Tournaments: the same results on any workers, and no match lost with a worker that is killed."""

import functools
import json
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import replace
from pathlib import Path

import pytest
from sim2d_players import SMALL_CAMERA, FailsAt, KillsItsProcess, Reckoner, Sleeper

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision import cli
from sim2d.match import tournament
from sim2d.match.run import MatchPlan
from sim2d.match.tournament import (
    Workers,
    dask_workers,
    local_workers,
    plan_matches,
    play_matches,
    play_plan,
    tournament_json,
)

PLAN = MatchPlan(players=1, seconds=0.4, seed=5, ours=Reckoner, theirs=Sleeper, camera=SMALL_CAMERA)


class Here(Executor):
    """Plays at once, in this process; loses what `loses` names."""

    def __init__(self, loses=(), breaks_at=None):
        self.loses, self.breaks_at, self.submitted = list(loses), breaks_at, 0

    def submit(self, play, plan):  # noqa: D102
        if self.submitted == self.breaks_at:
            self.breaks_at = None
            raise BrokenExecutor
        self.submitted += 1
        future = Future()
        if plan.seed in self.loses:
            self.loses.remove(plan.seed)
            future.set_exception(BrokenExecutor())
            return future
        try:
            future.set_result(play(plan))
        except RobocupVisionError as error:
            future.set_exception(error)
        return future


def results_of(plans, workers):
    results = dict(play_matches(plans, workers))
    return [results[index] for index in range(len(plans))]


def but_for_names(results):
    """Leave out who played: players that kill their process play like another one under a name of their own."""
    return [{key: value for key, value in result.items() if key not in ("ours", "theirs")} for result in results]


def test_seeds_count_on():
    plans = plan_matches(PLAN, 3)
    assert [plan.seed for plan in plans] == [5, 6, 7]
    results = results_of(plans, Workers(lambda: Here()))
    assert [result["seed"] for result in results] == [5, 6, 7]
    assert results[1] == play_plan(plans[1])
    assert results[0]["robots"] != results[1]["robots"]


def test_lost_matches_are_played_again():
    plans = plan_matches(PLAN, 4)
    expected = results_of(plans, Workers(lambda: Here()))
    here = Here(loses=[6, 6, 8])
    assert results_of(plans, Workers(lambda: here)) == expected
    here = Here(breaks_at=2)
    assert results_of(plans, Workers(lambda: here)) == expected


def test_workers_that_always_end_are_an_error():
    workers = Workers(lambda: Here(loses=[5, 6, 7]))
    with pytest.raises(RobocupVisionError, match="3 matches were not played: their workers end before they do"):
        results_of(plan_matches(PLAN, 3), workers)


def test_what_cannot_be_played_is_reported():
    with pytest.raises(RobocupVisionError, match="nowhere"):
        results_of([MatchPlan(field="nowhere")], Workers(lambda: Here()))


def test_totals_are_over_all_matches():
    plans = plan_matches(replace(PLAN, seconds=0.6, theirs=FailsAt), 2)
    results = results_of(plans, Workers(lambda: Here()))
    results[0]["score"], results[1]["score"] = [2, 1], [0, 0]
    values = tournament_json(plans[0], results)
    totals = values["totals"]
    assert (totals["matches"], totals["goals"], totals["stopped_players"]) == (2, [2, 1], 2)
    assert (totals["won"], totals["drawn"], totals["lost"]) == (1, 1, 0)
    assert totals["within_5cm_3deg"] == 0.5
    assert totals["longest_lost_s"] == 0.6
    assert values["matches"] == results


@pytest.mark.slow
def test_local_processes_lose_no_match_and_change_no_result(tmp_path):
    expected = [play_plan(one) for one in plan_matches(PLAN, 5)]
    killing = replace(PLAN, theirs=functools.partial(KillsItsProcess, marker=tmp_path / "killed"))
    assert but_for_names(results_of(plan_matches(killing, 5), local_workers(2))) == but_for_names(expected)
    assert (tmp_path / "killed").exists()


@pytest.mark.slow
def test_a_cluster_loses_no_match_and_changes_no_result(tmp_path):
    distributed = pytest.importorskip("distributed")
    expected = [play_plan(one) for one in plan_matches(PLAN, 5)]
    killing = replace(PLAN, theirs=functools.partial(KillsItsProcess, marker=tmp_path / "killed"))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50, local_directory=tmp_path
    ) as cluster:
        workers = dask_workers(cluster.scheduler_address)
        assert but_for_names(results_of(plan_matches(killing, 5), workers)) == but_for_names(expected)
    assert (tmp_path / "killed").exists()


def test_no_cluster_and_no_dask_are_one_line(monkeypatch):
    monkeypatch.setattr(tournament, "_CONNECT_S", 0.5)
    pytest.importorskip("distributed")
    with pytest.raises(ArgumentError, match=r"no dask scheduler answers at 'tcp://127\.0\.0\.1:9'"):
        results_of([PLAN], dask_workers("tcp://127.0.0.1:9"))
    with pytest.raises(ArgumentError, match=r"no dask scheduler answers at 'what://is'"):
        results_of([PLAN], dask_workers("what://is"))
    monkeypatch.setattr(tournament, "find_spec", lambda name: None)
    with pytest.raises(ArgumentError, match=r"dask\.distributed is not installed"):
        dask_workers("tcp://127.0.0.1:9")


def test_stopping_early_leaves_no_work_behind():
    closed = []

    class Watched(Here):
        def shutdown(self, wait=True, *, cancel_futures=False):
            closed.append(cancel_futures)

    playing = play_matches(plan_matches(PLAN, 2), Workers(lambda: Watched()))
    next(playing)
    playing.close()
    assert closed[0] is True


@pytest.mark.slow
def test_command_writes_the_same_file_for_any_workers(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tournament, "local_workers", lambda jobs: Workers(lambda: Here()))
    cluster = Here(loses=[3])
    monkeypatch.setattr(tournament, "dask_workers", lambda address: Workers(lambda: cluster))
    command = ["tournament", "--matches", "2", "--players", "1", "--seconds", "0.2", "--seed", "2"]
    for out, where in (("one", ["--jobs", "2"]), ("two", ["--dask", "tcp://host:8786"])):
        assert cli.main([*command, *where, "--out", out]) == 0
    files = [Path(out, "tournament.json").read_bytes() for out in ("one", "two")]
    assert files[0] == files[1]
    assert [match["seed"] for match in json.loads(files[0])["matches"]] == [2, 3]
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "ssl_2001, 1 against 1, 2 matches of 0.2 s"
    assert lines[2] == "won, drawn, lost by the side that attacks +x: 0, 2, 0"


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["--matches", "0"], "matches must be at least 1, got 0"),
        (["--jobs", "0"], "jobs must be at least 1, got 0"),
        (["--players", "0"], "players_per_side must be at least 1, got 0"),
    ],
)
def test_mistakes_are_one_line(capsys, arguments, problem):
    assert cli.main(["tournament", *arguments]) == 2
    assert capsys.readouterr().err == f"robocup-vision tournament: {problem}\n"
