"""A page that shows what a robot sees: `Viewer` for a robot's own loop, and the command `robocup-vision live`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
