"""Who sits at the game controller's keyboard, as a program: it goes on where the game controller waits for a person.

The game controller's page speaks JSON over a web socket (port 8081). It lists what can be done next; the rest, kicks
and placements, it does by itself.
"""

from __future__ import annotations

import base64
import json
import os
import select
import struct
import time
from typing import Any

from field_models.errors import ArgumentError
from robocup_vision.closing import Closing
from robocup_vision.ssl.framed import connect

OPERATOR_PORT = 8081
# what a person would press, as soon as it is offered
_PRESSED = frozenset({"ACCEPT_GOAL", "RESUME_FROM_HALT", "NEXT_STAGE", "END_GAME", "TIMEOUT_STOP"})
# what the game controller does by itself unless something is in the way: a person presses it after a while
_PRESSED_AT_LAST = frozenset({"NEXT_COMMAND", "NORMAL_START", "FORCE_START"})
_NOT_OFFERED = frozenset({"DISABLED", "WAITING"})
_SOON_S, _AT_LAST_S, _AGAIN_S = 1.0, 15.0, 2.0
# the page's messages are of some hundred kilobytes at most
_MAX_BYTES = 16 * 1024 * 1024
_TEXT, _CLOSE, _PING, _PONG = 1, 8, 9, 10


class Operator(Closing):
    """Presses what a person at the game controller would press. Close it, or use it in a ``with``.

    Parameters
    ----------
    division : str, optional
        ``DIV_A`` or ``DIV_B``: set at the beginning.

    Raises
    ------
    ArgumentError
        If there is no connection.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = OPERATOR_PORT, division: str | None = None) -> None:
        self._name = f"the game controller's page at {host}:{port}"
        self._socket = connect("the game controller's page", host, port, 5.0)
        self._buffer = bytearray()
        self._begin(host, port)
        self._division, self._is_set = division, False
        self._state: dict[str, Any] = {}
        self._actions: list[dict[str, Any]] = []
        self._wish: tuple[str, str] = ("", "")
        self._since_s = 0.0
        self.pressed: list[str] = []

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def look(self, now_s: float | None = None) -> None:
        """Read what the game controller tells, and press what is due; call it some times a second.

        Parameters
        ----------
        now_s : float, optional
            Now, by any clock that goes on; default: this machine's.

        Raises
        ------
        ArgumentError
            If the connection is lost.
        """
        now_s = time.monotonic() if now_s is None else now_s
        for text in self._texts():
            told = json.loads(text)
            self._state = told.get("matchState") or self._state
            if told.get("gcState"):
                self._actions = told["gcState"].get("continueActions") or []
        if self._state and not self._is_set:
            self._set_match()
        wish, wait_s = self._wanted()
        if (wish["type"], wish["forTeam"]) != self._wish or now_s < self._since_s:
            self._wish, self._since_s = (wish["type"], wish["forTeam"]), now_s
        elif wish["type"] and now_s - self._since_s >= wait_s:
            self._send({"continueAction": wish})
            self.pressed.append(wish["type"])
            self._since_s = now_s + _AGAIN_S

    def _set_match(self) -> None:
        """Set what the game controller wants to know before a match: its kind, the division, the teams' names."""
        self._is_set = True
        match: dict[str, str] = {}
        if self._state.get("matchType") in (None, "UNKNOWN_MATCH"):
            match["matchType"] = "FRIENDLY"
        if self._division is not None:
            match["division"] = self._division
        if match:
            self._send({"change": {"updateConfigChange": match}})
        for team, info in (self._state.get("teamState") or {}).items():
            if info.get("name") in (None, "", "Unknown"):
                self._send({"change": {"updateTeamStateChange": {"forTeam": team, "teamName": team.capitalize()}}})

    def _wanted(self) -> tuple[dict[str, str], float]:
        # where a match can end, it ends, instead of going on into overtime
        for action in sorted(self._actions, key=lambda action: action.get("type") != "END_GAME"):
            kind, is_offered = action.get("type", ""), action.get("state") not in _NOT_OFFERED
            wish = {"type": kind, "forTeam": action.get("forTeam", "UNKNOWN")}
            if kind == "ACCEPT_GOAL" and action.get("continuationIssues"):
                # it was none
                continue
            if kind in _PRESSED and is_offered:
                return wish, _AT_LAST_S if action.get("continuationIssues") else _SOON_S
            if kind in _PRESSED_AT_LAST and is_offered:
                return wish, _AT_LAST_S
        return {"type": "", "forTeam": ""}, 0.0

    # a web socket's client: RFC 6455, as much of it as text takes

    def _begin(self, host: str, port: int) -> None:
        key = base64.b64encode(os.urandom(16)).decode()
        request = (
            f"GET /api/control HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )
        try:
            self._socket.sendall(request.encode())
            while b"\r\n\r\n" not in self._buffer:
                data = self._socket.recv(4096)
                if not data or len(self._buffer) > _MAX_BYTES:
                    raise ArgumentError(f"{self._name} does not speak")
                self._buffer += data
        except OSError as error:
            raise ArgumentError(f"{self._name} is gone: {error.strerror or error}") from None
        head, _, rest = bytes(self._buffer).partition(b"\r\n\r\n")
        if not head.startswith(b"HTTP/1.1 101"):
            raise ArgumentError(f"{self._name} refuses: {head[:60].decode(errors='replace')}")
        self._buffer = bytearray(rest)

    def _send(self, value: object, kind: int = _TEXT) -> None:
        data = value if isinstance(value, bytes) else json.dumps(value).encode()
        mask = os.urandom(4)
        size = len(data)
        head = bytes([0x80 | kind, 0x80 | (size if size < 126 else 126)])
        if size >= 126:
            head += struct.pack(">H", size)
        try:
            self._socket.sendall(head + mask + bytes(byte ^ mask[k % 4] for k, byte in enumerate(data)))
        except OSError as error:
            raise ArgumentError(f"{self._name} is gone: {error.strerror or error}") from None

    def _texts(self) -> list[bytes]:
        """Return the whole texts that have come."""
        texts, end_s = [], time.monotonic() + 0.05
        while time.monotonic() < end_s and select.select([self._socket], [], [], 0.0)[0]:
            try:
                data = self._socket.recv(1 << 16)
            except OSError as error:
                raise ArgumentError(f"{self._name} is gone: {error.strerror or error}") from None
            if not data:
                raise ArgumentError(f"{self._name} has closed the connection")
            self._buffer += data
            while (frame := _take(self._buffer)) is not None:
                kind, payload = frame
                if kind == _PING:
                    self._send(payload[:125], _PONG)
                elif kind == _CLOSE:
                    raise ArgumentError(f"{self._name} has closed the connection")
                elif kind == _TEXT:
                    texts.append(payload)
        return texts


def _take(buffer: bytearray) -> tuple[int, bytes] | None:
    """Take the first whole frame off a buffer: its kind and its payload; None while it is not there yet."""
    if len(buffer) < 2:
        return None
    size, at = buffer[1] & 0x7F, 2
    if size == 126:
        size, at = int.from_bytes(buffer[2:4], "big"), 4
    elif size == 127:
        size, at = int.from_bytes(buffer[2:10], "big"), 10
    if size > _MAX_BYTES:
        raise ArgumentError(f"the game controller's page sends {size} bytes at once")
    if len(buffer) < at + size:
        return None
    kind, payload = buffer[0] & 0x0F, bytes(buffer[at : at + size])
    del buffer[: at + size]
    return kind, payload
