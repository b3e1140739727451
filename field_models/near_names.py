"""Suggests the known name that is probably meant by a misspelt one."""

from __future__ import annotations

from collections.abc import Iterable


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``; did you mean 'NAME'?`` for the known name most similar to a word; empty if none is similar."""
    # imported here, because it is only needed after mistakes
    from difflib import get_close_matches

    by_lower = {name.lower(): name for name in known}
    nearest = get_close_matches(word.lower(), by_lower, n=1)
    return f"; did you mean '{by_lower[nearest[0]]}'?" if nearest else ""
