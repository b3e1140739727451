"""The command `robocup-vision`: finds the commands that are installed, parses, and runs one.

Only the handlers import what they need, so that --help answers at once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import NoReturn


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Print in one line what is wrong with the arguments."""
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
    # decoders report a damaged file on standard error themselves; it is reported once, in our own line
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    from field_models.errors import RobocupVisionError

    try:
        status: int = options.run(options)
    except RobocupVisionError as error:
        print(f"robocup-vision {options.command}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as interrupt:
        from robocup_vision.progress import reached

        # a command that keeps what is finished says so; of others, how far they have come
        told = str(interrupt) or reached()
        newline = "\n" if sys.stderr.isatty() else ""
        print(f"{newline}robocup-vision {options.command}: interrupted{': ' + told if told else ''}", file=sys.stderr)
        return 130
    return status


def _parser() -> argparse.ArgumentParser:
    from robocup_vision.commands import registered

    parser = _Parser(prog="robocup-vision", description="One camera frame in; a robot's pose, free floor and ball out.")
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for add_parser in registered():
        add_parser(subparsers)
    return parser


if __name__ == "__main__":
    sys.exit(main())
