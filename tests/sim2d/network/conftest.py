"""A league simulator that runs on free ports of this machine until the test is over."""

import threading
import time
from contextlib import contextmanager

import pytest
from ssl_sockets import free_port, free_ports

from sim2d.network.league import LeagueSimulator
from sim2d.network.realism import Realism
from sim2d.network.server import LeagueServer

MAX_RUN_S, MAX_JOIN_S = 60.0, 20.0


@pytest.fixture
def ports():
    """Return ports that are free."""
    return free_ports()


@pytest.fixture
def serve():
    """Return a context manager that runs a simulator in a thread."""

    @contextmanager
    def run(field, players):
        simulator = LeagueSimulator(field, players, Realism(), epoch_s=time.time())
        simulator.vision_port = free_port()
        end_s = time.monotonic() + MAX_RUN_S
        with LeagueServer(simulator, ports=free_ports()) as served:
            stop = threading.Event()
            thread = threading.Thread(target=served.run, args=(lambda: not stop.is_set() and time.monotonic() < end_s,))
            thread.start()
            yield served
            stop.set()
            thread.join(MAX_JOIN_S)

    return run
