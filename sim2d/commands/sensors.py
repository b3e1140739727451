"""`robocup-vision sensors learn`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any

from robocup_vision.commands.options import count, seed
from sim2d.commands.spelled import spelled


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `sensors` to the subparsers of an argparse parser; `run_sensors` runs what it parses."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "sensors",
        help="learn how far a map can rely on camera and range sensor",
        description="Models of the sensors that a free-space map is made from.",
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    learn = actions.add_parser(
        "learn",
        help="learn them from rendered runs with truth",
        description="Drive rendered runs under glare and shadows among things of all heights, count how often each "
        "sensor has hits in occupied and in free cells, and write the models of FreeSpaceMap.",
    )
    add = learn.add_argument
    add("--out", required=True, metavar="FILE", help="file of sensor models to write (.toml)")
    add("--field", default="ssl_2001", metavar="F", help="built-in field's name, or a field file (default: ssl_2001)")
    add("--camera", default="sekimori", metavar="C", help="sekimori[:WxH], or a camera file (default: sekimori)")
    add("--range-height", type=float, default=0.08, metavar="M", help="height of the range sensor's plane, metres")
    add("--cell", type=float, default=0.04, metavar="M", help="side of the map's cells, metres (default: 0.04)")
    add("--runs", type=count, default=6, metavar="N", help="runs under each kind of light (default: 6)")
    add("--frames", type=count, default=80, metavar="N", help="frames a run, ten a second (default: 80)")
    add("--seed", type=seed, default=0, metavar="S", help="which runs (default: 0)")
    parser.set_defaults(run=run_sensors)
    return parser


def run_sensors(args: argparse.Namespace) -> int:
    """Learn and write; return the exit status."""
    from field_models import load_field
    from field_models.errors import ArgumentError
    from robocup_vision.camera import OmniCamera
    from robocup_vision.files.output_folder import require_folder
    from robocup_vision.mapping.sensor_model import write_sensors
    from robocup_vision.progress import progress
    from sim2d.rendering.cameras import camera_by_name
    from sim2d.sensors.learning import KINDS_LEARNT, learn_sensors
    from sim2d.sensors.range_sensor import RangeSensor

    if not 0 < args.cell < 1:
        raise ArgumentError(f"--cell must be within 0 to 1 m, got {args.cell}")
    camera = camera_by_name(args.camera)
    if not isinstance(camera, OmniCamera):
        raise ArgumentError(f"camera '{args.camera}' is no mirror camera")
    require_folder(args.out)
    learnt = learn_sensors(
        load_field(args.field),
        camera,
        args.seed,
        runs=args.runs,
        frames=args.frames,
        cell_m=args.cell,
        scanner=RangeSensor(args.range_height),
    )
    total = args.runs * len(KINDS_LEARNT)
    *_, models = progress(learnt, total, "sensors learn")
    write_sensors(args.out, models, spelled("sensors learn", args, None))
    for name, model in models.items():
        print(
            f"{name}: has hits in {model.hit_if_occupied:.1%} of the occupied cells with evidence, in "
            f"{model.hit_if_free:.1%} of the free ones; from {model.nearest_m:.2f} to {model.reach_m:.2f} m"
        )
    print(f"learnt from {total} runs, written to {args.out}")
    return 0
