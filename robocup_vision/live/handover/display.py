"""What shows moments: the page's process, or in tests its feed alone."""

from __future__ import annotations

from typing import Any, Protocol

from robocup_vision.live.handover.moment import Moment, RobotSetup


class Display(Protocol):
    """Takes what loops have seen; safe to use from several threads."""

    def set_robots(self, setups: tuple[RobotSetup, ...]) -> None:
        """Show these robots, and forget all others."""
        ...

    def put(self, moment: Moment) -> None:
        """Hand a moment over, and go on."""
        ...

    def wait_until_made(self, timeout_s: float) -> bool:
        """Wait until all that was handed over can be seen; return whether that is so."""
        ...

    def forget(self) -> None:
        """Forget all moments: the source has gone to another time."""
        ...

    def say(self, line: str) -> None:
        """Show a line."""
        ...

    def set_status(self, **changes: Any) -> None:
        """Change what is shown of the run: plain values by name."""
        ...

    def close(self) -> None:
        """End."""
        ...
