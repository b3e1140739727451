"""The entries of a log that can be read: others are counted, with the place of the first, and hold up nobody."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from field_models.errors import FileError, PacketError
from robocup_vision.ssl.log import LogEntry, LogValue


@dataclass(slots=True)
class Unreadable:
    """What of a log could not be read.

    Parameters
    ----------
    count : int
        Entries that are not of their kind.
    first : str
        Which is the first of them, and what is wrong with it; empty if none is.
    damage : str
        Why the file could not be read to its end; empty if it could.
    """

    count: int = 0
    first: str = ""
    damage: str = ""


def readable(log: Iterable[LogEntry], unreadable: Unreadable) -> Iterator[tuple[int, LogEntry, LogValue | None]]:
    """Yield the number of each entry in the log, the entry, and its message; note the others.

    Of an entry that is not of its kind the message is None, as of a blank one.
    """
    try:
        for number, entry in enumerate(log):
            value = None
            try:
                value = entry.value
            except PacketError as error:
                unreadable.count += 1
                unreadable.first = unreadable.first or f"entry {number}: {error}"
            yield number, entry, value
    except FileError as error:
        unreadable.damage = str(error)
