"""Writes match.json for other programs. It holds no time and no machine: the same seed writes the same bytes."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from field_models.errors import FileError
from sim2d.report.match_figures import MatchFigures

# more digits than any figure is accurate to, fewer than different processors agree on
_DIGITS = 6


def match_json(
    field: str,
    players: int,
    seed: int,
    figures: MatchFigures,
    ours: str = "plain",
    theirs: str = "plain",
    disturbances: Sequence[str] = (),
) -> dict[str, Any]:
    """Return a match as JSON values.

    Parameters
    ----------
    ours, theirs : str
        Names of the players of the side that attacks +x, and of the other.
    """
    values = dataclasses.asdict(figures)
    values["goals"] = [{"t_s": t_s, "side": side} for t_s, side in figures.goals]
    head = {"format": 1, "field": field, "players": players, "ours": ours, "theirs": theirs, "seed": seed}
    plain: dict[str, Any] = _plain({**head, "disturbances": list(disturbances), **values})
    return plain


def write_json(path: Path, values: dict[str, Any]) -> None:
    """Write JSON values.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(values, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise FileError(error.filename or path, f"cannot be written ({error.strerror or error})") from None


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    if isinstance(value, float):
        # a fault without an end ends at infinity, which JSON cannot hold
        return round(value, _DIGITS) if math.isfinite(value) else None
    return value
