"""What a worker does with the batches that it gets: it starts once a thread, then turns piece after piece into results.

A worker of a cluster may have several threads, and what `start` makes is for one of them.
"""

from __future__ import annotations

import threading
from typing import Any

from robocup_vision.workers.pieces import Start


class Doer:
    """Does batches of one run.

    Parameters
    ----------
    start : callable
        See `run_pieces`. Called when a thread gets its first batch, so that what it raises is told as that batch's
        error.
    """

    def __init__(self, start: Start[Any, Any]) -> None:
        self._start = start
        self._local = threading.local()

    def __call__(self, batch: list[Any]) -> list[Any]:
        """Return the result of each piece."""
        if not hasattr(self._local, "do"):
            self._local.do = self._start()
        return [self._local.do(piece) for piece in batch]


def only_one_opencv_thread() -> None:
    """Keep OpenCV to the thread that calls it: the workers share the processors among them."""
    import cv2

    cv2.setNumThreads(0)
