"""The poses of a bag's topic, as truth or odometry: what cannot be used of them is counted, and said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from field_models.errors import PacketError
from robocup_vision.evaluation.dataset import Truth
from robocup_vision.messages.poses import place_of
from robocup_vision.recording.bags.bag import Bag
from robocup_vision.recording.bags.topic_times import TopicTimes, stamp_s

# what is logged together may be logged so far apart
_TOGETHER_S = 0.5


@dataclass(frozen=True)
class PoseTopic:
    """What stands in a topic of poses.

    Parameters
    ----------
    times : TopicTimes
        When.
    poses : tuple of Truth or PacketError
        Where; or why a message tells no place.
    """

    times: TopicTimes
    poses: tuple[Truth | PacketError, ...]

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
