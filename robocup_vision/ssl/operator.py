"""Replaces the person at the game controller's page: continues the match whenever the game controller waits.

The game controller's page uses JSON over a web socket (port 8081). It lists the actions by which the match can go on.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.closing import Closing
from robocup_vision.ssl.framed import TIMEOUT_S, connect
from robocup_vision.ssl.sockets import LOOPBACK

OPERATOR_PORT = 8081
# actions that are pressed as soon as they are offered
_PRESSED = frozenset({"ACCEPT_GOAL", "RESUME_FROM_HALT", "NEXT_STAGE", "END_GAME", "TIMEOUT_STOP"})
# actions that the game controller takes by itself, unless something prevents it: they are pressed after a while
_PRESSED_LATE = frozenset({"NEXT_COMMAND", "NORMAL_START", "FORCE_START"})
_NOT_OFFERED = frozenset({"DISABLED", "WAITING"})
_SOON_S, _LATE_S, _AGAIN_S = 1.0, 15.0, 2.0
# the page's messages have at most some hundred kilobytes
_MAX_BYTES = 16 * 1024 * 1024


class Operator(Closing):
    """Presses what a person at the game controller would press. Close it, or use it in a ``with`` statement.

    Parameters
    ----------
    division : str, optional
        ``DIV_A`` or ``DIV_B``, which is set at the beginning.

    Raises
    ------
    ArgumentError
        If there is no connection.
    RobocupVisionError
        If websockets is not installed.
    """

    def __init__(self, host: str = LOOPBACK, port: int = OPERATOR_PORT, division: str | None = None) -> None:
        try:
            from websockets.exceptions import ConnectionClosed, WebSocketException
            from websockets.sync import client
        except ImportError:
            raise RobocupVisionError(
                "the game controller's page needs websockets, which is not installed: pip install 'robocup-vision[ssl]'"
            ) from None
        self._name, self._closed = f"the game controller's page at {host}:{port}", ConnectionClosed
        self._opened = ExitStack()
        connected = connect("the game controller's page", host, port)
        uri = f"ws://{host}:{port}/api/control"
        try:
            opening = client.connect(
                uri, sock=connected, open_timeout=TIMEOUT_S, close_timeout=1.0, max_size=_MAX_BYTES
            )
            self._socket = self._opened.enter_context(opening)
        except (WebSocketException, OSError) as error:
            connected.close()
            raise ArgumentError(f"{self._name} refuses: {error}") from None
        self._division, self._is_set = division, False
        self._state: dict[str, Any] = {}
        self._actions: list[dict[str, Any]] = []
        self._wish: tuple[str, str] = ("", "")
        self._since_s = 0.0
        self.pressed: list[str] = []

    def close(self) -> None:
        """Close the connection."""
        self._opened.close()

    def look(self, now_s: float | None = None) -> None:
        """Read the game controller's messages, and press what is due; call it a few times per second.

        Parameters
        ----------
        now_s : float, optional
            Present time by any steady clock; default: this machine's.

        Raises
        ------
        ArgumentError
            If the connection is lost.
        """
        now_s = time.monotonic() if now_s is None else now_s
        for text in self._texts():
            message = json.loads(text)
            self._state = message.get("matchState") or self._state
            if message.get("gcState"):
                self._actions = message["gcState"].get("continueActions") or []
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
        """Set what the game controller needs before a match: its kind, the division, the teams' names."""
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
        # a match is ended as soon as possible, without overtime
        for action in sorted(self._actions, key=lambda action: action.get("type") != "END_GAME"):
            kind, is_offered = action.get("type", ""), action.get("state") not in _NOT_OFFERED
            wish = {"type": kind, "forTeam": action.get("forTeam", "UNKNOWN")}
            if kind == "ACCEPT_GOAL" and action.get("continuationIssues"):
                # probably not a goal
                continue
            if kind in _PRESSED and is_offered:
                return wish, _LATE_S if action.get("continuationIssues") else _SOON_S
            if kind in _PRESSED_LATE and is_offered:
                return wish, _LATE_S
        return {"type": "", "forTeam": ""}, 0.0

    def _send(self, value: object) -> None:
        with self._connection_loss():
            self._socket.send(json.dumps(value))

    def _texts(self) -> list[str | bytes]:
        """Return the messages that have arrived."""
        texts: list[str | bytes] = []
        end_s = time.monotonic() + 0.05
        with self._connection_loss(), suppress(TimeoutError):
            while time.monotonic() < end_s:
                texts.append(self._socket.recv(timeout=0))
        return texts

    @contextmanager
    def _connection_loss(self) -> Iterator[None]:
        try:
            yield
        except self._closed:
            raise ArgumentError(f"{self._name} has closed the connection") from None
