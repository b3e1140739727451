"""Drives the league's game controller at a simulator's speed, through its port for continuous integration.

Each message follows its size as an unsigned varint. The game controller answers an input with any number of packets.
"""

from __future__ import annotations

import select
import socket
import time

from field_models.errors import ArgumentError, PacketError
from robocup_vision.closing import Closing
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.referee import CiInput, CiOutput, Referee

CI_PORT = 10009
# no packet of a game controller is nearly as large: whoever announces more is none
MAX_FRAME_BYTES = 8 * 1024 * 1024
_CHUNK_BYTES = 1 << 16


class CiClient(Closing):
    """A connection to a game controller. Close it, or use it in a ``with``.

    Parameters
    ----------
    host : str
        Name or IPv4 address of the machine it runs on.
    port : int
        Where it listens.
    timeout_s : float
        For the connection, and for what is sent.

    Raises
    ------
    ArgumentError
        If there is no connection.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = CI_PORT, timeout_s: float = 5.0) -> None:
        self._name = f"{host}:{port}"
        try:
            self._socket = socket.create_connection((host, port), timeout_s)
        except (OSError, OverflowError) as error:
            words = getattr(error, "strerror", None) or error
            raise ArgumentError(f"cannot reach a game controller at {self._name}: {words}") from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._buffer = bytearray()

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def exchange(self, value: CiInput, wait_s: float = 0.05) -> list[Referee]:
        """Send an input, wait for an answer at most so long, and return all packets that have come.

        Raises
        ------
        ArgumentError
            If the connection is lost.
        PacketError
            If what comes is no packet of a game controller, or larger than 8 MB.
        """
        data = encode(value)
        try:
            self._socket.sendall(varint(len(data)) + data)
        except OSError as error:
            raise ArgumentError(f"the game controller at {self._name} is gone: {error.strerror or error}") from None
        end_s = time.monotonic() + wait_s
        packets: list[Referee] = []
        while True:
            left_s = 0.0 if packets else max(end_s - time.monotonic(), 0.0)
            ready, _, _ = select.select([self._socket], [], [], left_s)
            if not ready:
                return packets
            self._receive()
            while (frame := take_frame(self._buffer)) is not None:
                referee = decode(CiOutput, frame).referee
                if referee is not None:
                    packets.append(referee)

    def _receive(self) -> None:
        try:
            data = self._socket.recv(_CHUNK_BYTES)
        except OSError as error:
            raise ArgumentError(f"the game controller at {self._name} is gone: {error.strerror or error}") from None
        if not data:
            raise ArgumentError(f"the game controller at {self._name} has closed the connection")
        self._buffer += data


def varint(number: int) -> bytes:
    """Return a number of 0 or more as a varint: seven bits a byte, the lowest first."""
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)


def take_frame(buffer: bytearray) -> bytes | None:
    """Take the first whole message off a buffer; None while it is not there yet.

    Raises
    ------
    PacketError
        If its size is no varint, or larger than 8 MB.
    """
    size = shift = 0
    for place, byte in enumerate(buffer[:5]):
        size |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            if size > MAX_FRAME_BYTES:
                raise PacketError(f"a message must have at most {MAX_FRAME_BYTES} bytes, announced are {size}")
            end = place + 1 + size
            if len(buffer) < end:
                return None
            frame = bytes(buffer[place + 1 : end])
            del buffer[:end]
            return frame
    if len(buffer) >= 5:
        raise PacketError("the size before a message is no varint of at most 5 bytes")
    return None
