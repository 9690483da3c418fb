"""A viser server for one view, that only our own proxy can talk to."""

from __future__ import annotations

import secrets
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import rich
import viser
from viser.infra import WebsockClientConnection

__all__ = ["PASS_HEADER", "QuietServer"]

PASS_HEADER = "X-Segmap-Pass"
FORBIDDEN = 1008
_console = threading.Lock()


class QuietServer(viser.ViserServer):
    """On the loopback interface, at a port of its own; offers no tunnel to the outside and prints nothing.

    Loopback alone stops no page in this machine's browsers from trying ports, and viser asks for no
    origin. So a socket is closed, before it is told anything, unless it brings ``secret`` in its header.
    """

    def __init__(self) -> None:
        self.secret = secrets.token_urlsafe(24)
        with _quiet():
            super().__init__(host="127.0.0.1", port=0, label="segmap", verbose=False)
        self._websock_server.on_client_connect(self._check)
        self._websock_server.disconnect_all_clients()  # whoever came before the line above

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002 (viser's signature)
        """Never: hiding the button alone would not stop a page from asking."""
        return None

    def stop(self) -> None:
        """Stop serving."""
        with _quiet():
            super().stop()

    async def _check(self, client: WebsockClientConnection) -> None:
        connection = self._websock_server._live_connections[client.client_id]
        brought = connection.request.headers.get(PASS_HEADER, "") if connection.request else ""
        if not secrets.compare_digest(brought.encode(), self.secret.encode()):
            await connection.close(FORBIDDEN)


@contextmanager
def _quiet() -> Iterator[None]:
    """viser announces its start and stop on the console that the command line uses."""
    console = rich.get_console()
    with _console:
        before, console.quiet = console.quiet, True
        try:
            yield
        finally:
            console.quiet = before
