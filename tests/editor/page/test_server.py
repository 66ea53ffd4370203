"""The server of the page: what it answers, with real sockets."""

from __future__ import annotations

import http.client
import socket
import threading

import pytest

pytest.importorskip("viser")

from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from ffdcli.editor.page.server import Visits, serve
from ffdcli.errors import FfdError


@pytest.fixture(scope="module")
def page():
    """A server, its address, and what it says of visits."""
    ended = threading.Event()
    visits = []

    def left(closed):
        visits.append(closed)
        ended.set()

    with serve(0, "a </script><b>.obj", Visits(lambda: visits.append("opened"), left)) as (
        server,
        address,
    ):
        yield server, address, visits, ended


@pytest.fixture(scope="module")
def place(page):
    """Host, port and path of the page."""
    host, path = page[1].removeprefix("http://").split("/", 1)
    name, port = host.split(":")
    return name, int(port), "/" + path


def status(place, path=None, method="GET", **headers) -> int:
    """Status of a request, whose header fields replace those that are usual; None drops one."""
    host, port, own = place
    fields = {"Host": f"{host}:{port}", **{k.replace("_", "-"): v for k, v in headers.items()}}
    lines = [f"{method} {own if path is None else path} HTTP/1.1"]
    for key, value in fields.items():
        lines += [f"{key}: {each}" for each in (value if isinstance(value, list) else [value])]
    with socket.create_connection((host, port), timeout=10) as stream:
        stream.sendall("\r\n".join([*lines, "", ""]).encode())
        answer = http.client.HTTPResponse(stream, method=method)
        try:
            answer.begin()
        except (http.client.BadStatusLine, ConnectionError):
            return 0
        answer.read()
        return answer.status


def test_the_printed_address_shows_the_page(place):
    host, port, path = place
    connection = http.client.HTTPConnection(host, port, timeout=10)
    connection.request("GET", path)
    answer = connection.getresponse()
    body = answer.read()
    assert answer.status == 200
    assert b"beforeunload" in body
    script = body[: body.index(b"</script>")]
    assert b"delay === 50 ? 16 : delay" in script
    assert b"<title>a &lt;/script&gt;&lt;b&gt;.obj</title>" in body
    policy = answer.headers["Content-Security-Policy"]
    assert f"ws://{host}:{port}" in policy
    assert "frame-ancestors 'none'" in policy
    assert answer.headers["Cache-Control"] == "no-store"


def test_only_the_loopback_listens(place):
    assert place[0] == "127.0.0.1"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # No packet is sent; the system names the address that it would send from.
            probe.connect(("192.0.2.1", 9))
            outward = probe.getsockname()[0]
        except OSError:
            pytest.skip("this machine has no address besides the loopback")
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((outward, place[1]), timeout=2).close()


def test_without_the_token_nothing_is_answered(place):
    token = place[2].strip("/")
    assert len(token) >= 32
    wrong = token[:-1] + ("a" if token[-1] != "a" else "b")
    for path in ("/", "/index.html", f"/{wrong}/", f"/{token}", f"/{token}x/", f"/{token[:-1]}/"):
        assert status(place, path) == 403


def test_paths_that_walk_out_or_ask_for_more_are_refused(place):
    own = place[2]
    for tail in (
        "../../etc/passwd",
        "%2e%2e/%2e%2e/etc/passwd",
        "..%5c..%5cetc",
        "index.html",
        "?websocket=ws://example.org",
        "?playbackPath=/etc/passwd",
        "/etc/passwd",
    ):
        assert status(place, own + tail) == 403


def test_another_name_of_the_machine_is_refused(place):
    port = place[1]
    for host in ("localhost", f"localhost:{port}", "example.org", f"127.0.0.1:{port}.example.org"):
        assert status(place, Host=host) == 403
    assert status(place, Host=[f"127.0.0.1:{port}"] * 2) == 403


def test_requests_of_other_pages_are_refused(place):
    own = f"http://127.0.0.1:{place[1]}"
    assert status(place, Origin=own) == 200
    for origin in (
        "null",
        "http://example.org",
        f"http://localhost:{place[1]}",
        "http://127.0.0.1",
    ):
        assert status(place, Origin=origin) == 403
    assert status(place, Sec_Fetch_Site="none", Sec_Fetch_Dest="document") == 200
    assert status(place, Sec_Fetch_Site="cross-site", Sec_Fetch_Dest="iframe") == 403
    assert status(place, Sec_Fetch_Site="same-site", Sec_Fetch_Dest="script") == 403


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "HEAD", "CONNECT"])
def test_only_get_is_answered(place, method):
    assert status(place, method=method) != 200


def test_websockets_need_token_origin_and_host(place, page):
    host, port, path = place
    own = f"ws://{host}:{port}{path.rstrip('/')}"
    origin = f"http://{host}:{port}"
    refused = [
        (f"ws://{host}:{port}", origin),
        (f"ws://{host}:{port}/", origin),
        (own + "x", origin),
        (own + "/", origin),
        (own, None),
        (own, "http://example.org"),
        (own, f"http://localhost:{port}"),
        (own.replace(host, "localhost"), origin),
    ]
    for address, comes_from in refused:
        with pytest.raises(InvalidStatus) as caught:
            connect(address, origin=comes_from, sock=_to(host, port)).close()
        assert caught.value.response.status_code == 403
    assert "opened" not in page[2]
    page[3].clear()
    with connect(own, origin=origin, open_timeout=10):
        pass
    assert page[3].wait(10)
    assert page[2][0] == "opened"


def _to(host, port):
    return socket.create_connection((host, port), timeout=10)


def test_the_scene_cannot_be_shared_with_the_network(page):
    from viser import _messages

    handlers = page[0]._websock_server._incoming_handlers
    assert not handlers.get(_messages.ShareUrlRequest)


def test_a_port_in_use_is_refused_in_one_sentence(place):
    visits = Visits(lambda: None, lambda closed: None)
    with (
        pytest.raises(FfdError, match=f"port {place[1]} cannot be opened"),
        serve(place[1], "", visits),
    ):
        pass


def test_garbage_does_not_end_the_server(place):
    with socket.create_connection(place[:2], timeout=10) as stream:
        stream.sendall(b"\x16\x03\x01\x02\x00\x01\x00\r\n\r\n")
        stream.recv(4096)
    assert status(place) == 200
