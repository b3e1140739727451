"""Common options of camera calibrations, and the file that keeps the finished part of an interrupted one."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from robocup_vision.commands.options import add_worker_options, chosen_workers, count

if TYPE_CHECKING:
    from robocup_vision.calibration.starts import StartTrials


def add_calibration_options(parser: argparse.ArgumentParser, out_help: str) -> None:
    """Add images, field, output file, start, number of images and workers to a calibration's parser."""
    add = parser.add_argument
    add("images", nargs="+", metavar="IMAGES", help="image files, or folders of images")
    add("--field", required=True, metavar="F", help="built-in field's name, or a field file (.toml)")
    add("--out", required=True, metavar="CAMERA", help=out_help)
    add("--start", metavar="CAMERA", help="camera file to start from (default: from nothing)")
    add("--frames", type=count, default=24, metavar="N", help="use at most N images, evenly spread (default: 24)")
    add_worker_options(parser)
    add("--resume", action="store_true", help="go on with an interrupted calibration of the same images and options")


@contextmanager
def start_trials(args: argparse.Namespace, paths: list[Path]) -> Iterator[StartTrials]:
    """Yield the trials of a calibration's starts; if the block is interrupted or fails, finished ones are kept.

    Raises
    ------
    FileError
        If the file belongs to other images or options, is damaged, or cannot be written.
    KeyboardInterrupt
        If the block is interrupted, with a message that says how much is finished.
    """
    from field_models.errors import RobocupVisionError
    from robocup_vision.calibration.starts import FIT_CODEC, StartTrials
    from robocup_vision.files.resume_file import ResumeFile

    workers = chosen_workers(args)
    out = Path(args.out)
    unfinished = out.with_name(f"{out.stem}.unfinished.jsonl")
    with ResumeFile(unfinished, _run_json(args, paths), resume=args.resume, codec=FIT_CODEC) as kept:
        trials = StartTrials(workers, kept)
        stays = False
        try:
            yield trials
        except (KeyboardInterrupt, RobocupVisionError) as error:
            stays = trials.done > 0
            if not stays or isinstance(error, RobocupVisionError):
                raise
            progress_text = f"{trials.done} starts are finished and kept in {kept.path}; --resume goes on"
            raise KeyboardInterrupt(progress_text) from None
        finally:
            if not stays:
                kept.delete()


def _run_json(args: argparse.Namespace, paths: list[Path]) -> dict[str, object]:
    """Return everything that the starts depend on, with the present state of files."""
    from hashlib import sha256

    from robocup_vision import __version__

    def files(paths: list[Path]) -> str:
        stats = [(path.name, path.stat().st_size, path.stat().st_mtime_ns) for path in paths]
        return sha256(repr(stats).encode()).hexdigest()[:12]

    values: dict[str, object] = {"format": 3, "version": __version__, "images": files(paths), "frames": args.frames}
    for option in ("field", "start", "mask", "poses"):
        value = getattr(args, option, None)
        values[option] = files([Path(value)]) if value is not None and Path(value).is_file() else value
    return values
