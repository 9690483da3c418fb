"""A viser server that nobody outside reaches, and that prints nothing."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import rich
import viser

__all__ = ["QuietServer"]

_console = threading.Lock()


class QuietServer(viser.ViserServer):
    """On the loopback interface, at a port of its own; offers no tunnel to the outside."""

    def __init__(self) -> None:
        with _quiet():
            super().__init__(host="127.0.0.1", port=0, label="segmap", verbose=False)

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002 (viser's signature)
        """Never: hiding the button alone would not stop a page from asking."""
        return None

    def stop(self) -> None:
        """Stop serving."""
        with _quiet():
            super().stop()


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
