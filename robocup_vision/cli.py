"""The command `robocup-vision`: finds the commands that are installed, parses, and runs one.

Only the handlers import what they need, so that --help answers at once.
"""

# shells that complete every Python program look for this word: PYTHON_ARGCOMPLETE_OK

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NoReturn

from robocup_vision.commands.completion import complete

# what a shell reports of a program that SIGPIPE has ended
_BROKEN_PIPE = 141


class _Parser(argparse.ArgumentParser):
    """Says in one line what is wrong with the arguments, and what was probably meant."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse, refusing options that this command has not: the command itself knows its own best."""
        self._given = list(sys.argv[1:] if args is None else args)
        parsed, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self._refuse(unknown)
        return parsed, unknown

    def error(self, message: str) -> NoReturn:
        if "arguments are required" in message:
            # a misspelt option is why nothing else was given
            unknown = [word for word in self._given if word.startswith("--") and not self._near(word)]
            if unknown:
                self._refuse(unknown)
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            hint = _did_you_mean(str(value), [str(choice) for choice in action.choices])
            if hint:
                raise argparse.ArgumentError(action, f"{value!r} is unknown{hint}")
        super()._check_value(action, value)

    def _options(self) -> list[str]:
        return [option for action in self._actions for option in action.option_strings]

    def _near(self, word: str) -> list[str]:
        """Return the options that a word stands for, which may be shortened."""
        return [option for option in self._options() if option.startswith(word.partition("=")[0])]

    def _refuse(self, unknown: list[str]) -> NoReturn:
        first = next((word for word in unknown if word.startswith("-")), unknown[0])
        hint = _did_you_mean(first.partition("=")[0], self._options())
        what = "option" if first.startswith("-") else "argument"
        self.exit(2, f"{self.prog}: unknown {what} {first}{hint} (see {self.prog} --help)\n")


def _did_you_mean(word: str, known: list[str]) -> str:
    # imported where used: --help loads nothing of the library
    from field_models.near_names import did_you_mean

    return did_you_mean(word, known)


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
        Exit status: 0, or 2 after one line on standard error about something the user can mend, or 130 if interrupted,
        or 141 if nobody reads the output any more.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # a file's name may be no text, and a terminal may not have all signs
            stream.reconfigure(errors="backslashreplace")
    try:
        return _run(arguments)
    except BrokenPipeError:
        # who read the output has read enough
        return _BROKEN_PIPE
    finally:
        _flush()


def _flush() -> None:
    """Write what waits of the output; where that fails, keep the interpreter from telling so at its end."""
    try:
        sys.stdout.flush()
    except OSError:
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(arguments: Sequence[str] | None) -> int:
    parser = command_parser()
    if "_ARGCOMPLETE" in os.environ:
        complete(parser)
    options = parser.parse_args(arguments)
    # decoders report a damaged file on standard error themselves; it is reported once, in our own line
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    from field_models.errors import RobocupVisionError

    try:
        status: int = options.run(options)
        sys.stdout.flush()
    except RobocupVisionError as error:
        print(f"robocup-vision {options.command}: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        raise
    except OSError as error:
        where = f"{error.filename}: " if error.filename else "output cannot be written: "
        print(f"robocup-vision {options.command}: {where}{error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as interrupt:
        from robocup_vision.progress import reached

        # a command that keeps what is finished says so; of others, how far they have come
        reached_text = str(interrupt) or reached()
        newline = "\n" if sys.stderr.isatty() else ""
        print(
            f"{newline}robocup-vision {options.command}: interrupted{': ' + reached_text if reached_text else ''}",
            file=sys.stderr,
        )
        return 130
    return status


def command_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands, each with its `run`."""
    from robocup_vision.commands import registered

    parser = _Parser(prog="robocup-vision", description="One camera frame in; a robot's pose, free floor and ball out.")
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for add_parser in registered():
        add_parser(subparsers)
    return parser


if __name__ == "__main__":
    sys.exit(main())
