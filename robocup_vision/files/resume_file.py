"""Keeps the results of a long run in a file, so that an interrupted or killed run can be resumed."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from field_models.errors import FileError, PacketError
from robocup_vision.closing import Closing
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.files.value_codec import ValueCodec

_DAMAGED = "is damaged; begin anew without --resume"


class ResumeFile(Closing):
    """The result of each finished piece of a run as a line of JSON; the first line identifies the run.

    The file is made with its parent folders. With `resume` the run in the file is continued, if there is one: `found`
    then has the earlier results by the piece's number, without a last line that was cut off.

    Parameters
    ----------
    run : mapping of str to JSON values
        Everything that the results depend on.
    codec : ValueCodec, optional
        Converts results to JSON values and back; by default results must be JSON values.

    Raises
    ------
    FileError
        If the file is of another run, damaged, or cannot be written.
    """

    def __init__(self, path: Path, run: Mapping[str, Any], *, resume: bool, codec: ValueCodec | None = None) -> None:
        self.path, self._codec = path, codec
        run = json.loads(json.dumps(run))
        self.found: dict[int, Any] = self._read(run) if resume and path.exists() else {}
        with telling_write_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = path.open("w", encoding="utf-8")
        self._write(run)
        for index, value in self.found.items():
            self._write_piece(index, value)
        self._stream.flush()

    def _read(self, run: Mapping[str, Any]) -> dict[int, Any]:
        try:
            lines = self.path.read_bytes().split(b"\n")[:-1]
            before, *pieces = [json.loads(line) for line in lines]
            found = {int(index): value for index, value in pieces}
        except OSError as error:
            raise FileError(self.path, f"cannot be read ({error.strerror or error})") from None
        except (ValueError, TypeError):
            raise FileError(self.path, _DAMAGED) from None
        for key, value in run.items():
            there = before.get(key) if isinstance(before, dict) else None
            if there != value:
                raise FileError(
                    self.path, f"is of another run: {key} was {there!r}, is now {value!r}; begin anew without --resume"
                )
        if self._codec is None:
            return found
        try:
            return {index: self._codec.from_plain(value) for index, value in found.items()}
        except PacketError:
            raise FileError(self.path, _DAMAGED) from None

    def add(self, index: int, value: Any) -> None:
        """Write the result of a piece, so that it is kept even if this process ends."""
        self._write_piece(index, value)
        self._stream.flush()

    def _write_piece(self, index: int, value: Any) -> None:
        self._write([index, value if self._codec is None else self._codec.to_plain(value)])

    def _write(self, value: Any) -> None:
        with telling_write_errors(self.path):
            self._stream.write(json.dumps(value, allow_nan=False, default=_base64) + "\n")

    def close(self) -> None:
        """Close the file without deleting it."""
        self._stream.close()

    def delete(self) -> None:
        """Delete the file, after the run is finished."""
        self.close()
        self.path.unlink(missing_ok=True)


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode()
