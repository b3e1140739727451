"""`robocup-vision simulate`: sim2d as a simulator of the small-size league, for any team."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sim2d.network.server import LeagueServer

_STATUS_S = 1.0


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `simulate` to the subparsers of an argparse parser."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "simulate",
        help="simulate a field of the small-size league for teams' own programs",
        description="Simulate a field of the small-size league: publish vision, tracker and, unless a game controller "
        "runs, referee; take simulation control and robot commands by the league's protocols. Ctrl-C ends it.",
    )
    add = parser.add_argument
    add("--field", default="ssl_division_b", metavar="F", help="built-in field, or a field file (ssl_division_b)")
    add("--players", type=int, default=6, metavar="N", help="robots of each team (default: 6)")
    add("--network", default="loopback", metavar="I", help="loopback (default), or a network interface or its address")
    add("--speed", type=float, default=1.0, metavar="X", help="1: as a clock (default); 0: as fast as it goes")
    add("--realism", default="none", metavar="R", help="none (default), rc2021 or cameras: see the page")
    add("--cameras", metavar="CxR", help="cameras along the field and across it, e.g. 4x2 (default: the realism's)")
    add("--images", metavar="DIR", help="save what each camera sees there")
    add(
        "--images-every",
        type=int,
        default=30,
        metavar="N",
        help="save every so many frames (default: 30, two a second)",
    )
    add(
        "--referee",
        default="play-on",
        choices=("play-on", "match"),
        help="play-on (default): everybody may play all the time; match: a match by the league's rules",
    )
    add(
        "--built-in",
        action="append",
        default=[],
        metavar="TEAM=KIND[:N,N]",
        help="built-in players for a team, or for some of its robots; KIND is overhead (by the vision from above), or "
        "plain, memory or planning (by cameras of their own); may be given again",
    )
    add("--seed", type=int, default=0, metavar="S", help="of all noise (default: 0)")
    add("--vision-port", type=int, default=10020, metavar="P", help="10020 (default), or 10006 as the league's own")
    add("--tracker-port", type=int, default=10010, metavar="P", help="default: 10010")
    add("--referee-port", type=int, default=10003, metavar="P", help="default: 10003")
    add("--control-port", type=int, default=10300, metavar="P", help="robots at the next two (default: 10300)")
    add(
        "--own-referee-returns",
        action="store_true",
        help="publish the own referee again when a game controller that was heard falls silent (default: never)",
    )
    add(
        "--game-controller",
        metavar="HOST",
        help="be the automatic referee (port 10007) of a game controller that runs there, and press on its page (8081) "
        "what a person would",
    )
    add(
        "--ci",
        action="store_true",
        help="with --game-controller: it was started for continuous integration (10009) and goes by simulated time",
    )
    add("--seconds", type=float, metavar="T", help="end after so much simulated time (default: never)")
    parser.set_defaults(run=run_simulate)
    return parser


def run_simulate(args: argparse.Namespace) -> int:
    """Serve until interrupted or the time is over; return the exit status."""
    import math
    import time
    from contextlib import ExitStack

    from field_models import load_field
    from field_models.errors import ArgumentError
    from sim2d.match.league_referee import LeagueReferee
    from sim2d.network.built_in import built_in_robots, check_apart
    from sim2d.network.control import MAX_CLOCK_RATIO, MIN_CLOCK_RATIO
    from sim2d.network.controller_link import ControllerLink
    from sim2d.network.league import LeagueSimulator
    from sim2d.network.realism import realism_named
    from sim2d.network.server import LeagueServer, Ports
    from sim2d.network.vision import CameraImages

    if args.speed != 0 and not MIN_CLOCK_RATIO <= args.speed <= MAX_CLOCK_RATIO:
        raise ArgumentError(f"--speed must be 0 or from {MIN_CLOCK_RATIO:g} to {MAX_CLOCK_RATIO:g}, got {args.speed}")
    if args.seconds is not None and not 0 < args.seconds < math.inf:
        raise ArgumentError(f"--seconds must be positive, got {args.seconds}")
    for name in ("vision", "tracker", "referee", "control"):
        port = getattr(args, f"{name}_port")
        if not 1 <= port <= 65533:
            raise ArgumentError(f"--{name}-port must be from 1 to 65533, got {port}")
    field = load_field(args.field)
    built_in = [built_in_robots(text, field, args.players, args.seed) for text in args.built_in]
    check_apart(built_in)
    referee = LeagueReferee(field, field.robot_radius_m) if args.referee == "match" else None
    realism = realism_named(args.realism, args.cameras)
    images = CameraImages(args.images, args.images_every, args.seed) if args.images else None
    simulator = LeagueSimulator(
        field, args.players, realism, args.seed, time.time(), referee, built_in=built_in, images=images
    )
    simulator.speed = args.speed or math.inf
    simulator.vision_port = args.vision_port
    ports = Ports(args.control_port, args.tracker_port, args.referee_port)
    if args.ci and args.game_controller is None:
        raise ArgumentError("--ci needs --game-controller HOST")
    with ExitStack() as opened:
        controller = None
        if args.game_controller is not None:
            controller = opened.enter_context(ControllerLink(field, args.game_controller, drives=args.ci))
        server = opened.enter_context(
            LeagueServer(simulator, args.network, ports, controller, own_referee_returns=args.own_referee_returns)
        )
        print(f"{args.field}, {args.players} against {args.players}, realism {args.realism}, network {args.network}")
        print(f"vision 224.5.23.2:{args.vision_port}, tracker 224.5.23.2:{ports.tracker}, referee 224.5.23.1:", end="")
        print(f"{ports.referee}; control {ports.control}, blue {ports.blue}, yellow {ports.yellow}", flush=True)
        try:
            _serve(server, args.seconds)
        except KeyboardInterrupt:
            print()
        _print_end(server)
        if controller is not None:
            print(f"{controller.events} events told to the game controller")
    if images is not None:
        images.close()
        print(f"{images.saved} images in {images.folder}")
    return 0


def _serve(server: LeagueServer, seconds: float | None) -> None:
    import sys
    import time

    simulator = server.simulator
    shown, next_s = 0, 0.0

    def continues() -> bool:
        nonlocal shown, next_s
        if simulator.bad_datagrams != shown and time.monotonic() >= next_s:
            shown, next_s = simulator.bad_datagrams, time.monotonic() + _STATUS_S
            print(f"bad datagrams: {shown}, the last one: {simulator.last_problem}", file=sys.stderr, flush=True)
        for words in server.problems.take_new():
            print(words, file=sys.stderr, flush=True)
        return seconds is None or simulator.world.t_s < seconds - 1e-9

    server.run(continues)


def _print_end(server: LeagueServer) -> None:
    simulator = server.simulator
    print(f"{simulator.world.t_s:.1f} s simulated, {simulator.bad_datagrams} bad datagrams")
    late = sorted(server.lateness_s)
    if late:
        p99_ms = 1000 * late[int(0.99 * (len(late) - 1))]
        print(f"vision packets went out late by {1000 * late[len(late) // 2]:.2f} ms (median), {p99_ms:.2f} ms (p99)")
    if server.behind_s:
        print(f"this machine could not keep up with the clock: {server.behind_s:.1f} s were given up")
