"""The small-size league's network: its messages as values, clients for its programs, and its log files.

It needs the extra ``ssl`` (protobuf), which is not loaded elsewhere in the package.

>>> from robocup_vision.ssl import RobotClient, SslLog, VisionClient
"""

from __future__ import annotations

from robocup_vision.ssl.field import field_from_geometry, geometry_from_field
from robocup_vision.ssl.game import Game, GameState
from robocup_vision.ssl.log import LogEntry, LogKind, SslLog, SslLogWriter, log_entry
from robocup_vision.ssl.overview import CameraMerge, MergeSettings, Overview, merge_frames
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.requests import RobotClient, SimulatorClient, SyncClient
from robocup_vision.ssl.subscriptions import RefereeClient, TrackerClient, VisionClient
from robocup_vision.ssl.values.simulation import GlobalVelocity, LocalVelocity, MoveCommand, RobotCommand, Team

__all__ = [
    "CameraMerge",
    "Game",
    "GameState",
    "GlobalVelocity",
    "LocalVelocity",
    "LogEntry",
    "LogKind",
    "MergeSettings",
    "MoveCommand",
    "Overview",
    "RefereeClient",
    "RobotClient",
    "RobotCommand",
    "SimulatorClient",
    "SslLog",
    "SslLogWriter",
    "SyncClient",
    "Team",
    "TrackerClient",
    "VisionClient",
    "decode",
    "encode",
    "field_from_geometry",
    "geometry_from_field",
    "log_entry",
    "merge_frames",
]
