"""`robocup-vision render-goal`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any

from robocup_vision.commands.options import add_worker_options, count, seed
from sim2d.commands.spelled import spelled

# names only, because parsing options must load neither the renderer nor NumPy, so that --help answers at once
GOAL_CONDITION_NAMES = (
    "clean_416x320",
    "mild_glare_416x320",
    "heavy_glare_416x320",
    "streaks_416x320",
    "clean_208x160",
    "mild_glare_208x160",
    "heavy_glare_208x160",
    "streaks_208x160",
    "white_640x480",
)
PLACES = ("paper", "anywhere")
VIEWS = ("goal", "negative")


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `render-goal` to the subparsers of an argparse parser; `run_render_goal` runs what it parses."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "render-goal",
        help="write a dataset folder of rendered pictures of a goal with truth",
        description="Write a dataset folder of pictures of a goal by a pinhole camera, with truth.",
    )
    add = parser.add_argument
    add("--field", default="four_legged_2007", metavar="F", help="built-in field's name, or a field file (.toml)")
    add("--condition", choices=GOAL_CONDITION_NAMES, default="mild_glare_416x320", help="camera and disturbances")
    add("--places", choices=PLACES, default="paper", help="the 66 places of Yako et al. (default), or anywhere")
    add("--views", choices=VIEWS, default="goal", help="the whole goal (default), or no or only half a goal to find")
    add("--count", type=count, default=66, metavar="N", help="number of images (default: 66)")
    add("--seed", type=seed, default=0, metavar="S", help="image i depends on S and i alone (default: 0)")
    add("--jpeg", type=int, metavar="Q", help="small .jpg files of quality 1 to 100, not .png")
    add_worker_options(parser)
    add("out", metavar="OUT", help="folder to write; must be absent or empty")
    parser.set_defaults(run=run_render_goal)
    return parser


def run_render_goal(args: argparse.Namespace) -> int:
    """Render a dataset and print its folder; return the exit status."""
    from contextlib import closing
    from functools import partial

    from field_models import load_field
    from field_models.errors import ArgumentError
    from robocup_vision.commands.options import chosen_workers
    from robocup_vision.progress import progress
    from robocup_vision.workers import in_order, run_pieces
    from sim2d.rendering.dataset import DrawPictures, write_dataset
    from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, NEGATIVE_VIEWS, paper_places, sample_goal

    if args.jpeg is not None and not 1 <= args.jpeg <= 100:
        raise ArgumentError(f"--jpeg must be within 1 to 100, got {args.jpeg}")
    field, condition = load_field(args.field), GOAL_CONDITIONS[args.condition]
    negative = args.views == "negative"
    sample = partial(
        sample_goal,
        field,
        condition,
        args.seed,
        args.count,
        places=paper_places(field) if args.places == "paper" and not negative else None,
        views=NEGATIVE_VIEWS if negative else ("goal",),
    )
    start = DrawPictures(sample, args.jpeg)
    with closing(in_order(run_pieces(start, range(args.count), chosen_workers(args)))) as drawn:
        count = write_dataset(
            args.out,
            args.field,
            condition.camera,
            progress(drawn, args.count, "render-goal"),
            symmetry="none" if field.halves_differ else "point",
            command=spelled("render-goal", args),
        )
    print(f"{count} images of {field.name} in {args.out}")
    return 0
