"""Times of calls in seconds of this thread, and the unit of times: cv2.cvtColor(BGR2HSV) of the same frame.

Other work on the machine does not count in a thread's time, and ratios to the unit hold on other machines.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.view import View
from robocup_vision.vision import Vision

Answer = TypeVar("Answer")


def timed(call: Callable[[], Answer]) -> tuple[Answer, float]:
    """Return a call's answer and its time, seconds of this thread."""
    start = time.thread_time()
    answer = call()
    return answer, time.thread_time() - start


def timed_look(vision: Vision, *arguments: Any, **named: Any) -> tuple[View, float]:
    """Return a view of `Vision.look`, and its time floor, obstacles and ball included: they are worked out late."""

    def look() -> View:
        view = vision.look(*arguments, **named)
        _ = view.free_space, view.obstacles, view.ball
        return view

    return timed(look)


def median_s(call: Callable[[], object], repeats: int) -> float:
    """Return the median time of a call, seconds of this thread."""
    return float(np.median([timed(call)[1] for _ in range(repeats)]))


def unit_s(frame: UInt8Array, repeats: int = 3) -> float:
    """Return the median time of cvtColor of a frame, seconds of this thread."""
    return median_s(lambda: cv2.cvtColor(frame, cv2.COLOR_BGR2HSV), repeats)
