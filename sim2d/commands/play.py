"""`robocup-vision play`: our players as a team of the small-size league, with any simulator or field of the league."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sim2d.network.team.client import TeamClient

_STATUS_S = 1.0


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `play` to the subparsers of an argparse parser."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "play",
        help="play as a team of the small-size league, on any simulator of it",
        description="Drive the robots of one team of the small-size league by overhead vision, obeying the referee. "
        "Works with any simulator of the league. Ctrl-C ends it.",
    )
    add = parser.add_argument
    add("--team", required=True, choices=("yellow", "blue"), help="which team to play")
    add("--field", default="ssl_division_b", metavar="F", help="built-in field, or a field file (ssl_division_b)")
    add("--network", default="loopback", metavar="I", help="loopback (default), or a network interface or its address")
    add("--host", default="127.0.0.1", metavar="H", help="where the simulator runs (default: 127.0.0.1)")
    add("--vision-port", type=int, default=10020, metavar="P", help="10020 (default), or 10006 as the league's own")
    add("--referee-port", type=int, default=10003, metavar="P", help="default: 10003")
    add("--robot-port", type=int, metavar="P", help="default: 10302 for yellow, 10301 for blue")
    add(
        "--game-controller",
        metavar="HOST",
        help="tell a game controller there (port 10008) who keeps the goal (default: tell nobody)",
    )
    add("--speed", type=float, default=1.5, metavar="V", help="how fast robots drive at most, m/s (default: 1.5)")
    add("--seconds", type=float, metavar="T", help="end after so long (default: never)")
    parser.set_defaults(run=run_play)
    return parser


def run_play(args: argparse.Namespace) -> int:
    """Play until interrupted or the time is over; return the exit status."""
    import math

    from field_models import load_field
    from field_models.errors import ArgumentError
    from robocup_vision.ssl.values.simulation import Team
    from sim2d.network.team.client import TeamClient

    if args.seconds is not None and not 0 < args.seconds < math.inf:
        raise ArgumentError(f"--seconds must be positive, got {args.seconds}")
    if not 0.2 <= args.speed <= 4.0:
        raise ArgumentError(f"--speed must be from 0.2 to 4 m/s, got {args.speed}")
    for name in ("vision_port", "referee_port", "robot_port"):
        port = getattr(args, name)
        if port is not None and not 1 <= port <= 65535:
            raise ArgumentError(f"--{name.replace('_', '-')} must be from 1 to 65535, got {port}")
    with TeamClient(
        Team[args.team.upper()],
        load_field(args.field),
        speed_mps=args.speed,
        host=args.host,
        interface=args.network,
        vision_port=args.vision_port,
        referee_port=args.referee_port,
        robot_port=args.robot_port,
        controller_host=args.game_controller,
    ) as client:
        print(
            f"{args.team} on {args.field}: vision at 224.5.23.2:{args.vision_port}, robots at {args.host}", flush=True
        )
        try:
            _play(client, args.seconds)
        except KeyboardInterrupt:
            print()
        print(f"{client.sent} packets of commands, {client.bad_datagrams} bad datagrams")
        for line in client.problems.lines():
            print(line)
    return 0


def _play(client: TeamClient, seconds: float | None) -> None:
    import time

    begin_s = time.monotonic()
    shown, next_s = "", begin_s + _STATUS_S

    def continues() -> bool:
        nonlocal shown, next_s
        now_s = time.monotonic()
        if now_s >= next_s:
            next_s = now_s + _STATUS_S
            state = client.team.state
            words = "no vision" if client.is_blind else "no referee" if state is None else state.phase.replace("_", " ")
            if state is not None and state.doubt and not client.is_blind:
                words += f" ({state.doubt})"
            for problem in client.problems.take_new():
                print(problem, flush=True)
            if words != shown:
                shown = words
                print(words, flush=True)
        return seconds is None or now_s - begin_s < seconds

    client.run(continues)
