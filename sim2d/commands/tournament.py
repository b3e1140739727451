"""`robocup-vision tournament`: its options, and what it does with them."""

from __future__ import annotations

import argparse
from typing import Any

from robocup_vision.commands.worker_options import add_worker_options
from sim2d.commands.match_options import add_match_options, match_plan

UNFINISHED_NAME = "unfinished.jsonl"


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `tournament` to the subparsers of an argparse parser."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "tournament",
        help="play many simulated matches on many processes or machines",
        description="Play many simulated matches, the first with seed S, the next with S + 1 and so on, and write "
        "tournament.json. It does not depend on who plays them; a match lost with its worker is played again.",
    )
    parser.add_argument("--matches", type=int, default=10, metavar="M", help="number of matches (default: 10)")
    add_match_options(parser, "out/tournament")
    add_worker_options(parser)
    parser.add_argument("--resume", action="store_true", help="go on with an interrupted tournament in the same folder")
    parser.set_defaults(run=run_tournament)
    return parser


def run_tournament(args: argparse.Namespace) -> int:
    """Play the matches and print their totals; return the exit status.

    Raises
    ------
    RobocupVisionError
        For anything the user can mend.
    """
    from contextlib import closing
    from pathlib import Path

    from robocup_vision.files.resume_file import ResumeFile
    from robocup_vision.progress import progress
    from robocup_vision.workers import dask_workers, local_workers
    from sim2d.match.tournament import plan_json, plan_matches, play_matches, tournament_json
    from sim2d.report.match_file import write_json

    plan = match_plan(args)
    plans = plan_matches(plan, args.matches)
    # a process of its own even for one job: a player may end it
    workers = local_workers(args.jobs) if args.dask is None else dask_workers(args.dask)
    # an error of the plan is reported here once, before any worker starts
    plan.begin()
    path = Path(args.out) / "tournament.json"
    with ResumeFile(path.with_name(UNFINISHED_NAME), plan_json(plan), resume=args.resume) as kept:
        results = {index: result for index, result in kept.found.items() if index < len(plans)}
        missing = [index for index in range(len(plans)) if index not in results]
        playing = play_matches([plans[index] for index in missing], workers)
        try:
            with closing(playing):
                for place, result in progress(playing, len(missing), "tournament"):
                    results[missing[place]] = result
                    kept.add(missing[place], result)
        except KeyboardInterrupt:
            told = f"{len(results)} of {len(plans)} matches are played and kept in {kept.path}; --resume goes on"
            raise KeyboardInterrupt(told) from None
        values = tournament_json(plan, [results[index] for index in range(len(plans))])
        write_json(path, values)
        kept.delete()
    totals = values["totals"]
    print(f"{args.field}, {args.players} against {args.players}, {totals['matches']} matches of {args.seconds:g} s")
    print(f"goals {totals['goals'][0]} : {totals['goals'][1]}")
    print(f"won, drawn, lost by the side that attacks +x: {totals['won']}, {totals['drawn']}, {totals['lost']}")
    print(f"frames within 5 cm / 3 deg: {100 * totals['within_5cm_3deg']:.1f} %")
    print(f"results: {path}")
    return 0
