"""The page over HTTP and its socket: what is served, who is let in, and what happens to those who misbehave."""

import contextlib
import json
import re
import socket
import struct
import threading
import urllib.request

import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.live.handover.controls import Controls
from robocup_vision.live.page.picture import split_picture
from robocup_vision.live.page.server import MAX_BAD_MESSAGES, MAX_PAGES, PageServer, allowed_hosts, make_app, page_files

HOST = "127.0.0.1:8090"
ORIGIN = {"host": HOST, "origin": f"http://{HOST}"}


@pytest.fixture
def client(feed):
    with TestClient(make_app(feed, Controls(), allowed_hosts("127.0.0.1", 8090)), base_url=f"http://{HOST}") as made:
        yield made


def receive(link):
    got = link.receive()
    if got["type"] == "websocket.close":
        raise WebSocketDisconnect(got["code"])
    return got


def receive_json(link, kind):
    """Return the next message of a kind."""
    for _ in range(20):
        got = receive(link)
        if got.get("text") is not None:
            told = json.loads(got["text"])
            if told["type"] == kind:
                return told
    raise AssertionError(f"no message {kind!r}")


def receive_picture(link):
    for _ in range(20):
        got = receive(link)
        if got.get("bytes") is not None:
            return split_picture(got["bytes"])
    raise AssertionError("no picture")


def test_the_page_needs_nothing_from_elsewhere(client):
    answer = client.get("/")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/html")
    named = re.findall(r"<(?:script|link)[^>]+(?:src|href)=\"(?!data:)([^\"]+)\"", answer.text)
    assert named
    # a module names others
    seen = {}
    while named:
        name = named.pop()
        if name in seen:
            continue
        seen[name] = client.get(f"/{name}")
        assert seen[name].status_code == 200, name
        kind = {"js": "text/javascript", "css": "text/css"}[name.rpartition(".")[2]]
        assert seen[name].headers["content-type"].startswith(kind)
        named += re.findall(r"from \"\./([^\"]+)\"", seen[name].text)
    for text in (answer.text, *(one.text for one in seen.values())):
        assert re.findall(r"(?:https?:|wss?:)//[^\s\"'`)]+", text) == []
    # nothing is served that the page does not use
    assert {*seen, "page.html"} == set(page_files())


def test_the_policy_lets_nothing_in_but_the_page_itself(client):
    for path in ("/", "/main.js"):
        policy = client.get(path).headers["content-security-policy"]
        assert policy.startswith("default-src 'none'")
        assert "script-src 'self';" in policy
        assert "style-src 'self';" in policy
        assert "connect-src 'self'" in policy
        assert "frame-ancestors 'none'" in policy
        assert "unsafe-inline" not in policy


def test_a_script_is_not_given_to_another_host(client):
    assert client.get("/main.js", headers={"host": "elsewhere.example:8090"}).status_code == 400


@pytest.mark.parametrize("path", ["/etc/passwd", "/../pyproject.toml", "/page.html", "/live/x", "/%2e%2e/secret"])
def test_there_is_no_other_path(client, path):
    assert client.get(path).status_code == 404


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1:9999", "localhost:80", ""])
def test_a_name_that_was_pointed_here_is_refused(client, host):
    assert client.get("/", headers={"host": host}).status_code == 400


@pytest.mark.parametrize(
    "headers",
    [
        {"host": HOST, "origin": "http://evil.example"},
        {"host": HOST, "origin": "null"},
        {"host": HOST, "origin": "https://127.0.0.1:8090"},
        {"host": HOST, "origin": "http://127.0.0.1:8091"},
        {"host": "evil.example", "origin": "http://evil.example"},
    ],
)
def test_a_page_of_another_origin_is_refused(client, headers):
    with pytest.raises(WebSocketDisconnect), client.websocket_connect("/live", headers=headers) as link:
        link.receive()


