"""The options that every camera calibration takes. Apart from options.py, which loads more than --help may wait for."""

from __future__ import annotations

import argparse


def add_calibration_options(parser: argparse.ArgumentParser, out_help: str) -> None:
    """Add images, field, the file to write, a start and how many images to a calibration's parser."""
    add = parser.add_argument
    add("images", nargs="+", metavar="IMAGES", help="image files, or folders of images")
    add("--field", required=True, metavar="F", help="built-in field's name, or a field file (.toml)")
    add("--out", required=True, metavar="CAMERA", help=out_help)
    add("--start", metavar="CAMERA", help="camera file to start from (default: from nothing)")
    add("--frames", type=int, default=24, metavar="N", help="use at most N images, evenly spread (default: 24)")
