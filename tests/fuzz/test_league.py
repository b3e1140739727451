"""Damaged messages of the league, from five senders and up to the largest datagram: nobody ends for them."""

from league_flood import flood
from ssl_sockets import free_port, free_ports


def test_a_flood_of_damaged_messages_ends_nobody():
    found = flood(2000, 1, free_ports(), free_port())
    assert found.is_finite
    assert found.plays_on
    assert found.refused > 50