def test_own_pages_and_programs_are_let_in(client):
    for headers in (ORIGIN, {"host": HOST}, {"host": "localhost:8090", "origin": "http://localhost:8090"}):
        with client.websocket_connect("/live", headers=headers) as link:
            assert receive_json(link, "hello")["robots"][0]["name"] == "robot"


def test_a_page_gets_what_was_seen(client, feed, moment):
    with client.websocket_connect("/live", headers=ORIGIN) as link:
        assert receive_json(link, "status")["lines"] == []
        feed.put(moment(1.5))
        told, jpeg, _ = receive_picture(link)
        assert told["t_s"] == 1.5
        assert jpeg.startswith(b"\xff\xd8")
        feed.say("hello")
        assert receive_json(link, "status")["lines"][0].endswith("hello")


def test_messages_are_checked(client):
    with client.websocket_connect("/live", headers=ORIGIN) as link:
        link.send_text('{"type": "pause", "on": "yes"}')
        assert "cannot be read" in receive_json(link, "refused")["reason"]
        link.send_text('{"type": "open", "recording": "../../etc/passwd"}')
        assert "no recordings can be opened" in receive_json(link, "refused")["reason"]
        link.send_bytes(b"\x00")
        assert "must be text" in receive_json(link, "refused")["reason"]


def test_a_page_that_sends_rubbish_is_sent_away(client):
    with client.websocket_connect("/live", headers=ORIGIN) as link:
        for _ in range(MAX_BAD_MESSAGES):
            link.send_text("rubbish")
            receive_json(link, "refused")
        with pytest.raises(WebSocketDisconnect):
            receive_json(link, "refused")


def test_pages_are_limited_in_number(client):
    with contextlib.ExitStack() as stack:
        for _ in range(MAX_PAGES):
            receive_json(stack.enter_context(client.websocket_connect("/live", headers=ORIGIN)), "hello")
        with pytest.raises(WebSocketDisconnect), client.websocket_connect("/live", headers=ORIGIN) as link:
            receive_json(link, "hello")
    # when they have left there is room again
    with client.websocket_connect("/live", headers=ORIGIN) as link:
        receive_json(link, "hello")


@pytest.fixture
def server(feed):
    made = PageServer(feed, Controls(), port=0)
    made.start()
    yield made
    made.close()


def test_it_listens_on_the_loopback_alone(server):
    assert server.address == f"http://127.0.0.1:{server.port}/"
    assert not server.is_public
    with urllib.request.urlopen(server.address, timeout=5.0) as answer:
        assert b"robocup-vision live" in answer.read()
    with pytest.raises(ConnectionRefusedError), socket.create_connection(("127.0.0.2", server.port), timeout=1.0):
        pass


def test_a_page_that_breaks_off_harms_nobody(server, feed, moment):
    with socket.create_connection(("127.0.0.1", server.port), timeout=5.0) as link:
        link.sendall(
            f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        link.recv(10)
        # the connection is reset, not closed
        link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    for number in range(3):
        feed.put(moment(float(number)))
        assert feed.wait_until_made(20.0)
    with urllib.request.urlopen(server.address, timeout=5.0) as answer:
        assert answer.status == 200


def test_a_port_that_is_taken_is_named(server, feed):
    with pytest.raises(RobocupVisionError, match=f"port {server.port}.*--port"):
        PageServer(feed, Controls(), port=server.port).start()


@pytest.mark.parametrize(
    ("port", "host", "said"),
    [
        (-1, "127.0.0.1", "port must be 0 to 65535"),
        (70000, "127.0.0.1", "port must be 0 to 65535"),
        (0, "no address", "host must be an IP address"),
    ],
)
def test_addresses_that_are_none_are_refused(feed, port, host, said):
    with pytest.raises(ArgumentError, match=said):
        PageServer(feed, Controls(), port=port, host=host)


def test_it_ends_with_its_thread(feed):
    made = PageServer(feed, Controls(), port=0)
    made.start()
    made.close()
    assert "live page" not in {thread.name for thread in threading.enumerate()}
