"""`robocup-vision log`: shows, converts and records logs of the small-size league, and scores our tracker on them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add_parser(subparsers: Any) -> None:
    """Add the command `log` to the subparsers of an argparse parser."""
    parser = subparsers.add_parser(
        "log", help="read a log of the small-size league: what is in it, as tables, as a test of the tracker"
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, words in (
        ("info", "what is in it"),
        ("convert", "write detections.csv, referee.csv and tracked.csv, or an MCAP file"),
        ("score", "score our tracker beside the last detection, against the log's tracker packets"),
    ):
        action = actions.add_parser(name, help=words, description=f"{words[0].upper()}{words[1:]}.")
        action.add_argument("file", metavar="FILE", help="log; compressed where its name ends in gz")
        if name == "convert":
            action.add_argument(
                "--to", choices=("csv", "mcap"), default="csv", help="tables, or one file for MCAP viewers"
            )
            action.add_argument("--out", metavar="DIR", help="folder for the tables or the file (default: out/NAME)")
    record = actions.add_parser(
        "record",
        help="record what is sent to everybody: vision, trackers and the referee",
        description="Record what vision, trackers and the referee send to everybody. Ctrl-C ends it.",
    )
    add = record.add_argument
    add("file", metavar="FILE", help="the log; compressed where its name ends in gz")
    add("--network", default="loopback", metavar="I", help="loopback (default), or a network interface or its address")
    add(
        "--vision-port",
        type=int,
        action="append",
        metavar="P",
        help="may be given again (default: 10006, the league's vision, and 10020, simulators)",
    )
    add("--tracker-port", type=int, default=10010, metavar="P", help="default: 10010")
    add("--referee-port", type=int, default=10003, metavar="P", help="default: 10003")
    add("--seconds", type=float, metavar="T", help="end after so long (default: never)")
    add("--force", action="store_true", help="replace a file that is there")
    parser.set_defaults(run=run_log)


def run_log(args: argparse.Namespace) -> int:
    """Run an action on a log; return the exit status."""
    from robocup_vision.ssl.log import SslLog

    if args.action == "record":
        return _record(args)
    with SslLog(args.file) as log:
        if args.action == "info":
            return _info(log)
        if args.action == "convert":
            name = log.path.name.partition(".")[0]
            out = Path(args.out) if args.out else Path("out") / name
            return _to_mcap(log, out / f"{name}.mcap") if args.to == "mcap" else _convert(log, out)
        return _score(log)


def _record(args: argparse.Namespace) -> int:
    import math
    import time

    from field_models.errors import ArgumentError
    from robocup_vision.ssl.log_record import record_log

    if args.seconds is not None and not 0 < args.seconds < math.inf:
        raise ArgumentError(f"--seconds must be positive, got {args.seconds}")
    ports = args.vision_port or [10006, 10020]
    for port in (*ports, args.tracker_port, args.referee_port):
        if not 1 <= port <= 65535:
            raise ArgumentError(f"a port must be from 1 to 65535, got {port}")
    begin_s = time.monotonic()
    counts: dict[str, int] = {}

    def continues(so_far: dict[str, int]) -> bool:
        counts.update(so_far)
        return args.seconds is None or time.monotonic() - begin_s < args.seconds

    print(f"recording into {args.file}; Ctrl-C ends it", flush=True)
    try:
        record_log(
            args.file,
            continues,
            interface=args.network,
            vision_ports=ports,
            tracker_port=args.tracker_port,
            referee_port=args.referee_port,
            replaces=args.force,
        )
    except KeyboardInterrupt:
        print()
    print(f"{args.file}: {', '.join(f'{count} {kind}' for kind, count in counts.items())}")
    return 0


def _info(log: Any) -> int:
    from datetime import datetime, timezone

    from robocup_vision.ssl.log import NS_PER_S, log_info

    info = log_info(log)
    print(log.path.name)
    rows = [("entries", ", ".join(f"{count} {name}" for name, count in sorted(info.entries.items())) or "none")]
    if info.first_ns is not None:
        begin = datetime.fromtimestamp(info.first_ns / NS_PER_S, timezone.utc)
        rows.append(("time", f"{begin:%Y-%m-%d %H:%M:%S} UTC, {info.duration_s:.1f} s"))
    for camera, count in sorted(info.cameras.items()):
        rate = f", {(count - 1) / info.duration_s:.1f} a second" if info.duration_s > 0 else ""
        rows.append((f"camera {camera}", f"{count} frames{rate}"))
    if info.field_m is not None:
        rows.append(
            ("geometry", f"{info.geometry_packets} packets, field {info.field_m[0]:g} m x {info.field_m[1]:g} m")
        )
    rows += [(f"tracker {name}", f"{count} packets") for name, count in sorted(info.trackers.items())]
    if info.teams is not None and info.score is not None:
        rows.append(("teams", f"yellow {info.teams[0]} {info.score[0]} : {info.score[1]} {info.teams[1]} blue"))
        rows.append(("commands", ", ".join(info.commands)))
    if info.unreadable.count:
        rows.append(("unreadable", f"{info.unreadable.count} entries, the first is {info.unreadable.first}"))
    width = max(len(label) for label, _ in rows)
    for label, text in rows:
        print(f"  {label:<{width}}  {text}")
    return _status(log, info.unreadable, says_count=False)


def _status(log: Any, unreadable: Any, *, says_count: bool = True) -> int:
    """Report what could not be read of a log; return the exit status."""
    import sys

    if unreadable.count and says_count:
        words = "entry" if unreadable.count == 1 else "entries"
        print(
            f"robocup-vision log: {log.path}: {unreadable.count} unreadable {words} left out, the first is "
            f"{unreadable.first}",
            file=sys.stderr,
        )
    if unreadable.damage:
        print(f"robocup-vision log: {unreadable.damage}", file=sys.stderr)
        return 2
    return 0


def _convert(log: Any, out: Path) -> int:
    from robocup_vision.ssl.log_convert import write_tables

    tables, unreadable = write_tables(log, out)
    for name, rows in tables.items():
        print(f"{out / name}.csv: {rows} rows")
    if not tables:
        print("there is nothing in it that a table holds")
    return _status(log, unreadable)


def _to_mcap(log: Any, path: Path) -> int:
    from robocup_vision.ssl.log_convert import write_mcap

    counts, unreadable = write_mcap(log, path)
    print(f"{path}: {', '.join(f'{count} on {topic}' for topic, count in sorted(counts.items())) or 'no messages'}")
    return _status(log, unreadable)


def _score(log: Any) -> int:
    from robocup_vision.ssl.log import Unreadable
    from robocup_vision.ssl.log_score import score_log

    unreadable = Unreadable()
    score = score_log(log, unreadable=unreadable)
    print(f"{log.path.name}: {score.frames} frames of {score.source}")
    print(f"{'':<17} {'tracker':>10} {'last seen':>10}")
    for label, ours, last, per_unit, unit in (
        ("robot, place", score.robot_rms_m, score.robot_last_rms_m, 1000.0, "mm"),
        ("robot, angle", score.robot_rms_rad, score.robot_last_rms_rad, 1000.0, "mrad"),
        ("robot, velocity", score.robot_velocity_rms_mps, None, 1000.0, "mm/s"),
        ("exposed, place", score.exposed_rms_m, score.exposed_last_rms_m, 1000.0, "mm"),
        ("exposed, velocity", score.exposed_velocity_rms_mps, None, 1000.0, "mm/s"),
        ("ball, place", score.ball_rms_m, score.ball_last_rms_m, 1000.0, "mm"),
        ("ball, velocity", score.ball_velocity_rms_mps, None, 1000.0, "mm/s"),
    ):
        cells = ("-" if value is None else f"{per_unit * value:.1f}" for value in (ours, last))
        print(f"{label:<17} " + " ".join(f"{cell:>10}" for cell in cells) + f" {unit} RMS")
    refound = "-" if score.ball_refound_s is None else f"{score.ball_refound_s:.2f} s"
    print(f"ball hidden {score.ball_hidden} times, longest until it was found again: {refound}")
    return _status(log, unreadable)
