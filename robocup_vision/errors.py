"""The error family under the library's own name: what `robocup_vision` raises stands in `field_models.errors`."""

from field_models.errors import ArgumentError, FileError, FrameError, PacketError, RobocupVisionError

__all__ = ["ArgumentError", "FileError", "FrameError", "PacketError", "RobocupVisionError"]
