from .server import FoxgloveServer

__all__ = ["FoxgloveServer"]
