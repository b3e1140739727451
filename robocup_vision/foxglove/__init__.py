"""Serves what a robot sees to the Foxglove viewer, with the same topics as a recording; extra `foxglove`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
