"""The simulator's TCP ports: synchronous steps as in the league's draft, one request and answer at a time.

Each message is preceded by its size as a varint. A client that sends invalid data, or does not read, is disconnected.
"""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterable

from field_models.errors import ArgumentError, PacketError
from robocup_vision.closing import Closing
from robocup_vision.ssl.framed import CHUNK_BYTES, take_frame, varint
from robocup_vision.ssl.sockets import error_words
from robocup_vision.ssl.values.simulation import Team

# largest number of connections; two teams and a referee need three
_MAX_CONNECTIONS = 8
_SEND_S = 0.2

Answer = Callable[[Team | None, bytes], bytes]


class SyncServer(Closing):
    """Listens at the ports of control and robots, and answers at most eight connections.

    Parameters
    ----------
    ports : dict of int to (Team or None)
        Team of each port; None: the port for simulation control.
    most_bytes : int
        Largest size of a request.
    """

    def __init__(self, addresses: Iterable[str], ports: dict[int, Team | None], most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._listening: dict[socket.socket, Team | None] = {}
        self._connected: dict[socket.socket, tuple[Team | None, bytearray]] = {}
        for address in addresses:
            for port, team in ports.items():
                made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
                self._listening[made] = team
                made.setblocking(False)
                made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                try:
                    made.bind((address, port))
                    made.listen(_MAX_CONNECTIONS)
                except (OSError, OverflowError) as error:
                    self.close()
                    raise ArgumentError(f"cannot listen on {address}:{port}: {error_words(error)}") from None

    @property
    def sockets(self) -> tuple[socket.socket, ...]:
        """Sockets to wait for."""
        return (*self._listening, *self._connected)

    def close(self) -> None:
        """Close all connections."""
        for opened in self.sockets:
            opened.close()
        self._listening, self._connected = {}, {}

    def serve(self, ready: socket.socket, answer: Answer) -> None:
        """Handle a ready socket of `sockets`: accept a connection, or read data and answer the complete requests."""
        if ready in self._listening:
            self._accept(ready)
            return
        team, buffer = self._connected[ready]
        try:
            data = ready.recv(CHUNK_BYTES)
            if not data:
                self._drop(ready)
                return
            buffer += data
            # there is more than one only if the client does not wait for answers
            while (frame := take_frame(buffer, self._most_bytes)) is not None:
                reply = answer(team, frame)
                ready.sendall(varint(len(reply)) + reply)
        except BlockingIOError:
            return
        except (OSError, PacketError):
            self._drop(ready)

    def _accept(self, listening: socket.socket) -> None:
        try:
            made, _ = listening.accept()
        except OSError:
            return
        if len(self._connected) >= _MAX_CONNECTIONS:
            made.close()
            return
        made.settimeout(_SEND_S)
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connected[made] = self._listening[listening], bytearray()

    def _drop(self, connected: socket.socket) -> None:
        connected.close()
        del self._connected[connected]
