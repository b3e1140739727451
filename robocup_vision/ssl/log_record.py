"""Records the multicast packets of the league's programs as received: vision, trackers and the referee."""

from __future__ import annotations

import select
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

from field_models.errors import FileError
from robocup_vision.ssl.log import LogEntry, LogKind, SslLogWriter
from robocup_vision.ssl.sockets import (
    REFEREE_GROUP,
    TRACKER_GROUP,
    VISION_GROUP,
    multicast_receiver,
    take_newest,
)

_WAIT_S = 0.2


def record_log(
    path: str | Path,
    goes_on: Callable[[dict[str, int]], bool],
    *,
    interface: str = "loopback",
    vision_ports: Sequence[int],
    tracker_port: int,
    referee_port: int,
    replaces: bool = False,
) -> dict[str, int]:
    """Write received packets into a log until `goes_on` returns false.

    Parameters
    ----------
    path : str or Path
        The log; it is compressed if its name ends in ``gz``.
    goes_on : callable
        Called a few times per second with the number of entries of each kind so far; false ends the recording.
    replaces : bool
        Whether an existing file is replaced.

    Returns
    -------
    dict of str to int
        Number of entries of each kind.

    Raises
    ------
    FileError
        If the file exists already or cannot be written.
    ArgumentError
        If the interface or a port is not available.
    """
    if Path(path).exists() and not replaces:
        raise FileError(path, "is there already (use --force to replace it)")
    sources = [(VISION_GROUP, port, LogKind.VISION) for port in vision_ports]
    sources += [(TRACKER_GROUP, tracker_port, LogKind.TRACKER), (REFEREE_GROUP, referee_port, LogKind.REFEREE)]
    counts = {kind.name.lower(): 0 for _, _, kind in sources}
    with ExitStack() as opened:
        kinds = {
            opened.enter_context(multicast_receiver(group, port, interface)): kind for group, port, kind in sources
        }
        log = opened.enter_context(SslLogWriter(path))
        while goes_on(counts):
            ready, _, _ = select.select(list(kinds), [], [], _WAIT_S)
            received_ns = time.time_ns()
            for listening in ready:
                kind = kinds[listening]
                for data, _ in take_newest(listening)[0]:
                    log.write(LogEntry(received_ns, kind, data))
                    counts[kind.name.lower()] += 1
    return counts
