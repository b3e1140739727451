"""What every program does before it measures and after it: one decorator of its `main`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

import cv2

from benchmarks.harness.pool import open_pool
from benchmarks.harness.report import finish, parse_arguments


def program(
    options: Mapping[str, Any] | None = None, *, pooled: bool = False
) -> Callable[[Callable[..., None]], Callable[[], None]]:
    """Make a program of a function that takes its arguments, and a pool if it is `pooled`.

    OpenCV is kept to one thread: times are those of one, and the workers of a pool share the processors among them.

    Parameters
    ----------
    options, pooled
        As in `parse_arguments`.
    """

    def decorate(measure: Callable[..., None]) -> Callable[[], None]:
        @wraps(measure)
        def main() -> None:
            arguments = parse_arguments(str(measure.__globals__["__doc__"]), options=options, pooled=pooled)
            cv2.setNumThreads(0)
            if pooled:
                with open_pool(arguments) as pool:
                    measure(arguments, pool)
            else:
                measure(arguments)
            finish()

        return main

    return decorate
