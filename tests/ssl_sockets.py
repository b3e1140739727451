"""Free ports on the loopback and peers on it, for tests that talk: nothing of them leaves this machine."""

import socket
import threading
from contextlib import suppress

import pytest

WAIT_S = 10.0


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def free_ports():
    """Return a simulator's ports, of which the control's next two are free as well."""
    from sim2d.network.server import Ports

    while True:
        control = free_port()
        try:
            with (
                socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first,
                socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second,
                socket.socket() as tcp_control,
                socket.socket() as tcp_first,
                socket.socket() as tcp_second,
            ):
                first.bind(("127.0.0.1", control + 1))
                second.bind(("127.0.0.1", control + 2))
                for place, tcp in enumerate((tcp_control, tcp_first, tcp_second)):
                    tcp.bind(("127.0.0.1", control + place))
        except (OSError, OverflowError):
            continue
        return Ports(control, free_port(), free_port())


@pytest.fixture
def peer():
    """Return a function that answers the frames of one connection, after a greeting, and returns its port.

    It closes the connection where the answer is None.
    """
    from robocup_vision.ssl.framed import take_frame

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
