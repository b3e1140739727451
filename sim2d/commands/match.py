"""`robocup-vision match` and `robocup-vision tournament`: their options, and what they do with them."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sim2d.match.run import MatchPlan


def add_match_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `match` to the subparsers of an argparse parser; `run_match_command` runs what it parses."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "match",
        help="play a simulated match and write its figures, a film and a report",
        description="Play a simulated match in which robots see by their own cameras alone, and write match.json, "
        "match.webm and report.html.",
    )
    _add_what_is_played(parser, "out/match")
    clock = parser.add_mutually_exclusive_group()
    clock.add_argument("--fast", action="store_true", help="play as fast as it goes (default)")
    clock.add_argument("--realtime", action="store_true", help="play no faster than a clock")
    return parser


def add_tournament_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `tournament` to the subparsers of an argparse parser; `run_tournament` runs what it parses."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "tournament",
        help="play many simulated matches on many processes or machines",
        description="Play many simulated matches, the first with seed S, the next with S + 1 and so on, and write "
        "tournament.json. It does not depend on who plays them; a match lost with its worker is played again.",
    )
    parser.add_argument("--matches", type=int, default=10, metavar="M", help="number of matches (default: 10)")
    _add_what_is_played(parser, "out/tournament")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--jobs", type=int, default=1, metavar="N", help="processes on this machine (default: 1)")
    where.add_argument(
        "--dask", metavar="ADDRESS", help="scheduler of a dask.distributed cluster, e.g. tcp://host:8786"
    )
    return parser


def _add_what_is_played(parser: argparse.ArgumentParser, out: str) -> None:
    add = parser.add_argument
    add("--field", default="ssl_2001", metavar="F", help="built-in field's name, or a field file (default: ssl_2001)")
    add("--players", type=int, default=2, metavar="N", help="players per side (default: 2)")
    add("--seconds", type=float, default=60.0, metavar="T", help="length of a match (default: 60)")
    add("--seed", type=int, default=0, metavar="S", help="the same seed plays the same match (default: 0)")
    names = "plain, memory or planning (default: plain)"
    add("--ours", default="plain", metavar="NAME", help=f"players of the side that attacks +x: {names}")
    add("--theirs", default="plain", metavar="NAME", help=f"players of the other side: {names}")
    add("--out", default=out, metavar="DIR", help=f"folder for the files (default: {out})")


def run_match_command(args: argparse.Namespace) -> int:
    """Play a match and print its figures; return the exit status.

    Raises
    ------
    RobocupVisionError
        For anything the user can mend.
    """
    from sim2d.match.run import run_match

    plan = _plan(args)
    summary = run_match(plan, args.out, realtime=args.realtime)
    figures = summary.figures
    print(f"{args.field}, {args.players} against {args.players}, {figures.seconds:g} s, seed {args.seed}")
    print(f"score {figures.score[0]} : {figures.score[1]}")
    columns = ("robot", "side", "5cm/3deg", "median", "p95", "lost", "collisions", "way", "has ball")
    print("  ".join(f"{name:>10}" for name in columns))
    for robot in figures.robots:
        cells = (
            str(robot.robot),
            "+x" if robot.side > 0 else "-x",
            f"{100 * robot.within_5cm_3deg:.1f} %",
            _millimetres(robot.median_error_m),
            _millimetres(robot.p95_error_m),
            f"{100 * robot.lost_share:.1f} %",
            str(robot.collisions),
            f"{robot.distance_m:.1f} m",
            f"{100 * robot.possession:.1f} %",
        )
        print("  ".join(f"{cell:>10}" for cell in cells))
    for robot in figures.robots:
        if robot.stopped_reason:
            print(f"robot {robot.robot} was stopped at {robot.stopped_s:.2f} s: {robot.stopped_reason}")
    for note in summary.notes:
        print(f"note: {note}")
    print(f"report: {summary.report or summary.out}")
    return 0


def run_tournament(args: argparse.Namespace) -> int:
    """Play the matches and print their totals; return the exit status.

    Raises
    ------
    RobocupVisionError
        For anything the user can mend.
    """
    from pathlib import Path

    from robocup_vision.progress import progress
    from sim2d.match.tournament import dask_workers, local_workers, plan_matches, play_matches, tournament_json
    from sim2d.report.match_file import write_json

    plan = _plan(args)
    plans = plan_matches(plan, args.matches)
    workers = local_workers(args.jobs) if args.dask is None else dask_workers(args.dask)
    # what is wrong with it is told here once, before any worker starts
    plan.begin()
    results = dict(progress(play_matches(plans, workers), len(plans), "tournament"))
    values = tournament_json(plan, [results[index] for index in range(len(plans))])
    path = Path(args.out) / "tournament.json"
    write_json(path, values)
    totals = values["totals"]
    print(f"{args.field}, {args.players} against {args.players}, {totals['matches']} matches of {args.seconds:g} s")
    print(f"goals {totals['goals'][0]} : {totals['goals'][1]}")
    print(f"won, drawn, lost by the side that attacks +x: {totals['won']}, {totals['drawn']}, {totals['lost']}")
    print(f"frames within 5 cm / 3 deg: {100 * totals['within_5cm_3deg']:.1f} %")
    print(f"results: {path}")
    return 0


def _plan(args: argparse.Namespace) -> MatchPlan:
    from sim2d.match.run import MatchPlan
    from sim2d.players.catalog import player_factory

    ours, theirs = player_factory(args.ours), player_factory(args.theirs)
    return MatchPlan(args.field, args.players, args.seconds, args.seed, ours, theirs)


def _millimetres(length_m: float | None) -> str:
    return "-" if length_m is None else f"{1e3 * length_m:.1f} mm"
