"""When the messages of a bag's topic were taken, and the poses of a topic as truth or odometry.

Headers' stamps may be missing or wrong. A stamp is compared with when its message was logged: the two clocks may differ
in offset and rate, but a stamp far from where the others put its message is ignored. Poses that cannot be used are
counted, and reported.
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
# a clock of another rate, such as a slow simulator's, drifts away from that of the log: in median absolute deviations
_MAX_DRIFT = 20.0
# largest difference of times that count as logged together
_TOGETHER_S = 0.5


@dataclass(frozen=True)
class TopicTimes:
    """When each message of a topic was taken, and when it was logged."""

    topic: str
    stamps_s: tuple[float, ...]  #: by the headers; NaN where a message cannot be read
    logged_s: tuple[float, ...]  #: by the bag

    @property
    def has_stamps(self) -> bool:
        """Whether anybody has filled the stamps in: one that is 0 among others is a time like any other."""
        return any(stamp != 0.0 for stamp in self.stamps_s if not math.isnan(stamp)) or not self.stamps_s

    @property
    def off(self) -> frozenset[int]:
        """Numbers of the messages whose stamps are not of the clock of the others."""
        apart = [stamp - logged for stamp, logged in zip(self.stamps_s, self.logged_s, strict=True)]
        known = [value for value in apart if not math.isnan(value)]
        if not known:
            return frozenset()
        middle = median(known)
        drift = median(abs(value - middle) for value in known)
        bound = _MAX_DELAY_S + _MAX_DRIFT * drift + max(self.logged_s) - min(self.logged_s)
        return frozenset(index for index, value in enumerate(apart) if abs(value - middle) > bound)

    def times_s(self, *, by_stamps: bool) -> list[float]:
        """Return when each message was taken: by its stamp, or else when it was logged.

        Where a message cannot be read, what was logged stands in, on the clock of the stamps before.
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
    """Return the places of the longest part of a sequence that rises strictly; of several the earliest.

    A time that is wrong so costs itself alone, and not those that come after it.
    """
    # how many can follow each place, itself included; by length, the largest value that such a part begins with
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
    """Return the stamp of a message's header; NaN where the message could not be read."""
    return math.nan if isinstance(message, PacketError) else to_seconds(message.header.stamp)


@dataclass(frozen=True)
class PoseTopic:
    """What stands in a topic of poses."""

    times: TopicTimes  #: when
    poses: tuple[Truth | PacketError, ...]  #: where; or why a message tells no place

    @classmethod
    def read(cls, bag: Bag, topic: str | None) -> PoseTopic:
        """Read a topic; empty without one."""
        stamps, logged, poses = [], [], []
        for logged_s, message in () if topic is None else bag.messages(topic):
            stamps.append(stamp_s(message))
            logged.append(logged_s)
            poses.append(message if isinstance(message, PacketError) else _place_in(message))
        return cls(TopicTimes(topic or "", tuple(stamps), tuple(logged)), tuple(poses))

    def in_time(
        self, *, by_stamps: bool, logged_within_s: tuple[float, float] | None = None
    ) -> list[tuple[float, Truth | None]]:
        """Return the poses by ascending time, of messages that were logged within a span if there is one.

        None where a message tells no place: nobody knew it then.
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
        """Say what is not used, or without its heading, how often, and when first."""
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
