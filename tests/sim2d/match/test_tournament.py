"""Tournaments: the same results on any workers, and no match lost with a worker that is killed."""

import functools
import json
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from sim2d_players import SMALL_CAMERA, FailsAt, KillsItsProcess, Reckoner, Sleeper

from field_models.errors import RobocupVisionError
from robocup_vision import cli, workers
from robocup_vision.workers import Pool, Workers, local_workers
from robocup_vision.workers.processes import Doer
from sim2d.match.run import MatchPlan
from sim2d.match.tournament import plan_matches, play_matches, play_plan, tournament_json

PLAN = MatchPlan(players=1, seconds=0.4, seed=5, ours=Reckoner, theirs=Sleeper, camera=SMALL_CAMERA)


def here(loses=()):
    """Return workers that play at once, in this process; they lose the matches of some seeds."""
    lost = list(loses)

    class Here(Executor):
        def submit(self, play, plans):
            future = Future()
            if plans[0].seed in lost:
                lost.remove(plans[0].seed)
                future.set_exception(BrokenExecutor())
                return future
            try:
                future.set_result(play(plans))
            except RobocupVisionError as error:
                future.set_exception(error)
            return future

    @contextmanager
    def open_pool(start):
        yield Pool(Here(), Doer(start), lambda: 2)

    return Workers(open_pool)


def results_of(plans, players):
    results = dict(play_matches(plans, players))
    return [results[index] for index in range(len(plans))]


def but_for_names(results):
    """Leave out who played: players that kill their process play like another one under a name of their own."""
    return [{key: value for key, value in result.items() if key not in ("ours", "theirs")} for result in results]


def test_seeds_count_on():
    plans = plan_matches(PLAN, 3)
    assert [plan.seed for plan in plans] == [5, 6, 7]
    results = results_of(plans, here())
    assert [result["seed"] for result in results] == [5, 6, 7]
    assert results[1] == play_plan(plans[1])
    assert results[0]["robots"] != results[1]["robots"]


def test_lost_matches_are_played_again():
    plans = plan_matches(PLAN, 4)
    expected = results_of(plans, here())
    assert results_of(plans, here(loses=[6, 6, 8])) == expected


def test_workers_that_always_end_are_an_error():
    with pytest.raises(RobocupVisionError, match="the match of seed 5 is not done: 3 times all workers ended before"):
        results_of(plan_matches(PLAN, 3), here(loses=3 * [5, 6, 7]))


def test_what_cannot_be_played_is_reported():
    with pytest.raises(RobocupVisionError, match="nowhere"):
        results_of([MatchPlan(field="nowhere")], here())


def test_totals_are_over_all_matches():
    plans = plan_matches(replace(PLAN, seconds=0.6, theirs=FailsAt), 2)
    results = results_of(plans, here())
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
    """Only this finds a match that is lost with its process."""
    expected = [play_plan(one) for one in plan_matches(PLAN, 5)]
    killing = replace(PLAN, theirs=functools.partial(KillsItsProcess, marker=tmp_path / "killed"))
    assert but_for_names(results_of(plan_matches(killing, 5), local_workers(2))) == but_for_names(expected)
    assert (tmp_path / "killed").exists()


@pytest.mark.slow
def test_command_writes_the_same_file_for_any_workers(tmp_path, capsys, monkeypatch):
    """Only this finds a tournament's file or table that depends on who played."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(workers, "local_workers", lambda jobs: here())
    monkeypatch.setattr(workers, "dask_workers", lambda address: here(loses=[3]))
    command = ["tournament", "--matches", "2", "--players", "1", "--seconds", "0.2", "--seed", "2"]
    for out, where in (("one", ["--jobs", "2"]), ("two", ["--dask", "tcp://host:8786"])):
        assert cli.main([*command, *where, "--out", out]) == 0
    files = [Path(out, "tournament.json").read_bytes() for out in ("one", "two")]
    assert files[0] == files[1]
    assert [match["seed"] for match in json.loads(files[0])["matches"]] == [2, 3]
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "ssl_2001, 1 against 1, 2 matches of 0.2 s"
    assert lines[2] == "won, drawn, lost by the side that attacks +x: 0, 2, 0"
