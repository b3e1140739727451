"""Free ports on the loopback, for tests that talk: nothing of them leaves this machine."""

import socket


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
