"""The head of a table: its columns as they are printed, each with the kind of its figures unless they are words.

Names stand between bars, and a kind, a value of `Kind`, behind a colon; behind "error" a floor may stand::

    condition | located: rate | mm: error 0.5 | NEES mean | verdict
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from benchmarks.harness.figures import Column, Kind

_KINDS = "|".join(kind.value for kind in Kind)
_COLUMN = re.compile(rf"(?P<name>.*): (?P<kind>{_KINDS})(?: (?P<floor>\d\S*))?\s*")


def read_columns(head: str | Sequence[str]) -> list[Column]:
    """Return the columns of a head, or of several that stand beside each other; names keep the spaces around them."""
    pieces = [piece for part in ([head] if isinstance(head, str) else head) for piece in part.split(" | ")]
    return [_column(piece) for piece in pieces]


def _column(text: str) -> Column:
    match = _COLUMN.fullmatch(text)
    if match is None:
        return Column(text)
    return Column(match["name"], Kind(match["kind"]), float(match["floor"] or 0.0))
