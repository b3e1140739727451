"""Common base of the clients for the league's datagrams: each receives messages of one kind over its socket.

Bad datagrams are counted and skipped, because any program can send to the socket.
"""

from __future__ import annotations

import socket
import time
from typing import Any, Generic, TypeVar

from field_models.errors import PacketError
from robocup_vision.closing import Closing
from robocup_vision.ssl.protocol.mapping import decode
from robocup_vision.ssl.sockets import Address, await_datagram, take_newest, wait_for_datagram

T = TypeVar("T")
R = TypeVar("R")


class DatagramClient(Closing, Generic[T]):
    """Receives the messages sent to a socket. Close it, or use it in a ``with`` statement.

    Parameters
    ----------
    value : type
        Type of the messages.

    Attributes
    ----------
    bad_datagrams : int
        Number of datagrams that were not such messages.
    last_problem : str
        Problem of the last of those; empty if there were none.
    skipped : int
        Number of datagrams that `receive_newest` skipped in favour of newer ones.
    """

    def __init__(self, value: type[T], opened: socket.socket) -> None:
        self._value, self._socket = value, opened
        self.bad_datagrams = 0
        self.last_problem = ""
        self.skipped = 0

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def fileno(self) -> int:
        """Return the socket's file descriptor, so that `select.select` accepts the client itself."""
        return self._socket.fileno()

    def receive(self, timeout_s: float | None = None) -> T | None:
        """Return the next message, or None after the timeout (None: no timeout)."""
        return self._receive(self._value, timeout_s)

    async def receive_async(self, timeout_s: float | None = None) -> T | None:
        """As `receive`, for asyncio."""
        deadline_s = None if timeout_s is None else time.monotonic() + timeout_s
        while (datagram := await await_datagram(self._socket, deadline_s)) is not None:
            message = self._take(self._value, *datagram)
            if message is not None:
                return message
        return None

    def receive_newest(self, most: int = 1000) -> list[T]:
        """Return the received messages without waiting, from at most the newest `most` datagrams.

        The default is enough for every command of a referee that was not read for some seconds.
        """
        waiting, skipped = take_newest(self._socket, most)
        self.skipped += skipped
        messages = [self._take(self._value, *datagram) for datagram in waiting]
        return [message for message in messages if message is not None]

    def _receive(self, kind: type[R], timeout_s: float | None) -> R | None:
        deadline_s = None if timeout_s is None else time.monotonic() + timeout_s
        while (datagram := wait_for_datagram(self._socket, deadline_s)) is not None:
            message = self._take(kind, *datagram)
            if message is not None:
                return message
        return None

    def _take(self, kind: type[R], data: bytes, sender: Address) -> R | None:
        try:
            message = decode(kind, data)
        except PacketError as error:
            self.bad_datagrams += 1
            self.last_problem = str(error)
            return None
        return message if self._keep(message, sender) else None

    def _keep(self, message: Any, sender: Address) -> bool:
        """Store what a subclass needs of a message; return whether the message is passed to the user."""
        return True
