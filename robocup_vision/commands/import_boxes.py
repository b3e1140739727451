"""`robocup-vision import-boxes`: makes boxes.csv from labels by another program."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

_FORMATS = {
    "yolo": ("YOLO's text files", "the folder of the text files"),
    "coco": ("COCO's JSON", "the JSON file"),
    "torso-21": ("TORSO-21's annotations.yaml", "the file, or the folder it lies in"),
}


def add_parser(subparsers: Any) -> None:
    """Add the command `import-boxes`."""
    parser = subparsers.add_parser("import-boxes", help="make boxes.csv of YOLO's, COCO's or TORSO-21's labels")
    formats = parser.add_subparsers(dest="format", required=True, metavar="FORMAT")
    for name, (text, source) in _FORMATS.items():
        one = formats.add_parser(
            name, help=text, description=f"Make boxes.csv, which `evaluate` scores balls and obstacles by, of {text}."
        )
        one.add_argument("source", metavar="LABELS", help=source)
        if name == "yolo":
            one.add_argument("--images", required=True, metavar="DIR", help="folder of the images")
            one.add_argument("--names", metavar="FILE", help="names of the classes, one a line (default: classes.txt)")
        one.add_argument("--out", default="boxes.csv", metavar="FILE", help="file to write (default: boxes.csv)")
        one.set_defaults(run=run_import_boxes, format=name)


def run_import_boxes(args: argparse.Namespace) -> int:
    """Write boxes.csv; return 0."""
    from collections import Counter

    from robocup_vision.evaluation.box_import import READERS
    from robocup_vision.evaluation.boxes import save_boxes

    named = {"images": args.images, "names": args.names} if args.format == "yolo" else {}
    imported = READERS[args.format](args.source, **named)
    save_boxes(Path(args.out), imported.boxes)
    kinds = Counter(box.kind for boxes in imported.boxes.values() for box in boxes)
    counts = ", ".join(f"{number} {kind}" for kind, number in kinds.most_common())
    print(f"{args.out}: {kinds.total()} boxes in {len(imported.boxes)} images{': ' + counts if counts else ''}")
    if imported.left_out:
        print(f"{imported.left_out} labels are no boxes (points, outlines) and are left out")
    return 0
