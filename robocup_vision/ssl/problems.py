"""What is odd about what others send: each kind once, with how often it came and the newest words of it."""

from __future__ import annotations

# what a sender can vary must not fill the memory
_MAX_KINDS = 50


class Problems:
    """Counts problems by their kind.

    Attributes
    ----------
    counts : dict of str to int
        How often each kind came, in the order in which they first did.
    """

    def __init__(self) -> None:
        self.counts: dict[str, int] = {}
        self._words: dict[str, str] = {}
        self._new: list[str] = []

    def add(self, kind: str, words: str = "") -> None:
        """Count a problem.

        Parameters
        ----------
        kind : str
            What counts as the same.
        words : str
            What is to be said of it; default: its kind.
        """
        if kind not in self.counts:
            if len(self.counts) >= _MAX_KINDS:
                kind = words = "other problems"
            if kind not in self.counts:
                self._new.append(kind)
        self.counts[kind] = self.counts.get(kind, 0) + 1
        self._words[kind] = words or kind

    def take_new(self) -> list[str]:
        """Return the words of kinds that have come up since the last call."""
        kinds, self._new = self._new, []
        return [self._words[kind] for kind in kinds]

    def lines(self) -> list[str]:
        """Return one line for each kind: how often, and its newest words."""
        return [f"{count} x {self._words[kind]}" for kind, count in self.counts.items()]
