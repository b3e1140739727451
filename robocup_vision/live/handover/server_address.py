"""Where the page is served by default, and which packages that needs: known without loading any of them."""

from __future__ import annotations

from importlib.util import find_spec

from field_models.errors import ArgumentError
from robocup_vision.evaluation.moment_links import LIVE_PORT

DEFAULT_PORT = LIVE_PORT
LOOPBACK = "127.0.0.1"


def require_packages() -> None:
    """Refuse to go on without the extra `live`.

    Raises
    ------
    ArgumentError
        If one of its packages is missing; the message names it.
    """
    missing = [name for name in ("starlette", "uvicorn", "websockets") if find_spec(name) is None]
    if missing:
        raise ArgumentError(f"the page needs {' and '.join(missing)}: pip install 'robocup-vision[live]'")
