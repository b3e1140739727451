"""Drives the league's game controller at a simulator's speed, through its port for continuous integration.

Each message follows its size as an unsigned varint. The game controller answers an input with any number of packets.
"""

from __future__ import annotations

import time

from robocup_vision.closing import Closing
from robocup_vision.ssl.framed import Framed, connect
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.referee import CiInput, CiOutput, Referee

CI_PORT = 10009


class CiClient(Closing):
    """A connection to a game controller. Close it, or use it in a ``with``.

    Parameters
    ----------
    timeout_s : float
        For the connection, and for what is sent.

    Raises
    ------
    ArgumentError
        If there is no connection.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = CI_PORT, timeout_s: float = 5.0) -> None:
        name = "a game controller"
        self._connection = Framed(f"the game controller at {host}:{port}", connect(name, host, port, timeout_s))

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def exchange(self, value: CiInput, wait_s: float = 1.0) -> list[Referee]:
        """Send an input, wait for an answer at most so long, and return all packets that have come.

        A game controller answers each input within milliseconds. One that hears of the next moment before it has done
        with this one may give the command that is due twice, and ends.

        Raises
        ------
        ArgumentError
            If the connection is lost.
        PacketError
            If what comes is no packet of a game controller, or larger than 8 MB.
        """
        self._connection.send(encode(value))
        end_s = time.monotonic() + wait_s
        packets: list[Referee] = []
        while True:
            frame = self._connection.receive(0.0 if packets else max(end_s - time.monotonic(), 0.0))
            if frame is None:
                return packets
            referee = decode(CiOutput, frame).referee
            if referee is not None:
                packets.append(referee)
