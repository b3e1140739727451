"""Times of the messages of a bag's topic, and the poses of a topic as truth or odometry.

Headers' stamps may be missing or wrong. Each is compared with the time at which its message was logged. The two clocks
may differ in offset and rate, but a stamp that deviates much more than the others is ignored. Poses that cannot be used
are counted and reported.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from field_models.errors import PacketError
from robocup_vision.evaluation.dataset import Truth
from robocup_vision.messages.topics import place_of
from robocup_vision.messages.types import to_seconds
from robocup_vision.recording.bags.bag import Bag

# longest delay of a message before it is logged
_MAX_DELAY_S = 10.0
# largest deviation due to clocks of different rates, such as a slow simulator's, in median absolute deviations
_MAX_DRIFT = 20.0
# tolerance at both ends of a span of logging times
_TOGETHER_S = 0.5


@dataclass(frozen=True)
class TopicTimes:
    """The stamp and the logging time of each message of a topic."""

    topic: str
    stamps_s: tuple[float, ...]  #: stamps of the headers; NaN if a message cannot be read
    logged_s: tuple[float, ...]  #: times of logging, by the bag

    @property
    def has_stamps(self) -> bool:
        """Whether the stamps are filled in, which they are not if all are 0."""
        return any(stamp != 0.0 for stamp in self.stamps_s if not math.isnan(stamp)) or not self.stamps_s

    @property
    def off(self) -> frozenset[int]:
        """Numbers of the messages whose stamps are from another clock than the others."""
        apart = [stamp - logged for stamp, logged in zip(self.stamps_s, self.logged_s, strict=True)]
        known = [value for value in apart if not math.isnan(value)]
        if not known:
            return frozenset()
        middle = median(known)
        drift = median(abs(value - middle) for value in known)
        bound = _MAX_DELAY_S + _MAX_DRIFT * drift + max(self.logged_s) - min(self.logged_s)
        return frozenset(index for index, value in enumerate(apart) if abs(value - middle) > bound)

    def times_s(self, *, by_stamps: bool) -> list[float]:
        """Return the times of the messages, by their stamps or by when they were logged.

        A message that cannot be read gets its time of logging, plus the last known difference of the two clocks.
        """
        if not by_stamps:
            return list(self.logged_s)
        times, apart, off = [], 0.0, self.off
        for index, (stamp, logged) in enumerate(zip(self.stamps_s, self.logged_s, strict=True)):
            if not math.isnan(stamp) and index not in off:
                apart = stamp - logged
            times.append(logged + apart if math.isnan(stamp) else stamp)
        return times


def rising(times_s: Sequence[float]) -> list[int]:
    """Return the indices of the longest strictly rising subsequence; of several, the earliest.

    So a wrong time is skipped alone, without those that follow it.
    """
    # longest rising subsequence from each place on; for each length, the negated largest value it can begin with
    begins: list[float] = []
    lengths = [0] * len(times_s)
    for place in reversed(range(len(times_s))):
        at = bisect.bisect_left(begins, -times_s[place])
        begins[at : at + 1] = [-times_s[place]]
        lengths[place] = at + 1
    chosen: list[int] = []
    for place, (time_s, length) in enumerate(zip(times_s, lengths, strict=True)):
        if length == len(begins) - len(chosen) and (not chosen or time_s > times_s[chosen[-1]]):
            chosen.append(place)
    return chosen


def stamp_s(message: Any) -> float:
    """Return the stamp of a message's header; NaN if the message could not be read."""
    return math.nan if isinstance(message, PacketError) else to_seconds(message.header.stamp)


@dataclass(frozen=True)
class PoseTopic:
    """The messages of a topic of poses."""

    times: TopicTimes  #: times of the messages
    poses: tuple[Truth | PacketError, ...]  #: their poses, or why a message does not contain one

    @classmethod
    def read(cls, bag: Bag, topic: str | None) -> PoseTopic:
        """Read a topic; the result is empty if `topic` is None."""
        stamps, logged, poses = [], [], []
        for logged_s, message in () if topic is None else bag.messages(topic):
            stamps.append(stamp_s(message))
            logged.append(logged_s)
            poses.append(message if isinstance(message, PacketError) else _place_in(message))
        return cls(TopicTimes(topic or "", tuple(stamps), tuple(logged)), tuple(poses))

    def in_time(
        self, *, by_stamps: bool, logged_within_s: tuple[float, float] | None = None
    ) -> list[tuple[float, Truth | None]]:
        """Return the poses by ascending time, only of messages that were logged within a span if one is given.

        The pose is None for a message without a usable one.
        """
        times_s = self.times.times_s(by_stamps=by_stamps)
        off = self.times.off if by_stamps else frozenset()
        first_s, last_s = logged_within_s or (-float("inf"), float("inf"))
        found = [
            (times_s[index], pose if isinstance(pose, Truth) else None)
            for index, pose in enumerate(self.poses)
            if index not in off and first_s - _TOGETHER_S <= self.times.logged_s[index] <= last_s + _TOGETHER_S
        ]
        return sorted(found, key=lambda timed: timed[0])

    def notes(self, where: str, without_heading: str) -> list[str]:
        """Return notes on the poses that are not used or have no heading: number and first time of each kind."""
        stamps = self.times.times_s(by_stamps=True)
        bad = [index for index, pose in enumerate(self.poses) if isinstance(pose, PacketError)]
        turnless = [
            index for index, pose in enumerate(self.poses) if isinstance(pose, Truth) and pose.theta_rad is None
        ]
        off = sorted(self.times.off - set(bad))
        return [
            f"{where} {self.times.topic}: {len(found)} of {len(self.poses)} {what} (the first at"
            f" {stamps[found[0]]:.3f} s{why}): {done}"
            for found, what, why, done in (
                (bad, "poses are none", f": {self.poses[bad[0]]}" if bad else "", "not used"),
                (turnless, "orientations are no rotation", "", without_heading),
                (off, "poses have a stamp of another clock", "", "not used"),
            )
            if found
        ]


def _place_in(message: Any) -> Truth | PacketError:
    try:
        if hasattr(message, "transform"):
            return Truth(*place_of(message.transform.translation, message.transform.rotation))
        inner = message.pose
        inner = inner.pose if hasattr(inner, "pose") else inner
        return Truth(*place_of(inner.position, inner.orientation))
    except PacketError as error:
        return error
