"""Which of several senders of one thing is followed: the first that speaks, until it has been silent.

Two game controllers on one network, one that was started anew, or a simulator's own referee beside one: a team that
took the newest packet of any of them would start and stop with each. Two vision systems that each have a camera 0 show
robots now here, now there.
"""

from __future__ import annotations

Source = tuple[str | None, tuple[str, int] | None]

# a flood of made-up names must not fill the memory
_MAX_SOURCES = 16
# whoever has not spoken for so long does not run any more; they speak ten times a second or more often
_SILENT_S = 1.0


class SourceChoice:
    """Follows one sender by its name and address.

    Parameters
    ----------
    kind : str
        What they are, as the problem's words call them.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._heard_s: dict[Source, float] = {}
        self._followed: Source | None = None

    @property
    def problem(self) -> str:
        """Who else speaks, in words; empty if nobody does."""
        others = sorted(_name(source) for source in self._heard_s if source != self._followed)
        if not others:
            return ""
        if self._followed is None:
            return f"several senders of {self._kind} speak, none is followed: {', '.join(others)}"
        return (
            f"another sender of {self._kind} is not followed: {', '.join(others)} (followed: {_name(self._followed)})"
        )

    def hear(self, source: Source, now_s: float) -> bool:
        """Note that one has spoken; return whether it is the one to follow.

        While the one that was followed is silent and several others speak, nobody is.

        Parameters
        ----------
        source : (str or None, (str, int) or None)
            What the packet calls its sender, and the address it came from.
        now_s : float
            Time of its reception, by any clock that goes on.
        """
        self._forget_silent(now_s)
        if source in self._heard_s or len(self._heard_s) < _MAX_SOURCES:
            self._heard_s[source] = now_s
        if self._followed is None and list(self._heard_s) == [source]:
            self._followed = source
        return source == self._followed

    def is_silent(self, now_s: float) -> bool:
        """Return whether nobody who is followed has spoken of late."""
        self._forget_silent(now_s)
        return self._followed is None

    def _forget_silent(self, now_s: float) -> None:
        # a clock that was set back makes an age negative: that is as good as silence
        self._heard_s = {source: t for source, t in self._heard_s.items() if abs(now_s - t) <= _SILENT_S}
        if self._followed not in self._heard_s:
            self._followed = None


def _name(source: Source) -> str:
    identifier, address = source
    return " at ".join(filter(None, (identifier, f"{address[0]}:{address[1]}" if address else ""))) or "nameless"
