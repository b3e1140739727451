"""The league's addresses, and sockets for them that reach no farther than asked.

Without an interface everything stays on the loopback: it is bound to 127.0.0.1, and multicast has a time to live of 0.
Functions here raise `ArgumentError` where there is no such interface, or the interface or the port cannot be used.
"""

from __future__ import annotations

import asyncio
import ipaddress
import select
import socket
import struct
import sys
import time
from collections import deque

from field_models.errors import ArgumentError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

Address = tuple[str, int]

LOOPBACK = "127.0.0.1"
VISION_GROUP, VISION_PORT, SIMULATED_VISION_PORT = "224.5.23.2", 10006, 10020
TRACKER_GROUP, TRACKER_PORT = "224.5.23.2", 10010
REFEREE_GROUP, REFEREE_PORT = "224.5.23.1", 10003
SIMULATION_PORT, BLUE_PORT, YELLOW_PORT = 10300, 10301, 10302
# of a UDP datagram
MAX_DATAGRAM_BYTES = 65_507
# frames of several cameras arrive at once; the default holds a few only
_RECEIVE_BUFFER_BYTES = 1 << 20
# a full buffer holds fewer
_MAX_AT_ONCE = 4096
_SIOCGIFADDR = 0x8915
_THREAD_WAIT_S = 0.1
# Linux: take only what is sent to a group on the interface this socket has joined it on
_IP_MULTICAST_ALL = 49


def interface_address(interface: str) -> str:
    """Return the IPv4 address of a network interface.

    Parameters
    ----------
    interface : str
        ``loopback``, an interface's name or its IPv4 address.
    """
    if interface == "loopback":
        return LOOPBACK
    try:
        return str(ipaddress.IPv4Address(interface))
    except ValueError:
        pass
    if fcntl is None:
        raise ArgumentError(f"this system does not tell an interface's address: give it instead of {interface!r}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            found = fcntl.ioctl(probe, _SIOCGIFADDR, struct.pack("256s", interface.encode()[:15]))
        except OSError:
            raise ArgumentError(f"there is no network interface {interface!r} with an IPv4 address") from None
    return socket.inet_ntoa(found[20:24])


def multicast_receiver(group: str, port: int, interface: str = "loopback") -> socket.socket:
    """Return a non-blocking socket that gets what is sent to a group on one interface; others may listen too."""
    address = interface_address(interface)
    made = _socket()
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
        # Windows lets nobody bind to a group
        made.bind(("" if sys.platform == "win32" else group, port))
        membership = socket.inet_aton(group) + socket.inet_aton(address)
        made.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        if sys.platform == "linux":
            made.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)
    except (OSError, OverflowError) as error:
        made.close()
        raise ArgumentError(f"cannot listen to {group}:{port} on {interface}: {error_words(error)}") from None
    return made


def multicast_sender(interface: str = "loopback", *groups: str) -> socket.socket:
    """Return a socket that sends to groups on one interface; those who listen on this machine get it too.

    Parameters
    ----------
    groups : str
        Groups that are sent to. The interface then belongs to them, and clients of this machine that have joined on
        another interface, as many do, get them all the same.
    """
    address = interface_address(interface)
    made = _socket()
    try:
        made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address))
        made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0 if address == LOOPBACK else 1)
        made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        # Windows lets only a bound socket join
        made.bind(("", 0))
        for group in dict.fromkeys(groups):
            membership = socket.inet_aton(group) + socket.inet_aton(address)
            made.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
    except OSError as error:
        made.close()
        raise ArgumentError(f"cannot send on {interface}: {error_words(error)}") from None
    return made


def server(port: int, interface: str = "loopback") -> socket.socket:
    """Return a non-blocking socket on a port (0: any free one) of one interface's address."""
    address = interface_address(interface)
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
        made.bind((address, port))
    except (OSError, OverflowError) as error:
        made.close()
        raise ArgumentError(f"cannot listen on {address}:{port}: {error_words(error)}") from None
    return made


def wait_for_datagram(listening: socket.socket, deadline_s: float | None) -> tuple[bytes, Address] | None:
    """Return the next datagram and who sent it, or None once `time.monotonic` has passed the deadline (None: wait)."""
    while True:
        left_s = None if deadline_s is None else max(deadline_s - time.monotonic(), 0.0)
        ready, _, _ = select.select([listening], [], [], left_s)
        if not ready:
            return None
        datagram = take_datagram(listening)
        if datagram is not None:
            return datagram


def take_datagram(listening: socket.socket) -> tuple[bytes, Address] | None:
    """Return a datagram that is there, and who sent it; None if there is none."""
    try:
        data, sender = listening.recvfrom(MAX_DATAGRAM_BYTES)
    except (BlockingIOError, ConnectionError):
        # a connection error is about what was sent before: nobody listened there; somebody may yet
        return None
    return data, (sender[0], sender[1])


def take_newest(listening: socket.socket, most: int = _MAX_AT_ONCE) -> tuple[list[tuple[bytes, Address]], int]:
    """Return what is there without waiting, of more than so many datagrams the newest, and how many were passed over.

    However fast others send, it ends.
    """
    waiting: deque[tuple[bytes, Address]] = deque(maxlen=most)
    count = 0
    while count < _MAX_AT_ONCE and (datagram := take_datagram(listening)) is not None:
        waiting.append(datagram)
        count += 1
    return list(waiting), count - len(waiting)


async def await_datagram(listening: socket.socket, deadline_s: float | None) -> tuple[bytes, Address] | None:
    """As `wait_for_datagram`, for a running asyncio loop of any kind."""
    while True:
        left_s = None if deadline_s is None else max(deadline_s - time.monotonic(), 0.0)
        datagram = take_datagram(listening)
        if datagram is not None or left_s == 0.0:
            return datagram
        await _readable(listening, left_s)


async def _readable(listening: socket.socket, timeout_s: float | None) -> None:
    """Return when there is a datagram, or somewhat later than the timeout, or sooner for no reason."""
    loop = asyncio.get_running_loop()
    ready: asyncio.Future[None] = loop.create_future()
    try:
        loop.add_reader(listening, _wake, ready)
    except NotImplementedError:
        # the usual loop on Windows watches no sockets: a thread does, for a short time each, so that a wait that is
        # cancelled keeps neither thread nor program
        slice_s = _THREAD_WAIT_S if timeout_s is None else min(timeout_s, _THREAD_WAIT_S)
        await loop.run_in_executor(None, select.select, [listening], [], [], slice_s)
        return
    try:
        await asyncio.wait_for(ready, timeout_s)
    except (TimeoutError, asyncio.TimeoutError):
        pass
    finally:
        loop.remove_reader(listening)


def _wake(ready: asyncio.Future[None]) -> None:
    if not ready.done():
        ready.set_result(None)


def _socket() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    return made


def error_words(error: Exception) -> str:
    """Return what the system says of an error, without its number."""
    return str(getattr(error, "strerror", None) or error)
