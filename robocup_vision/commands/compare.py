"""`robocup-vision compare`: its options and its handler."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

_NAME = "comparison.html"


def add_parser(subparsers: Any) -> None:
    """Add the command `compare`."""
    compare = subparsers.add_parser(
        "compare",
        help="compare two evaluations of the same images",
        description="Compare two folders that `evaluate` has written: their figures side by side, and the images that "
        "one located and the other refused or put in a wrong place. Writes comparison.html.",
    )
    compare.add_argument("first", metavar="A", help="folder of an evaluation")
    compare.add_argument("second", metavar="B", help="folder of the evaluation to compare with it")
    compare.add_argument("--images", metavar="DIR", help="folder of the images: the page shows those that changed")
    compare.add_argument(
        "--out", metavar="DIR", default="out/comparison", help="folder for comparison.html (default: out/comparison)"
    )
    compare.add_argument("--force", action="store_true", help="write into a folder that holds other files, too")
    compare.set_defaults(run=run_compare)


def run_compare(options: argparse.Namespace) -> int:
    """Compare two evaluations; return 0."""
    from field_models.errors import ArgumentError
    from robocup_vision.evaluation.comparison import compare, figure_rows, load_evaluation, render_comparison
    from robocup_vision.evaluation.report import missing_packages
    from robocup_vision.files.image_folder import picture_folder
    from robocup_vision.files.output_folder import refuse_foreign_files, telling_write_errors
    from robocup_vision.files.text_files import write_text

    missing = missing_packages()
    if missing:
        raise ArgumentError(f"{' and '.join(missing)} not installed (pip install 'robocup-vision[report]')")
    out = Path(options.out)
    if not options.force:
        refuse_foreign_files(out, (_NAME,))
    compared = compare(load_evaluation(options.first), load_evaluation(options.second))
    pictures = None if options.images is None else picture_folder(Path(options.images))
    page = render_comparison(compared, pictures)
    with telling_write_errors(out):
        out.mkdir(parents=True, exist_ok=True)
    write_text(out / _NAME, page)
    rows = figure_rows(compared)
    widths = [max(24, *(len(cell) for cell in column)) for column in zip(*rows, strict=True)]
    for label, *cells in (("", compared.first.name, compared.second.name, "difference"), *rows):
        line = "  ".join([f"{label:<{widths[0]}}", *(f"{cell:>18}" for cell in cells)])
        # not every terminal can show the report's special characters
        print(line.replace("°", " deg").replace("–", "-").replace("−", "-").rstrip())
    for change in compared.changes:
        print(f"{change.image}: {change.before.outcome} -> {change.after.outcome}")
    for name, count in zip((options.first, options.second), compared.left_alone, strict=True):
        if count:
            print(f"note: {count} images are in {name} alone")
    print(f"report: {out / _NAME}")
    return 0
