"""Recordings of a robot's run: MCAP files with ROS 2 messages, and the exact calls that a replay makes again."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
