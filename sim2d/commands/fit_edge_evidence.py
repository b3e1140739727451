"""`robocup-vision fit-edge-evidence`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any

from robocup_vision.commands.options import count, seed
from sim2d.commands.spelled import spelled


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `fit-edge-evidence` to an argparse parser's subparsers; `run_fit_edge_evidence` runs it."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "fit-edge-evidence",
        help="fit the verdict on a forward camera's pose to rendered pictures and to ones without a field",
        description="Fit poses to rendered pictures of several fields and cameras and to ones without a field, from "
        "right and from wrong priors and without one, and write the weights that the verdict on a forward camera's "
        "pose goes by.",
    )
    add = parser.add_argument
    add("--count", type=count, default=100, metavar="N", help="pictures of each field and camera (default: 100)")
    add("--seed", type=seed, default=0, metavar="S", help="all depends on S alone (default: 0)")
    add(
        "--cost",
        type=float,
        default=5.0,
        metavar="C",
        help="right poses refused that a wrong one is worth (default: 5)",
    )
    add("out", metavar="OUT.toml", help="file to write")
    parser.set_defaults(run=run_fit_edge_evidence)
    return parser


def run_fit_edge_evidence(args: argparse.Namespace) -> int:
    """Fit and write; return the exit status."""
    import json
    import math

    from field_models.errors import ArgumentError
    from robocup_vision.files.output_folder import require_folder
    from robocup_vision.files.text_files import write_lines
    from robocup_vision.localization.model_edges.weights import WEIGHTS
    from robocup_vision.progress import progress
    from sim2d.training.edge_evidence import draw_choices, fit_choices, picture_count, set_names

    if not 0.0 < args.cost < math.inf:
        raise ArgumentError(f"--cost must be positive, got {args.cost:g}")
    require_folder(args.out)
    total = picture_count(args.count)
    *_, choices = progress(draw_choices(args.seed, args.count), total, "fit-edge-evidence")
    fitted = fit_choices(choices, args.cost)
    lines = [
        "# Odds of a forward camera's pose by what its fit finds and leaves open. Written by a command, never by hand.",
        "format = 1",
        f'command = "{spelled("fit-edge-evidence", args, "OUT.toml")}"',
        f"sets = {json.dumps(set_names())}",
        f"near_prior = {fitted.near_prior[0]:.3f}        # log odds of a fit near a prior, before its terms",
        f"anywhere = {fitted.anywhere:.3f}          # of one without a prior",
        f"within_picture = {fitted.within_picture:.3f}    # times the weights, without a prior",
        f"sure_log_odds = {fitted.sure_log_odds:.3f}      # wrong fits hardly have more",
        "",
        "[weights]",
        *(f"{name} = {weight:.3f}" for name, weight in zip(WEIGHTS, fitted.near_prior[1:].tolist(), strict=True)),
    ]
    write_lines(args.out, lines)
    print(f"evidence of {total} pictures in {args.out}")
    return 0
