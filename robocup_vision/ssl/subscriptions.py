"""Clients for the league's multicast groups: vision, trackers, the referee. Each keeps the newest packet of its kind.

Bad datagrams are counted and skipped, because any program can send to a group.
"""

from __future__ import annotations

import time

from robocup_vision.ssl.datagrams import DatagramClient
from robocup_vision.ssl.overview import MAX_CAMERAS, CameraMerge, Overview
from robocup_vision.ssl.sockets import (
    REFEREE_GROUP,
    REFEREE_PORT,
    TRACKER_GROUP,
    TRACKER_PORT,
    VISION_GROUP,
    VISION_PORT,
    Address,
    multicast_receiver,
)
from robocup_vision.ssl.source_choice import SourceChoice
from robocup_vision.ssl.values.detection import VisionPacket
from robocup_vision.ssl.values.geometry import Geometry
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.tracked import TrackerPacket


class VisionClient(DatagramClient[VisionPacket]):
    """Listens to a vision system, and merges the frames of its cameras.

    Each camera's frames are taken from one sender, until that has been silent for a second. If two systems have a
    camera 0, as two simulators on one machine, the second one's is ignored.

    Parameters
    ----------
    port : int
        10006 for the league's vision; simulators use 10020 (`SIMULATED_VISION_PORT`).
    """

    def __init__(self, port: int = VISION_PORT, interface: str = "loopback", group: str = VISION_GROUP) -> None:
        super().__init__(VisionPacket, multicast_receiver(group, port, interface))
        self._merge = CameraMerge()
        self._senders: dict[int, SourceChoice] = {}

    @property
    def geometry(self) -> Geometry | None:
        """The newest field with the newest calibrations, in order of the cameras' ids; None before the first one."""
        return self._merge.geometry

    @property
    def overview(self) -> Overview | None:
        """The newest frames of all cameras, combined; None before the first one."""
        return self._merge.overview

    @property
    def problem(self) -> str:
        """Text about another sender of a followed camera's frames; empty if there is none."""
        return next((choice.problem for choice in self._senders.values() if choice.problem), "")

    def _keep(self, packet: VisionPacket, sender: Address) -> bool:
        if packet.detection is not None:
            number = packet.detection.camera_id
            if number not in self._senders:
                if len(self._senders) >= MAX_CAMERAS:
                    self._senders.clear()
                self._senders[number] = SourceChoice(f"frames of camera {number}")
            if not self._senders[number].hear((None, sender), time.monotonic()):
                return False
        self._merge.add(packet)
        return True


class TrackerClient(DatagramClient[TrackerPacket]):
    """Listens to trackers. Several may send; a packet's `uuid` identifies the sender."""

    def __init__(self, port: int = TRACKER_PORT, interface: str = "loopback", group: str = TRACKER_GROUP) -> None:
        super().__init__(TrackerPacket, multicast_receiver(group, port, interface))


class RefereeClient(DatagramClient[Referee]):
    """Listens to one game controller until it has been silent for a second; packets of others are ignored.

    Attributes
    ----------
    new_command : bool
        Whether the newest packet has a new command: its counter or its sender has changed.
    """

    def __init__(self, port: int = REFEREE_PORT, interface: str = "loopback", group: str = REFEREE_GROUP) -> None:
        super().__init__(Referee, multicast_receiver(group, port, interface))
        self._choice = SourceChoice("referee packets")
        self.newest: Referee | None = None
        self.sender: Address | None = None
        self.new_command = False

    @property
    def is_silent(self) -> bool:
        """Whether the followed game controller has been silent for a second."""
        return self._choice.is_silent(time.monotonic())

    @property
    def problem(self) -> str:
        """Text about other referees that send packets; empty if there are none."""
        return self._choice.problem

    def _keep(self, packet: Referee, sender: Address) -> bool:
        if not self._choice.hear((packet.source_identifier, sender), time.monotonic()):
            return False
        before = self.newest
        self.new_command = before is None or before.command_counter != packet.command_counter or self.sender != sender
        self.newest, self.sender = packet, sender
        return True
