"""Chooses one of several senders of the same kind of packets: the first one, until it has been silent.

There may be two game controllers in one network, one that was restarted, or a simulator's own referee beside one; a
team that took the newest packet of any would start and stop with each. Two vision systems would make robots jump.
"""

from __future__ import annotations

Source = tuple[str | None, tuple[str, int] | None]

# limits the memory needed for a flood of invented names
_MAX_SOURCES = 16
# time without a packet after which a sender counts as stopped; senders send at least ten packets per second
_SILENT_S = 1.0


class SourceChoice:
    """Follows one sender by its name and address.

    Parameters
    ----------
    kind : str
        Name of the kind of packets, for the problem's text.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._heard_s: dict[Source, float] = {}
        self._followed: Source | None = None

    @property
    def problem(self) -> str:
        """Text about other senders; empty if there are none."""
        others = sorted(_name(source) for source in self._heard_s if source != self._followed)
        if not others:
            return ""
        if self._followed is None:
            return f"several senders of {self._kind} speak, none is followed: {', '.join(others)}"
        return (
            f"another sender of {self._kind} is not followed: {', '.join(others)} (followed: {_name(self._followed)})"
        )

    def hear(self, source: Source, now_s: float) -> bool:
        """Register a packet of a sender; return whether it is the followed one.

        If the followed sender stops and several others send, none is followed.

        Parameters
        ----------
        source : (str or None, (str, int) or None)
            The sender's name in the packet, and its address.
        now_s : float
            Time of reception, by any steady clock.
        """
        self._forget_silent(now_s)
        if source in self._heard_s or len(self._heard_s) < _MAX_SOURCES:
            self._heard_s[source] = now_s
        if self._followed is None and list(self._heard_s) == [source]:
            self._followed = source
        return source == self._followed

    def is_silent(self, now_s: float) -> bool:
        """Return whether the followed sender has been silent, or none is followed."""
        self._forget_silent(now_s)
        return self._followed is None

    def _forget_silent(self, now_s: float) -> None:
        # an age is negative after the clock was set back, which counts as silence
        self._heard_s = {source: t for source, t in self._heard_s.items() if abs(now_s - t) <= _SILENT_S}
        if self._followed not in self._heard_s:
            self._followed = None


def _name(source: Source) -> str:
    identifier, address = source
    return " at ".join(filter(None, (identifier, f"{address[0]}:{address[1]}" if address else ""))) or "nameless"
