"""From one camera frame to a pose, free floor, the ball and a motion command.

>>> from robocup_vision import Steering, Vision, load_camera, load_colors, load_field

The public names are listed in ``__init__.pyi``, which type checkers also read. Each is imported when it is first used,
so that the command's ``--help`` answers at once and a robot loads only what it needs.
"""

import lazy_loader

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    if name == "__version__":
        # reading the metadata takes longer than the rest of the import
        from importlib.metadata import version

        return version("robocup-vision")
    return _load(name)
