"""The program `robocup-vision`: finds the installed commands, parses the arguments, and runs one command.

Imports are made by the handlers only, so that --help answers at once.
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

# exit status that a shell reports for a program ended by SIGPIPE
_BROKEN_PIPE = 141


class _Parser(argparse.ArgumentParser):
    """Reports wrong arguments in one line, with a suggestion of what was probably meant."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse, and refuse unknown options here, where the command's own options are known for suggestions."""
        self._given = list(sys.argv[1:] if args is None else args)
        parsed, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self._refuse(unknown)
        return parsed, unknown

    def error(self, message: str) -> NoReturn:
        if "arguments are required" in message:
            # a misspelt option may be why an argument is missing
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
        """Return the options that a word may abbreviate."""
        return [option for option in self._options() if option.startswith(word.partition("=")[0])]

    def _refuse(self, unknown: list[str]) -> NoReturn:
        first = next((word for word in unknown if word.startswith("-")), unknown[0])
        hint = _did_you_mean(first.partition("=")[0], self._options())
        what = "option" if first.startswith("-") else "argument"
        self.exit(2, f"{self.prog}: unknown {what} {first}{hint} (see {self.prog} --help)\n")


def _did_you_mean(word: str, known: list[str]) -> str:
    # imported here, so that --help does not load the library
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
        Default: those of the command line.

    Returns
    -------
    int
        Exit status: usually 0; 2 after one line on standard error about a problem that the user can solve; 130 if
        interrupted; 141 if the output is no longer read.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # a file name may not be valid text, and a terminal may not have all characters
            stream.reconfigure(errors="backslashreplace")
    try:
        return _run(arguments)
    except BrokenPipeError:
        # the reader of the output has closed it
        return _BROKEN_PIPE
    finally:
        _flush()


def _flush() -> None:
    """Write the buffered output; if that fails, keep the interpreter from reporting it again at its end."""
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
    # decoders print their own messages about damaged files, which are reported in our own line
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

        # a command may say what it has kept; for others, the progress is shown
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
