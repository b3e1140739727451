"""How much is kept for the page, and a check of the packages that it needs, without loading them."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

from field_models.errors import ArgumentError

LOOPBACK = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class FeedSettings:
    """How much is kept for each robot.

    Parameters
    ----------
    history_s : float
        Time for which pictures are kept.
    max_history_bytes : int
        Largest size of these pictures; 30 s of 640 x 480 at 30 frames per second take about half of the default.
    max_raw_bytes : int
        Largest size of the original frames that are kept; as long as one is kept, it can be saved without loss.
    jpeg_quality : int
        Quality of the pictures; above 85 they grow quickly without visible improvement.
    """

    history_s: float = 30.0
    max_history_bytes: int = 100_000_000
    max_raw_bytes: int = 64_000_000
    jpeg_quality: int = 85

    def __post_init__(self) -> None:
        if not self.history_s > 0 or self.max_history_bytes < 1 or self.max_raw_bytes < 1:
            raise ArgumentError("history_s, max_history_bytes and max_raw_bytes must be positive")
        if not 1 <= self.jpeg_quality <= 100:
            raise ArgumentError(f"jpeg_quality must be 1 to 100, got {self.jpeg_quality}")


def require_packages() -> None:
    """Raise ArgumentError if packages of the extra `live` are missing; it names them."""
    missing = [name for name in ("starlette", "uvicorn", "websockets") if find_spec(name) is None]
    if missing:
        raise ArgumentError(f"the page needs {' and '.join(missing)}: pip install 'robocup-vision[live]'")
