"""The exceptions under the library's own name; they are defined in `field_models.errors`."""

from field_models.errors import ArgumentError, FileError, FrameError, PacketError, RobocupVisionError

__all__ = ["ArgumentError", "FileError", "FrameError", "PacketError", "RobocupVisionError"]
