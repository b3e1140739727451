"""`robocup-vision render-hall`: its options and its handler."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from robocup_vision.commands.options import count, seed
from sim2d.commands.spelled import spelled

FIELD = "four_legged_2007"
_SECOND_SHIFT_M = 0.2


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `render-hall` to the subparsers of an argparse parser; `run_render_hall` runs what it parses."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "render-hall",
        help="write a rendered run of three cameras through a hall, and a second run of one",
        description="Write OUT/run, a run of three cameras to build a landmark map from, and OUT/dataset, a second run "
        "of one camera along a shifted path with truth, which expects the map in OUT/map.npz.",
    )
    add = parser.add_argument
    add("--count", type=count, default=143, metavar="N", help="moments of the first run (default: 143)")
    add("--second", type=count, default=100, metavar="N", help="images of the second run (default: 100)")
    add("--turns", type=float, default=1.0, metavar="T", help="rounds of 10 m through the hall (default: 1)")
    add("--seed", type=seed, default=0, metavar="S", help="which hall (default: 0)")
    add("--level", type=float, default=0.5, metavar="L", help="light of the second run (default: 0.5 of the first)")
    add("--moved", type=float, default=0.0, metavar="FRACTION", help="posters moved or covered before it (default: 0)")
    add("out", metavar="OUT", help="folder to write; must be absent or empty")
    parser.set_defaults(run=run_render_hall)
    return parser


def run_render_hall(args: argparse.Namespace) -> int:
    """Render both runs and print their folders; return the exit status."""
    from field_models.errors import ArgumentError
    from robocup_vision.files.output_folder import require_empty_folder, written_at_once
    from robocup_vision.progress import progress
    from sim2d.rendering.hall.hall import HallLight, loop_path, make_hall
    from sim2d.rendering.hall.runs import HALL_CAMERA, HALL_RIG, take, write_run, write_second_run

    if not args.turns > 0:
        raise ArgumentError(f"--turns must be positive, got {args.turns}")
    import numpy as np

    hall = make_hall(args.seed)
    changed = hall.rearranged(args.moved, np.random.default_rng([args.seed, 1]))
    light = HallLight(level=args.level)
    command = spelled("render-hall", args)
    path = loop_path(args.count, turns=args.turns)
    cameras = (HALL_RIG.right, HALL_RIG.left, HALL_RIG.top)
    first = take(hall, cameras, path, args.seed)
    shifted = loop_path(args.second, shift_m=_SECOND_SHIFT_M, turns=args.turns)
    second = take(changed, (HALL_CAMERA,), shifted, args.seed + 1, light=light)
    require_empty_folder(Path(args.out))
    with written_at_once(Path(args.out), ()) as work:
        write_run(work, HALL_RIG, progress(first, args.count, "run"), command)
        write_second_run(work, FIELD, HALL_CAMERA, progress(second, args.second, "dataset"), command)
    print(f"{args.count} moments in {args.out}/run, {args.second} images in {args.out}/dataset; next:")
    print(f"  robocup-vision map build {args.out}/run --out {args.out}/map.npz")
    print(f"  robocup-vision evaluate {args.out}/dataset")
    return 0
