"""Which requests to the server of the page are answered: those of the page's own address alone."""

from __future__ import annotations

import hmac
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

HOST = "127.0.0.1"


class Headers(Protocol):
    """Header fields of a request; a field may stand several times."""

    def get_all(self, key: str) -> Sequence[str]:
        """All values of a field, whatever the case of its name."""


@dataclass(frozen=True)
class Guard:
    """The address of the page: the port, and a secret that stands in the path.

    Another page that the browser shows may send requests to any port of this machine, and a name of
    its own may lead there. Neither knows the token, and the browser tells the server where a
    request comes from.

    Parameters
    ----------
    port : int
    token : str
        Letters, digits, ``-`` and ``_``.
    """

    port: int
    token: str

    @property
    def origin(self) -> str:
        """Scheme, host and port of the page."""
        return f"http://{HOST}:{self.port}"

    @property
    def address(self) -> str:
        """Address of the page, token included."""
        return f"{self.origin}/{self.token}/"

    def refusal(self, path: str, headers: Headers, *, websocket: bool) -> str | None:
        """Why a request is refused, as a sentence; None if it is one of the page.

        Parameters
        ----------
        path : str
            As it stands in the request line.
        headers : Headers
        websocket : bool
            Whether the request opens a websocket. A browser names the origin of each of these.
        """
        if list(headers.get_all("Host")) != [f"{HOST}:{self.port}"]:
            return "the request names another host"
        origins = list(headers.get_all("Origin"))
        if origins != [self.origin] and (websocket or origins):
            return "the request comes from another page"
        sites, uses = headers.get_all("Sec-Fetch-Site"), headers.get_all("Sec-Fetch-Dest")
        if set(sites) - {"none", "same-origin"} and list(uses) != ["document"]:
            return "the request comes from another page"
        # The client of the websocket leaves out the last slash.
        own = f"/{self.token}" if websocket else f"/{self.token}/"
        if not hmac.compare_digest(path.encode(), own.encode()):
            return "the address is not that which `ffd edit` has printed"
        return None
