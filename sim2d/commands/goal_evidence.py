"""`robocup-vision learn-goal-evidence`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any

from robocup_vision.commands.options import count, seed
from sim2d.commands.spelled import spelled


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `learn-goal-evidence` to an argparse parser's subparsers; `run_goal_evidence` runs it."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "learn-goal-evidence",
        help="count on rendered pictures how often goals are found, for the planner of looks",
        description="Run the goal localiser on rendered pictures from all over a field, and write how often it finds "
        "goals and identifies them: the probabilities of the planner of looks.",
    )
    add = parser.add_argument
    add("--field", default="four_legged_2007", metavar="F", help="field with goals of posts of two colours")
    add("--count", type=count, default=1000, metavar="N", help="number of looks (default: 1000)")
    add("--seed", type=seed, default=0, metavar="S", help="look i depends on S and i alone (default: 0)")
    add("out", metavar="OUT.toml", help="file to write")
    parser.set_defaults(run=run_goal_evidence)
    return parser


def run_goal_evidence(args: argparse.Namespace) -> int:
    """Count and write; return the exit status."""
    from field_models import load_field
    from field_models.errors import ArgumentError
    from robocup_vision.camera import PinholeCamera
    from robocup_vision.files.output_folder import require_folder
    from robocup_vision.files.text_files import write_lines
    from robocup_vision.progress import progress
    from sim2d.match.setups import camera_for
    from sim2d.sensors.goal_evidence import WIDTHS_PX, count_evidence

    field = load_field(args.field)
    camera = camera_for(field)
    if not isinstance(camera, PinholeCamera):
        raise ArgumentError(f"the robots of field '{field.name}' carry no pinhole camera")
    require_folder(args.out)
    counts = count_evidence(field, camera, args.seed, progress(range(args.count), args.count, "learn-goal-evidence"))
    lines = [
        "# How often the goal localiser finds a goal and identifies it, by its parts in view.",
        "format = 1",
        f'command = "{spelled("learn-goal-evidence", args, "OUT.toml")}"',
        f"width_px = {list(WIDTHS_PX)}   # bounds between classes of the apparent distance of the posts",
        f"again_found = {counts.again_found}       # second looks at whole goals that a first one had missed",
        f"again_missed = {counts.again_missed}",
    ]
    for corners, rows in enumerate(counts.first.tolist()):
        lines += [
            "",
            "[[seen]]",
            f"corners = {corners}            # feet and tops of the posts in view",
            "counts = [              # right goal, wrong goal, nothing; a row for each class of width",
            *(f"    {row}," for row in rows),
            "]",
        ]
    write_lines(args.out, lines)
    print(f"{args.count} looks at the goals of {field.name} in {args.out}")
    return 0
