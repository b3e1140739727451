"""The command `robocup-vision`: parses, calls and prints, nothing else.

Only the handlers import what they need, so that --help answers at once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from robocup_vision.evaluation.run import Summary


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say in one line what is wrong with the arguments."""
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        print(f"robocup-vision {version('robocup-vision')}")
        parser.exit()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the command line unless given.

    Returns
    -------
    int
        Exit status: 0, or 2 after one line on standard error about something the user can mend, or 130 if interrupted.
    """
    options = _parser().parse_args(arguments)
    # decoders report a damaged file on standard error themselves; it is told once, in our own line
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    from field_models.errors import RobocupVisionError

    try:
        status: int = options.run(options)
    except RobocupVisionError as error:
        print(f"robocup-vision {options.command}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return status


def _parser() -> argparse.ArgumentParser:
    from robocup_vision.commands.calibrate import add_calibrate_parser
    from robocup_vision.commands.check import add_check_parser
    from robocup_vision.commands.landmark_map import add_map_parser, run_map
    from sim2d.commands.goal_evidence import add_goal_evidence_parser, run_goal_evidence
    from sim2d.commands.match import add_match_parser, add_tournament_parser, run_match_command, run_tournament
    from sim2d.commands.render import add_render_parser, run_render
    from sim2d.commands.render_goal import add_render_goal_parser, run_render_goal
    from sim2d.commands.render_hall import add_render_hall_parser, run_render_hall
    from sim2d.commands.sensors import add_sensors_parser, run_sensors

    parser = _Parser(prog="robocup-vision", description="One camera frame in; a robot's pose, free floor and ball out.")
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_evaluate_parser(commands)
    add_calibrate_parser(commands)
    add_check_parser(commands)
    for add, run in (
        (add_render_parser, run_render),
        (add_render_goal_parser, run_render_goal),
        (add_goal_evidence_parser, run_goal_evidence),
        (add_match_parser, run_match_command),
        (add_tournament_parser, run_tournament),
        (add_render_hall_parser, run_render_hall),
        (add_map_parser, run_map),
        (add_sensors_parser, run_sensors),
    ):
        add(commands).set_defaults(run=run)
    fields = commands.add_parser("fields", help="list the built-in fields")
    fields.set_defaults(run=_run_fields)
    return parser


def _add_evaluate_parser(commands: argparse._SubParsersAction[_Parser]) -> None:
    evaluate = commands.add_parser(
        "evaluate",
        help="score the localiser on a folder of images or a video",
        description="Score the localiser on a dataset folder, any folder of images, or a video, and write results.csv, "
        "summary.json, trajectory.tum and report.html.",
    )
    evaluate.add_argument("dataset", help="folder with a dataset.toml, folder of images, or video file")
    evaluate.add_argument("--field", metavar="F", help="built-in field or field file (needed without a dataset.toml)")
    evaluate.add_argument("--camera", metavar="C", help="camera file (needed without a dataset.toml)")
    evaluate.add_argument("--colors", metavar="K", help="colour file (default: learnt from the images)")
    evaluate.add_argument("--method", metavar="M", help="floor, hull, field, goal or landmarks (default: by camera)")
    evaluate.add_argument("--map", metavar="MAP", help="landmark map (.npz), for method landmarks")
    evaluate.add_argument("--out", metavar="DIR", help="folder for the files (default: out/NAME)")
    evaluate.add_argument("--jobs", metavar="N", type=int, default=1, help="number of processes (default: 1)")
    evaluate.set_defaults(run=_run_evaluate)


def _run_evaluate(options: argparse.Namespace) -> int:
    from robocup_vision.evaluation.dataset import load_dataset
    from robocup_vision.evaluation.run import evaluate

    dataset = load_dataset(
        options.dataset,
        field=options.field,
        camera=options.camera,
        colors=options.colors,
        method=options.method,
        landmark_map=options.map,
    )
    out = Path(options.out) if options.out is not None else Path("out") / dataset.name
    summary = evaluate(dataset, out, options.jobs)
    _print_summary(dataset.name, summary)
    if summary.problem is None:
        return 0
    print(f"robocup-vision evaluate: {summary.problem}", file=sys.stderr)
    return 2


def _print_summary(name: str, summary: Summary) -> None:
    from robocup_vision.evaluation.report import degrees, millimetres, percent

    figures = summary.figures
    ms = "-" if figures.median_ms is None else f"{figures.median_ms:.2f} ms"
    lines = [
        ("located", f"{figures.located}/{figures.images}"),
        ("within 5 cm / 3 deg", percent(figures.within_5cm_3deg)),
        ("within 10 cm / 5 deg", percent(figures.within_10cm_5deg)),
        ("median position error", millimetres(figures.median_error_m)),
        ("median heading error", degrees(figures.median_error_rad)),
        ("median time per frame", ms),
        ("report", str(summary.report if summary.report is not None else summary.out)),
    ]
    print(name)
    for label, value in lines:
        # the report's signs are not in every terminal's character set
        print(f"  {label:<22} {value.replace('°', ' deg').replace('–', '-')}")
    for note in summary.notes:
        print(f"note: {note}")


def _run_fields(_: argparse.Namespace) -> int:
    from field_models.catalog import field_names, load_field

    print(f"{'name':<18} {'length (m)':>10} {'width (m)':>10}  {'boundary':<8} goals")
    for name in field_names():
        field = load_field(name)
        goals = ", ".join(f"{goal.color} {goal.kind}" for goal in field.goals)
        print(f"{name:<18} {field.length_m:>10g} {field.width_m:>10g}  {field.boundary:<8} {goals}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
