"""Links from reports to moments of recordings, which open in the page of `robocup-vision live FOLDER`."""

from __future__ import annotations

from urllib.parse import urlencode

# default port of the page
LIVE_PORT = 8090


def moment_link(recording: str, t_s: float) -> str:
    """Return the address that opens a recording (file name) and pauses at a time after its beginning."""
    return f"http://127.0.0.1:{LIVE_PORT}/?" + urlencode({"recording": recording, "t": f"{max(t_s, 0.0):.3f}"})
