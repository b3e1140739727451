"""Serves the page on this machine: its few files, and one WebSocket for each open page.

It needs the extra `live` (starlette, uvicorn), which is imported only when a page is served. Only pages from this
server are accepted: pages of another origin, and host names that were rebound to this machine, are refused.
"""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import threading
import time
from collections.abc import AsyncIterator, Coroutine, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from importlib.resources import files
from typing import TYPE_CHECKING

import msgspec

from field_models.errors import ArgumentError, PacketError, RobocupVisionError
from robocup_vision.live.handover.controls import Controls
from robocup_vision.live.handover.page_settings import LOOPBACK, require_packages
from robocup_vision.live.page.feed import Feed
from robocup_vision.live.page.messages import MAX_MESSAGE_BYTES, read_message
from robocup_vision.live.page.page_link import PageLink

if TYPE_CHECKING:
    import anyio
    import uvicorn
    from starlette.applications import Starlette
    from starlette.requests import HTTPConnection
    from starlette.websockets import WebSocket

# media types of the page's files by suffix; a browser does not run a file of another type
_MEDIA_TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
_PAGE = "page.html"
# only the page's own scripts and styles may run
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# greatest numbers of open pages, and of unreadable messages of a page before it is disconnected
MAX_PAGES, MAX_BAD_MESSAGES = 8, 10
# time without news after which a page gets a keep-alive, which distinguishes a silent source from a lost connection
_KEEP_ALIVE_S = 1.0
# status codes of the WebSocket protocol (RFC 6455, 7.4.1)
_POLICY_VIOLATION, _TRY_LATER = 1008, 1013
_START_S, _STOP_S = 10.0, 5.0


class PageServer:
    """Serves pages in a thread of its own, from `start` until `close`.

    With a host other than the loopback, anyone in that network can watch and use the controls.
    """

    def __init__(self, feed: Feed, controls: Controls, port: int, host: str = LOOPBACK) -> None:
        require_packages()
        if not 0 <= port < 65536:
            raise ArgumentError(f"the port must be 0 to 65535, got {port}")
        try:
            address = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
        except ValueError:
            raise ArgumentError(f"the host must be an IP address of this machine, got {host!r}") from None
        self._socket = _listen(str(address), port)
        self.host, self.port = str(address), int(self._socket.getsockname()[1])
        self._app = make_app(feed, controls, allowed_hosts(self.host, self.port))
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def address(self) -> str:
        """URL of the page."""
        host = LOOPBACK if self.host in ("0.0.0.0", "::") else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/"

    @property
    def is_public(self) -> bool:
        """Whether other machines can reach it."""
        return not ipaddress.ip_address(self.host).is_loopback

    def start(self) -> None:
        """Start serving; return when pages can connect.

        Raises RobocupVisionError if that takes more than ten seconds.
        """
        import uvicorn

        config = uvicorn.Config(
            self._app,
            log_level="critical",
            access_log=False,
            # pictures are compressed already
            ws_per_message_deflate=False,
            ws_max_size=4 * MAX_MESSAGE_BYTES,
            ws_max_queue=32,
            lifespan="on",
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._serve, args=(self._server,), name="live page", daemon=True)
        self._thread.start()
        deadline = time.monotonic() + _START_S
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() > deadline:
                raise RobocupVisionError(f"the page's server did not start on {self.address}")
            time.sleep(0.005)

    def _serve(self, server: uvicorn.Server) -> None:
        # not server.run(): signals belong to the robot's program
        asyncio.run(server.serve(sockets=[self._socket]))

    def close(self) -> None:
        """Disconnect all pages and end the thread."""
        if self._server is not None:
            self._server.should_exit = True
        if self._thread is not None:
            self._thread.join(_STOP_S)
        self._socket.close()


def allowed_hosts(host: str, port: int) -> frozenset[str] | None:
    """Return the accepted ``Host`` headers; None: any, since a public page is open to all."""
    if not ipaddress.ip_address(host).is_loopback:
        return None
    own = f"[{host}]" if ":" in host else host
    return frozenset(f"{name}:{port}" for name in {own, LOOPBACK, "localhost"})


def make_app(feed: Feed, controls: Controls, hosts: frozenset[str] | None) -> Starlette:
    """Return the ASGI application, which answers requests with these ``Host`` headers; None: any."""
    from starlette.applications import Starlette
    from starlette.responses import PlainTextResponse, Response
    from starlette.routing import Route, WebSocketRoute

    pages, shown = _Pages(feed, controls, hosts), page_files()

    async def show_page(request: HTTPConnection) -> Response:
        if not pages.is_expected_host(request):
            return PlainTextResponse("this page is at another address", status_code=400)
        name = request.url.path.removeprefix("/") or _PAGE
        headers = {
            "Content-Security-Policy": _POLICY,
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cache-Control": "no-store",
        }
        return Response(shown[name], media_type=_MEDIA_TYPES[name.rpartition(".")[2]], headers=headers)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        with pages.open():
            yield

    files_beside = [Route(f"/{name}", show_page) for name in shown if name != _PAGE]
    return Starlette(
        routes=[Route("/", show_page), *files_beside, WebSocketRoute("/live", pages.serve)], lifespan=lifespan
    )


