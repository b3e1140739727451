"""Collects problems with received data: the number of each kind, and its newest text."""

from __future__ import annotations

# limits the memory, because senders can produce any number of kinds
_MAX_KINDS = 50


class Problems:
    """Counts problems by their kind.

    Attributes
    ----------
    counts : dict of str to int
        Number of problems of each kind, in order of their first occurrence.
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
            Kind of the problem; problems of the same kind are counted together.
        words : str
            Text of the problem; default: its kind.
        """
        if kind not in self.counts:
            if len(self.counts) >= _MAX_KINDS:
                kind = words = "other problems"
            if kind not in self.counts:
                self._new.append(kind)
        self.counts[kind] = self.counts.get(kind, 0) + 1
        self._words[kind] = words or kind

    def take_new(self) -> list[str]:
        """Return the texts of the kinds that have first occurred since the last call."""
        kinds, self._new = self._new, []
        return [self._words[kind] for kind in kinds]

    def lines(self) -> list[str]:
        """Return a line for each kind, with its count and newest text."""
        return [f"{count} x {self._words[kind]}" for kind, count in self.counts.items()]
