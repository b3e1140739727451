"""`robocup-vision fit-evidence`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any

from robocup_vision.commands.options import count, seed
from sim2d.commands.spelled import spelled


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `fit-evidence` to an argparse parser's subparsers; `run_fit_evidence` runs it."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "fit-evidence",
        help="fit the verdict on a mirror camera's pose to rendered pictures and to ones without a field",
        description="Count what right and wrong poses look like in rendered pictures and in pictures without a field, "
        "and write the probabilities that the verdict on a mirror camera's pose goes by.",
    )
    add = parser.add_argument
    add("--field", default="ssl_2001", metavar="F", help="field with walls and lines (default: ssl_2001)")
    add("--camera", metavar="C", help="file of a mirror camera (default: that of Sekimori et al., 256 x 220)")
    add("--count", type=count, default=50, metavar="N", help="pictures of each set (default: 50)")
    add("--seed", type=seed, default=0, metavar="S", help="all depends on S alone (default: 0)")
    add("--odds", type=float, default=2.0, metavar="O", help="odds that a pose must have (default: 2)")
    add("out", metavar="OUT.toml", help="file to write")
    parser.set_defaults(run=run_fit_evidence)
    return parser


def run_fit_evidence(args: argparse.Namespace) -> int:
    """Fit and write; return the exit status."""
    import json
    import math

    from field_models import load_field
    from field_models.errors import ArgumentError
    from robocup_vision import load_camera
    from robocup_vision.camera import OmniCamera
    from robocup_vision.files.output_folder import require_folder
    from robocup_vision.files.text_files import write_lines
    from robocup_vision.localization.evidence import LINE_STATES, OUTLINE_STATES
    from robocup_vision.progress import progress
    from sim2d.rendering.cameras import sekimori_camera
    from sim2d.sensors.pose_evidence import SETS, clutter_names, draw_samples, fit_samples, picture_count

    if not 1.0 < args.odds < math.inf:
        raise ArgumentError(f"--odds must be above 1, got {args.odds:g}")
    field = load_field(args.field)
    camera = load_camera(args.camera) if args.camera else sekimori_camera()
    if not isinstance(camera, OmniCamera):
        raise ArgumentError(f"{args.camera} is no mirror camera")
    require_folder(args.out)
    total = picture_count(args.count)
    min_log_odds = math.log(args.odds)
    *_, samples = progress(draw_samples(field, camera, args.seed, args.count), total, "fit-evidence")
    fitted = fit_samples(samples, min_log_odds)
    sets = [f"rendered: {name}" for name in SETS] + [f"without a field: {name}" for name in clutter_names()]
    lines = [
        "# What a mirror camera's frames show of right and of wrong poses. Written by a command, never by hand.",
        "format = 1",
        f'command = "{spelled("fit-evidence", args, "OUT.toml")}"',
        f"sets = {json.dumps(sets)}",
        f"min_log_odds = {min_log_odds:.4f}             # against clutter, and against every other place",
        f"sure_log_odds = {fitted.sure_log_odds:.4f}            # by the outline alone",
    ]
    for name, states, cue in (
        ("outline", OUTLINE_STATES, fitted.outline),
        ("lines", LINE_STATES, fitted.lines),
    ):
        lines += [
            "",
            f"[{name}]",
            f"states = {json.dumps(states)}",
            f"correlation = {cue.correlation:.2f}       # samples that err alike",
            f"right = {_rows(cue.right.tolist())}       # in clear and in rough conditions",
            f"wrong = {_rows(cue.wrong.tolist())}       # the best of clutter, and wrong places",
        ]
    write_lines(args.out, lines)
    print(f"evidence of {total} pictures in {args.out}")
    return 0


def _rows(rows: list[list[float]]) -> str:
    return "[" + ", ".join("[" + ", ".join(f"{value:.6f}" for value in row) + "]" for row in rows) + "]"
