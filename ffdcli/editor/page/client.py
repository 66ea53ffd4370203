"""The HTML document of the page: viser's client and what `ffd edit` adds to it."""

from __future__ import annotations

import html
from pathlib import Path

from ffdcli.messages import printable

# Milliseconds between two positions of the mouse that the page sends.
_PAUSE = 16
_HEAD = b"<head>"


def page_html(client: Path, title: str) -> bytes:
    """The document.

    Parameters
    ----------
    client : Path
        Folder of viser's client; one file holds all of it.
    title : str
        Of the browser's tab.
    """
    script = (Path(__file__).parent / "client.js").read_text()
    script = script.replace("{{pause}}", str(_PAUSE))
    document = (client / "index.html").read_bytes()
    name = f"<title>{html.escape(printable(title))}</title>".encode()
    document = document.replace(b"<title>Viser</title>", name, 1)
    return document.replace(_HEAD, _HEAD + f"<script>{script}</script>".encode(), 1)


def page_headers(websocket: str) -> dict[str, str]:
    """Header fields of the document: it is kept nowhere, and it opens connections only to us.

    Parameters
    ----------
    websocket : str
        Scheme, host and port of the websocket.
    """
    policy = (
        "default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval'; "
        f"connect-src 'self' data: blob: {websocket}; frame-ancestors 'none'; base-uri 'none'; "
        "form-action 'none'"
    )
    return {
        "Content-Type": "text/html; charset=utf-8",
        "Content-Security-Policy": policy,
        "Cache-Control": "no-store",
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
    }
