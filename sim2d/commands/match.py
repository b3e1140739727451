"""`robocup-vision match`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from sim2d.commands.match_options import add_match_options, match_plan

if TYPE_CHECKING:
    from contextlib import ExitStack

    from sim2d.world.referee import RefereeFactory


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `match` to the subparsers of an argparse parser."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "match",
        help="play a simulated match and write its figures, a film and a report",
        description="Play a simulated match in which robots see by their own cameras alone, and write match.json, "
        "match.webm and report.html.",
    )
    add_match_options(parser, "out/match")
    clock = parser.add_mutually_exclusive_group()
    clock.add_argument("--fast", action="store_true", help="play as fast as it goes (default)")
    clock.add_argument("--realtime", action="store_true", help="play no faster than a clock")
    parser.add_argument(
        "--record", action="store_true", help="write a recording of each robot, robot_0.mcap and so on (extra ros)"
    )
    parser.add_argument("--force", action="store_true", help="write into a folder that holds other files, too")
    judge = parser.add_mutually_exclusive_group()
    judge.add_argument(
        "--referee",
        default="simple",
        choices=("simple", "league", "network"),
        help="simple (default): the ball is put back at once; league: by the small-size league's rules; network: obey "
        "a game controller that runs (extra ssl), at the clock's speed",
    )
    judge.add_argument(
        "--ci",
        metavar="HOST[:PORT]",
        help="drive a game controller through its port for continuous integration (10009), at the match's speed",
    )
    add = parser.add_argument
    add(
        "--referee-port", type=int, default=10003, metavar="P", help="where a game controller is heard (default: 10003)"
    )
    add("--network", default="loopback", metavar="I", help="on which interface (default: loopback)")
    parser.set_defaults(run=run_match_command)
    return parser


def run_match_command(args: argparse.Namespace) -> int:
    """Play a match and print its figures; return the exit status."""
    import dataclasses
    from contextlib import ExitStack

    from sim2d.match.run import run_match

    plan = match_plan(args)
    with ExitStack() as opened:
        plan = dataclasses.replace(plan, referee=_referee(args, opened))
        realtime = args.realtime or args.referee == "network"
        summary = run_match(plan, args.out, realtime=realtime, record=args.record, force=args.force)
    figures = summary.figures
    print(f"{args.field}, {plan.players} against {plan.players}, {figures.seconds:g} s, seed {args.seed}")
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
            f"{100 * robot.lost_ratio:.1f} %",
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
    for path in summary.recordings:
        print(f"recording: {path}")
    print(f"report: {summary.report or summary.out}")
    return 0


def _referee(args: argparse.Namespace, opened: ExitStack) -> RefereeFactory | None:
    """Return the chosen referee's factory; `opened` closes its connection."""
    if args.ci is not None:
        from field_models.errors import ArgumentError
        from robocup_vision.ssl.controller_clients import CI_PORT, CiClient
        from sim2d.network.foreign_referee import DrivenReferee, ForeignReferee

        host, _, port = args.ci.partition(":")
        if port and not port.isdecimal():
            raise ArgumentError(f"--ci is given as HOST or HOST:PORT, got {args.ci!r}")
        driven = opened.enter_context(CiClient(host, int(port or CI_PORT)))
        return lambda field, limits: ForeignReferee(DrivenReferee(driven, field), field)
    if args.referee == "network":
        from robocup_vision.ssl.subscriptions import RefereeClient
        from sim2d.network.foreign_referee import ForeignReferee

        client = opened.enter_context(RefereeClient(args.referee_port, args.network))
        return lambda field, limits: ForeignReferee(lambda *_: client.receive_newest(), field)
    if args.referee == "league":
        from sim2d.match.league_referee import league_referee

        return league_referee
    return None


def _millimetres(length_m: float | None) -> str:
    return "-" if length_m is None else f"{1e3 * length_m:.1f} mm"
