"""The league's addresses, and sockets for them that use only the given network interface.

By default all traffic stays on the loopback: sockets are bound to 127.0.0.1, and multicast has a time to live of 0. The
functions raise `ArgumentError` if the interface does not exist, or the interface or the port cannot be used.
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
# largest payload of a UDP datagram
MAX_DATAGRAM_BYTES = 65_507
# frames of several cameras arrive at the same time, and the default buffer holds only a few
_RECEIVE_BUFFER_BYTES = 1 << 20
# greatest number of datagrams read at once; a full buffer holds fewer
_MAX_AT_ONCE = 4096
_SIOCGIFADDR = 0x8915
_THREAD_WAIT_S = 0.1
# Linux: receive only what is sent to a group on the interface on which this socket has joined it
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
    """Return a non-blocking socket that receives a group's datagrams on one interface; others may listen, too."""
    address = interface_address(interface)
    made = _socket()
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
        # Windows does not allow binding to a group
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
    """Return a socket that sends to groups on one interface; listeners on this machine receive it, too.

    Parameters
    ----------
    groups : str
        The groups to which it sends. It also joins them on the interface, so that clients of this machine that have
        joined on another interface, as many do, receive the datagrams as well.
    """
    address = interface_address(interface)
    made = _socket()
    try:
        made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address))
        made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0 if address == LOOPBACK else 1)
        made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        # on Windows only a bound socket can join a group
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
    """Return the next datagram and its sender, or None after a deadline by `time.monotonic` (None: no deadline)."""
    while True:
        left_s = None if deadline_s is None else max(deadline_s - time.monotonic(), 0.0)
        ready, _, _ = select.select([listening], [], [], left_s)
        if not ready:
            return None
        datagram = take_datagram(listening)
        if datagram is not None:
            return datagram


def take_datagram(listening: socket.socket) -> tuple[bytes, Address] | None:
    """Return a datagram that has arrived, and its sender; None if there is none."""
    try:
        data, sender = listening.recvfrom(MAX_DATAGRAM_BYTES)
    except (BlockingIOError, ConnectionError):
        # a connection error refers to an earlier datagram that no program received; one may listen later
        return None
    return data, (sender[0], sender[1])


def take_newest(listening: socket.socket, most: int = _MAX_AT_ONCE) -> tuple[list[tuple[bytes, Address]], int]:
    """Return the newest `most` datagrams that have arrived, without waiting, and the number of older ones skipped.

    It returns after at most `_MAX_AT_ONCE` datagrams, however fast others send.
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
    """Wait for a datagram; it may return somewhat later than the timeout, or early without a datagram."""
    loop = asyncio.get_running_loop()
    ready: asyncio.Future[None] = loop.create_future()
    try:
        loop.add_reader(listening, _wake, ready)
    except NotImplementedError:
        # the default loop on Windows cannot watch sockets: a thread does it for short intervals, so that a cancelled
        # wait soon ends its thread
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
    """Return the system's message of an error, without its number."""
    return str(getattr(error, "strerror", None) or error)
