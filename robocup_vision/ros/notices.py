"""What a user of the node must be told: in the diagnostics while it lasts, and once in the log."""

from __future__ import annotations

import re

_NUMBERS = re.compile(r"\d[\d.e+-]*")


class Notices:
    """What is wrong now, and what has happened. Texts that differ in numbers alone are one in the log."""

    def __init__(self) -> None:
        self._lasting: dict[str, str] = {}
        self._happened: dict[str, str] = {}
        self._told: set[str] = set()
        self._news: list[str] = []

    def __contains__(self, about: str) -> bool:
        return about in self._lasting

    def hold(self, about: str, text: str) -> None:
        """Say what is wrong with something, until it is cleared."""
        self._lasting[about] = text
        self._tell(text)

    def clear(self, about: str) -> None:
        """Say that something is right, or right again."""
        self._lasting.pop(about, None)

    def note(self, text: str) -> None:
        """Say what has happened; the next diagnostics tell it."""
        self._happened[_kind(text)] = text
        self._tell(text)

    def take(self) -> list[str]:
        """Return what is wrong, and what has happened since the last call."""
        texts = [*self._lasting.values(), *self._happened.values()]
        self._happened.clear()
        return texts

    def take_news(self) -> list[str]:
        """Return what is to be logged: what has not been told before."""
        news, self._news = self._news, []
        return news

    def _tell(self, text: str) -> None:
        if _kind(text) not in self._told:
            self._told.add(_kind(text))
            self._news.append(text)


def _kind(text: str) -> str:
    return _NUMBERS.sub("#", text)
