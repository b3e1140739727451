"""Links of reports to moments of recordings, as the page of `robocup-vision live FOLDER` opens them."""

from __future__ import annotations

from urllib.parse import urlencode

# of the page, unless it was started with another one
LIVE_PORT = 8090


def moment_link(recording: str, t_s: float) -> str:
    """Return the address that opens a recording (its file name) so long after its beginning, and stands still there."""
    return f"http://127.0.0.1:{LIVE_PORT}/?" + urlencode({"recording": recording, "t": f"{max(t_s, 0.0):.3f}"})