def page_files() -> dict[str, str]:
    """Return the page, its style and its scripts by name."""
    folder = files("robocup_vision.live.page") / "web"
    own = (entry for entry in folder.iterdir() if entry.name.rpartition(".")[2] in _MEDIA_TYPES)
    return {entry.name: entry.read_text(encoding="utf-8") for entry in own}


class _Pages:
    """All open pages."""

    def __init__(self, feed: Feed, controls: Controls, hosts: frozenset[str] | None) -> None:
        self._feed, self._controls, self._hosts = feed, controls, hosts
        self._news: set[asyncio.Event] = set()

    @contextmanager
    def open(self) -> Iterator[None]:
        """Let the feed's news wake the pages, which run in the present event loop."""
        loop = asyncio.get_running_loop()

        def wake() -> None:
            # the loop may have ended meanwhile
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(self._wake)

        self._feed.on_news = wake
        yield

    def _wake(self) -> None:
        for news in self._news:
            news.set()

    def is_expected_host(self, connection: HTTPConnection) -> bool:
        return self._hosts is None or connection.headers.get("host", "") in self._hosts

    def _is_own_page(self, socket: WebSocket) -> bool:
        """Whether a request is from a page of this server. Programs other than browsers send no origin."""
        origin = socket.headers.get("origin")
        return self.is_expected_host(socket) and (origin is None or origin == f"http://{socket.headers.get('host')}")

    async def serve(self, socket: WebSocket) -> None:
        """Serve one page until it leaves."""
        import anyio

        if not self._is_own_page(socket):
            # the connection is not yet accepted: the browser gets a 403
            await socket.close(_POLICY_VIOLATION)
            return
        await socket.accept()
        if len(self._news) >= MAX_PAGES:
            await socket.close(_TRY_LATER, f"{MAX_PAGES} pages are open already")
            return
        news = asyncio.Event()
        link = PageLink(self._feed, self._controls)
        self._news.add(news)
        try:
            async with anyio.create_task_group() as both:
                both.start_soon(self._until_it_ends, self._send(socket, link, news), both.cancel_scope)
                both.start_soon(self._until_it_ends, _receive(socket, link, news), both.cancel_scope)
        finally:
            self._news.discard(news)
            link.close()

    async def _until_it_ends(self, work: Coroutine[None, None, None], scope: anyio.CancelScope) -> None:
        """Run the sending or the receiving half of a page's connection; when it ends, cancel the other half."""
        try:
            await work
        except Exception as error:
            if not _has_left(error):
                self._feed.say(f"a page was sent away: {type(error).__name__}: {error}")
        scope.cancel()

    async def _send(self, socket: WebSocket, link: PageLink, news: asyncio.Event) -> None:
        while True:
            news.clear()
            for item in link.outgoing():
                if isinstance(item, bytes):
                    await socket.send_bytes(item)
                else:
                    await socket.send_text(msgspec.json.encode(item).decode())
            try:
                await asyncio.wait_for(news.wait(), _KEEP_ALIVE_S)
            except (asyncio.TimeoutError, TimeoutError):
                await socket.send_text('{"type":"alive"}')


async def _receive(socket: WebSocket, link: PageLink, news: asyncio.Event) -> None:
    from starlette.websockets import WebSocketDisconnect

    bad = 0
    while True:
        got = await socket.receive()
        if got["type"] != "websocket.receive":
            raise WebSocketDisconnect(got.get("code", 1000))
        text = got.get("text")
        try:
            if text is None:
                raise PacketError("a message of a page must be text")
            link.handle(read_message(text))
        except RobocupVisionError as error:
            bad += isinstance(error, PacketError)
            await socket.send_text(msgspec.json.encode({"type": "refused", "reason": str(error)}).decode())
            if bad >= MAX_BAD_MESSAGES:
                await socket.close(_POLICY_VIOLATION, "too many messages that cannot be read")
                return
        news.set()


def _has_left(error: Exception) -> bool:
    from starlette.websockets import WebSocketDisconnect

    # a RuntimeError comes from sending to a page that has just left
    return isinstance(error, WebSocketDisconnect | RuntimeError | ConnectionError)


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
    except OSError as error:
        listening.close()
        raise RobocupVisionError(
            f"the page cannot be served at {host}, port {port}: {error.strerror or error} (--port takes another one)"
        ) from None
    return listening
