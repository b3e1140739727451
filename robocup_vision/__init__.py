"""From one camera frame to a pose, free floor, the ball and a motion command.

>>> from field_models import load_field
>>> from robocup_vision import Steering, Vision, load_camera, load_colors

The public names stand in ``__init__.pyi``, which type checkers read too. Each is imported when first used, so that the
command's ``--help`` answers at once and a robot loads only what it runs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
