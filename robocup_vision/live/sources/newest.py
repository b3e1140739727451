"""The newest of what comes by itself, handed from the thread that receives it to the one that looks at it."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class Newest(Generic[T]):
    """Holds one value: a newer one takes its place, and it is taken once. Safe to use from several threads."""

    def __init__(self) -> None:
        self._news = threading.Condition()
        self._value: T | None = None
        self._is_closed = False

    @property
    def is_closed(self) -> bool:
        """Whether nothing is to come any more."""
        return self._is_closed

    def put(self, value: T) -> None:
        """Put a value in the place of the one that waits, if one does."""
        with self._news:
            self._value = value
            self._news.notify_all()

    def take(self, timeout_s: float) -> T | None:
        """Return the value that waits, or the first that comes in time; None if none does, or it is closed."""
        with self._news:
            self._news.wait_for(lambda: self._value is not None or self._is_closed, timeout_s)
            value, self._value = self._value, None
            return None if self._is_closed else value

    def wait_until_closed(self, timeout_s: float) -> None:
        """Wait, but no longer than until it is closed."""
        with self._news:
            self._news.wait_for(lambda: self._is_closed, timeout_s)

    def close(self) -> None:
        """Let nobody wait any more."""
        with self._news:
            self._is_closed = True
            self._news.notify_all()
