"""TCP connections whose messages are preceded by their size as a varint, as the league's game controller uses them."""

from __future__ import annotations

import select
import socket
import time
from typing import TypeVar

from field_models.errors import ArgumentError, PacketError
from robocup_vision.closing import Closing
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.sockets import error_words

#: timeout for connecting, for sending, and for an answer that must arrive
TIMEOUT_S = 5.0
# far more than any message of the league: a larger size means that the peer uses another protocol
MAX_FRAME_BYTES = 8 * 1024 * 1024
CHUNK_BYTES = 1 << 16

T = TypeVar("T")


def connect(name: str, host: str, port: int) -> socket.socket:
    """Return a connection that sends data without delay.

    Raises
    ------
    ArgumentError
        If the connection fails; the message contains `name`.
    """
    try:
        made = socket.create_connection((host, port), TIMEOUT_S)
    except (OSError, OverflowError) as error:
        raise ArgumentError(f"cannot reach {name} at {host}:{port}: {error_words(error)}") from None
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return made


class FramedClient(Closing):
    """Sends and receives values over a connection. Close it, or use it in a ``with`` statement.

    Parameters
    ----------
    name : str
        Name of the other side, for error messages.

    Raises
    ------
    ArgumentError
        If there is no connection.
    """

    def __init__(self, name: str, host: str, port: int) -> None:
        self._name = f"{name} at {host}:{port}"
        self._socket = connect(name, host, port)
        self._buffer = bytearray()

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def _send(self, value: object) -> None:
        data = encode(value)
        try:
            self._socket.sendall(varint(len(data)) + data)
        except OSError as error:
            raise ArgumentError(f"{self._name} is gone: {error_words(error)}") from None

    def _receive(self, kind: type[T], wait_s: float) -> T | None:
        """Return the next value, or None if none arrives in time."""
        end_s = time.monotonic() + wait_s
        while (frame := take_frame(self._buffer)) is None:
            ready, _, _ = select.select([self._socket], [], [], max(end_s - time.monotonic(), 0.0))
            if not ready:
                return None
            self._read()
        return decode(kind, frame)

    def _read(self) -> None:
        try:
            data = self._socket.recv(CHUNK_BYTES)
        except OSError as error:
            raise ArgumentError(f"{self._name} is gone: {error_words(error)}") from None
        if not data:
            raise ArgumentError(f"{self._name} has closed the connection")
        self._buffer += data


def varint(number: int) -> bytes:
    """Return a number of 0 or more as a varint: seven bits per byte, the lowest first."""
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)


def take_frame(buffer: bytearray, most_bytes: int = MAX_FRAME_BYTES) -> bytes | None:
    """Remove the first message from a buffer and return it; None while it is incomplete.

    Raises
    ------
    PacketError
        If its size is not a varint, or larger than allowed.
    """
    size = shift = 0
    for place, byte in enumerate(buffer[:5]):
        size |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            if size > most_bytes:
                raise PacketError(f"a message must have at most {most_bytes} bytes, announced are {size}")
            end = place + 1 + size
            if len(buffer) < end:
                return None
            frame = bytes(buffer[place + 1 : end])
            del buffer[:end]
            return frame
    if len(buffer) >= 5:
        raise PacketError("the size before a message is no varint of at most 5 bytes")
    return None
