"""Damaged messages of the league, from five senders and up to the largest datagram: nobody ends for them."""

import socket

from ssl_sockets import free_port

from benchmarks.worlds.flood import flood
from sim2d.network.server import Ports


def free_ports():
    while True:
        control = free_port()
        try:
            with socket.socket() as first, socket.socket() as second, socket.socket() as third:
                for place, one in enumerate((first, second, third)):
                    one.bind(("127.0.0.1", control + place))
        except (OSError, OverflowError):
            continue
        return Ports(control, free_port(), free_port())


def test_a_flood_of_damaged_messages_ends_nobody():
    found = flood(2000, 1, free_ports(), free_port())
    assert found.is_finite
    assert found.plays_on
    assert found.refused > 50
