"""The league's recordings beside the project, without which tests that need them are skipped; peers of framed ports."""

import socket
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from robocup_vision.ssl.framed import take_frame

WAIT_S = 10.0
RECORDINGS = Path(__file__).resolve().parents[4] / "shared" / "ssl"


@pytest.fixture
def recordings():
    if not RECORDINGS.is_dir():
        pytest.skip("the league's recordings are not here")
    return RECORDINGS


@pytest.fixture
def peer():
    """Return a function that answers the frames of one connection, after a greeting, and returns its port.

    It closes the connection where the answer is None.
    """
    opened, threads = [], []

    def start(answer, greeting=b""):
        listening = socket.create_server(("127.0.0.1", 0))
        listening.settimeout(WAIT_S)
        opened.append(listening)

        def serve():
            connection, _ = listening.accept()
            connection.settimeout(WAIT_S)
            buffer = bytearray()
            with connection, suppress(ConnectionError):
                connection.sendall(greeting)
                while data := connection.recv(4096):
                    buffer += data
                    while (frame := take_frame(buffer)) is not None:
                        reply = answer(frame)
                        if reply is None:
                            return
                        connection.sendall(reply)

        threads.append(threading.Thread(target=serve))
        threads[-1].start()
        return listening.getsockname()[1]

    yield start
    for listening in opened:
        listening.close()
    for thread in threads:
        thread.join(WAIT_S)
