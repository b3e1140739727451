"""`robocup-vision tournament`: its options and its handler."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from robocup_vision.commands.options import add_worker_options
from sim2d.commands.match_options import add_match_options, match_plan

if TYPE_CHECKING:
    from pathlib import Path

    from sim2d.match.run import MatchPlan

UNFINISHED_NAME = "unfinished.jsonl"
TABLE_PLAYERS = "plain,memory,planning"


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `tournament` to the subparsers of an argparse parser."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "tournament",
        help="play many simulated matches on many processes or machines",
        description="Play many simulated matches, the first with seed S, the next with S + 1 and so on, and write "
        "tournament.json. It does not depend on who plays them; a match lost with its worker is played again. With "
        "--table all named players meet each other, each pair twice on each seed with sides changed, and table.json "
        "holds their Elo ratings.",
    )
    add = parser.add_argument
    add(
        "--matches",
        type=int,
        default=10,
        metavar="M",
        help="number of matches; with --table that of each pair, an even number (default: 10)",
    )
    add(
        "--table",
        nargs="?",
        const=TABLE_PLAYERS,
        metavar="NAMES",
        help="rate players that all meet each other: names or MODULE:NAME with commas between "
        f"(without NAMES: {TABLE_PLAYERS})",
    )
    add_match_options(parser, "out/tournament")
    add_worker_options(parser)
    parser.add_argument("--resume", action="store_true", help="go on with an interrupted tournament in the same folder")
    parser.set_defaults(run=run_tournament)
    return parser


def run_tournament(args: argparse.Namespace) -> int:
    """Play the matches and print their totals, or the table of the players; return the exit status."""
    from functools import partial
    from pathlib import Path

    from sim2d.match.tournament import plan_json, plan_matches, tournament_json

    if args.table is not None:
        return _run_table(args)
    plan = match_plan(args)
    plans = plan_matches(plan, args.matches)
    path = Path(args.out) / "tournament.json"
    totals = _play(args, plans, plan_json(plan), path, partial(tournament_json, plan))["totals"]
    print(f"{args.field}, {plan.players} against {plan.players}, {totals['matches']} matches of {args.seconds:g} s")
    print(f"goals {totals['goals'][0]} : {totals['goals'][1]}")
    print(f"won, drawn, lost by the side that attacks +x: {totals['won']}, {totals['drawn']}, {totals['lost']}")
    print(f"frames within 5 cm / 3 deg: {100 * totals['within_5cm_3deg']:.1f} %")
    print(f"results: {path}")
    return 0


def _run_table(args: argparse.Namespace) -> int:
    from pathlib import Path

    from field_models.errors import ArgumentError
    from sim2d.match.tournament import RoundRobin
    from sim2d.players.catalog import player_factory

    if (args.ours, args.theirs) != ("plain", "plain"):
        raise ArgumentError("--table names all players: leave out --ours and --theirs")
    names = [name.strip() for name in args.table.split(",")]
    tournament = RoundRobin(match_plan(args), tuple((name, player_factory(name)) for name in names), args.matches)
    path = Path(args.out) / "table.json"
    players = tournament.plan.players
    values = _play(args, tournament.plans, tournament.run_json(), path, tournament.table_json)
    print(f"{args.field}, {players} against {players}, {args.matches} matches of {args.seconds:g} s a pair")
    rows = [("player", "Elo", "SE", "ahead of next", "SE", "won", "drawn", "lost", "goals", "stopped")]
    for row in values["table"]:
        ahead = ("-", "-")
        if row["ahead_of_next_elo"] is not None:
            ahead = f"{row['ahead_of_next_elo']:.0f}", f"{row['ahead_std_error_elo']:.0f}"
        counts = (str(row[key]) for key in ("won", "drawn", "lost"))
        goals = "{} : {}".format(*row["goals"])
        elo = f"{row['elo']:.0f}", f"{row['std_error_elo']:.0f}"
        rows.append((row["player"], *elo, *ahead, *counts, goals, str(row["stopped_players"])))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for first, *others in rows:
        print("  ".join([first.ljust(widths[0]), *(c.rjust(w) for c, w in zip(others, widths[1:], strict=True))]))
    print("SE: standard error of the number before it, in Elo; stopped: robots whose player failed")
    print(f"results: {path}")
    return 0


def _play(
    args: argparse.Namespace,
    plans: Sequence[MatchPlan],
    run: Mapping[str, Any],
    path: Path,
    values_of: Callable[[list[dict[str, Any]]], dict[str, Any]],
) -> dict[str, Any]:
    """Play the matches without a kept result, write what `values_of` computes from all results, and return it.

    Raises
    ------
    KeyboardInterrupt
        With a message that says how many matches are played and kept.
    """
    from contextlib import closing

    from robocup_vision.files.resume_file import ResumeFile
    from robocup_vision.files.text_files import write_json
    from robocup_vision.progress import progress
    from robocup_vision.workers import dask_workers, local_workers
    from sim2d.match.tournament import play_matches

    # even one job gets a process of its own, because a player may end it
    workers = local_workers(args.jobs) if args.dask is None else dask_workers(args.dask)
    # an error of the plan is reported here once, before any worker starts
    plans[0].begin()
    with ResumeFile(path.with_name(UNFINISHED_NAME), run, resume=args.resume) as kept:
        results = {index: result for index, result in kept.found.items() if index < len(plans)}
        missing = [index for index in range(len(plans)) if index not in results]
        playing = play_matches([plans[index] for index in missing], workers)
        try:
            with closing(playing):
                for place, result in progress(playing, len(missing), "tournament"):
                    results[missing[place]] = result
                    kept.add(missing[place], result)
        except KeyboardInterrupt:
            kept_so_far = f"{len(results)} of {len(plans)} matches are played and kept in {kept.path}; --resume goes on"
            raise KeyboardInterrupt(kept_so_far) from None
        values = values_of([results[index] for index in range(len(plans))])
        write_json(path, values)
        kept.delete()
    return values
