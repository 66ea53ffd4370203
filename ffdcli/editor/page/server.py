"""The server of the page: viser's, on the loopback alone, behind a guard."""

from __future__ import annotations

import http
import io
import logging
import secrets
import socket
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import viser
import websockets.asyncio.server as websocket_server
from viser import _messages as messages
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from ffdcli.editor.page.client import page_headers, page_html
from ffdcli.editor.page.guard import HOST, Guard
from ffdcli.errors import FfdError

# Bytes of randomness in the address.
_TOKEN = 24


@dataclass(frozen=True)
class Visits:
    """What happens when a tab opens its connection, and when it ends.

    Parameters
    ----------
    opened : callable
    ended : callable
        Takes whether the page was closed; a connection may end without that.
    """

    opened: Callable[[], None]
    ended: Callable[[bool], None]


@contextmanager
def serve(port: int, title: str, visits: Visits) -> Iterator[tuple[viser.ViserServer, str]]:
    """A running server and the address of its page.

    Parameters
    ----------
    port : int
        0 chooses a free one.
    title : str
        Of the browser's tab.
    visits : Visits

    Raises
    ------
    FfdError
        The port is in use.
    """
    with _bound(port) as listener:
        guard = Guard(listener.getsockname()[1], secrets.token_urlsafe(_TOKEN))
        with _guarded(guard, title, listener, visits) as is_guarded, redirect_stdout(io.StringIO()):
            server = viser.ViserServer(host=HOST, port=guard.port, verbose=False)
        try:
            if not is_guarded():
                raise FfdError(
                    f"viser {viser.__version__} opens its port in a way that is not known here",
                    hint="install the version that `ffdcli[edit]` names",
                )
            # viser can show a page to the whole network through a server of its own. Not this one.
            for kind in (messages.ShareUrlRequest, messages.ShareUrlDisconnect):
                server._websock_server.unregister_handler(kind)
            yield server, guard.address
        finally:
            with redirect_stdout(io.StringIO()):
                server.stop()


@contextmanager
def _bound(port: int) -> Iterator[socket.socket]:
    try:
        listener = socket.create_server((HOST, port))
    except OSError as error:
        raise FfdError(
            f"port {port} cannot be opened: {error.strerror or error}",
            hint="choose another with --port, or leave it out",
        ) from None
    with listener:
        yield listener


@contextmanager
def _guarded(
    guard: Guard, title: str, listener: socket.socket, visits: Visits
) -> Iterator[Callable[[], bool]]:
    """While it lasts, websocket servers open on one socket behind the guard.

    viser has no option for either. It opens one server, in a thread, before its constructor
    returns. The function that is yielded says whether it did.
    """
    original = websocket_server.serve
    used: list[bool] = []

    def serve_guarded(
        handler: Callable[[ServerConnection], Awaitable[None]],
        host: str,
        port: int,
        *,
        process_request: object,
        **options: Any,
    ) -> Any:
        used.append(True)

        async def visited(connection: ServerConnection) -> None:
            visits.opened()
            try:
                await handler(connection)
            finally:
                visits.ended(connection.close_code in _PAGE_CLOSED)

        return original(
            visited,
            sock=listener,
            process_request=_answering(guard, title),
            logger=_silent(),
            server_header=None,
            **options,
        )

    websocket_server.serve = serve_guarded
    try:
        yield lambda: bool(used)
    finally:
        websocket_server.serve = original


# Codes with which a browser ends the connection of a page that is left (RFC 6455, section 7.4.1).
_PAGE_CLOSED = (1000, 1001, 1005)


def _answering(guard: Guard, title: str) -> Callable[[ServerConnection, Request], Response | None]:
    document = page_html(Path(viser.__file__).parent / "client" / "build", title)
    fields = page_headers(guard.origin.replace("http", "ws", 1))

    def answer(connection: ServerConnection, request: Request) -> Response | None:
        upgrades = ",".join(request.headers.get_all("Upgrade")).lower()
        websocket = "websocket" in upgrades
        refusal = guard.refusal(request.path, request.headers, websocket=websocket)
        if refusal is not None:
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"refused: {refusal}\n")
        if websocket:
            return None
        headers = Headers({**fields, "Content-Length": str(len(document)), "Connection": "close"})
        return Response(http.HTTPStatus.OK, "OK", headers, document)

    return answer


def _silent() -> logging.Logger:
    """A logger that prints nothing: refused requests are no concern of the terminal."""
    logger = logging.getLogger("ffdcli.editor.page")
    logger.addHandler(logging.NullHandler())
    logger.propagate = False
    return logger
