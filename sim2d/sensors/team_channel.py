"""The radio between robots of one team: short messages at a low rate, with delays and losses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.team.message import MAX_MESSAGE_BYTES
from sim2d.robot_link import TIME_SLACK_S

MESSAGE_PERIOD_S = 0.5


@dataclass(frozen=True, slots=True)
class ChannelSettings:
    """Settings of `TeamChannel`."""

    #: Probability that a message is lost, independently for each receiver, as in a wireless network in a full hall.
    loss_ratio: float = 0.1
    #: Bounds of a message's delay; messages may overtake each other.
    min_delay_s: float = 0.02
    max_delay_s: float = 0.1

    def __post_init__(self) -> None:
        if not 0.0 <= self.loss_ratio <= 1.0:
            raise ArgumentError(f"loss_ratio must be within 0 to 1, got {self.loss_ratio}")
        if not 0.0 <= self.min_delay_s <= self.max_delay_s <= 10.0:
            raise ArgumentError(
                f"min_delay_s and max_delay_s must be within 0 to 10 s and in order, "
                f"got {self.min_delay_s}, {self.max_delay_s}"
            )


UNDISTURBED = ChannelSettings(0.0, 0.0, 0.0)


class TeamChannel:
    """Carries the messages of the robots of one team.

    A robot may send one message in `MESSAGE_PERIOD_S`; earlier ones are not sent.

    Parameters
    ----------
    rngs : sequence of numpy.random.Generator
        Random generators for the messages of each robot.
    """

    def __init__(self, settings: ChannelSettings, rngs: Sequence[np.random.Generator]) -> None:
        self._settings, self._rngs = settings, tuple(rngs)
        # for each receiving robot: time of arrival, number among all messages, bytes
        self._coming: list[list[tuple[float, int, bytes]]] = [[] for _ in self._rngs]
        self._next_s = [-np.inf] * len(self._rngs)
        self._sent = 0

    def send(self, robot: int, message: bytes, t_s: float) -> None:
        """Send a robot's message to all others of its team.

        Raises
        ------
        ArgumentError
            If it is not bytes, or too long.
        """
        check_message(message)
        if t_s < self._next_s[robot] - TIME_SLACK_S:
            return
        self._next_s[robot] = t_s + MESSAGE_PERIOD_S
        settings, rng = self._settings, self._rngs[robot]
        for other, coming in enumerate(self._coming):
            if other == robot:
                continue
            is_lost = float(rng.random()) < settings.loss_ratio
            delay_s = float(rng.uniform(settings.min_delay_s, settings.max_delay_s))
            if not is_lost:
                coming.append((t_s + delay_s, self._sent, message))
                self._sent += 1

    def received(self, robot: int, t_s: float) -> tuple[bytes, ...]:
        """Return the messages that have reached a robot since the last call, in order of arrival."""
        coming = self._coming[robot]
        here = sorted(one for one in coming if one[0] <= t_s + TIME_SLACK_S)
        self._coming[robot] = [one for one in coming if one[0] > t_s + TIME_SLACK_S]
        return tuple(message for _, _, message in here)


def check_message(message: object) -> None:
    """Refuse a message that no channel can carry.

    Raises
    ------
    ArgumentError
        If it is not bytes, or too long.
    """
    if not isinstance(message, bytes):
        raise ArgumentError(f"a team message must be bytes, got {type(message).__name__}")
    if len(message) > MAX_MESSAGE_BYTES:
        raise ArgumentError(f"a team message must be at most {MAX_MESSAGE_BYTES} bytes, got {len(message)}")
