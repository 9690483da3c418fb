"""Server-sent events: what happens in a session and in a view, as one stream for each page."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import AbstractContextManager, ExitStack, suppress
from typing import Any

__all__ = ["Event", "Streams", "Subscribe"]

Event = Mapping[str, Any]
Subscribe = Callable[[Callable[[Event], None]], Callable[[], None]]
"""Takes a callback, gives back what ends the subscription."""

HEARTBEAT_SECONDS = 15.0
WAITING_EVENTS = 2000
"""a page that is this far behind is cut off: it connects again and loads what it missed"""
RETRY = "retry: 1000\n\n"


class Streams:
    """All open streams; closing them lets the server stop while pages are still listening."""

    def __init__(self, heartbeat_seconds: float = HEARTBEAT_SECONDS) -> None:
        self._heartbeat_seconds = heartbeat_seconds
        self._open: set[_Mailbox] = set()
        self._closed = False

    def __len__(self) -> int:
        return len(self._open)

    async def stream(
        self, sources: Iterable[Subscribe], *, first: Event, holding: Iterable[AbstractContextManager[Any]] = ()
    ) -> AsyncIterator[str]:
        """Events of all sources as text, until the page goes away or the server stops.

        ``first`` comes before all others; ``holding`` is held as long as the stream is open.
        """
        mailbox = _Mailbox(asyncio.get_running_loop())
        with ExitStack() as stack:
            for held in holding:
                stack.enter_context(held)
            self._open.add(mailbox)
            stack.callback(self._open.discard, mailbox)
            for subscribe in sources:
                stack.callback(subscribe(mailbox.put))
            yield RETRY + _text(first)
            while not self._closed and (text := await self._next(mailbox)) is not None:
                yield text

    def close(self) -> None:
        """End all streams, and those that are opened from now on. To be called on the event loop."""
        self._closed = True
        for mailbox in list(self._open):
            mailbox.end()

    async def _next(self, mailbox: _Mailbox) -> str | None:
        try:
            event = await asyncio.wait_for(mailbox.queue.get(), self._heartbeat_seconds)
        except TimeoutError:
            return ": nothing new\n\n"
        return None if event is None else _text(event)


class _Mailbox:
    """Events on their way from any thread to one stream."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.queue: asyncio.Queue[Event | None] = asyncio.Queue(WAITING_EVENTS)
        self._loop = loop

    def put(self, event: Event) -> None:
        with suppress(RuntimeError):  # the loop is closed: nobody listens any more
            self._loop.call_soon_threadsafe(self._offer, event)

    def end(self) -> None:
        """Let the stream end, whatever still waits in it."""
        with suppress(asyncio.QueueEmpty):
            while True:
                self.queue.get_nowait()
        self.queue.put_nowait(None)

    def _offer(self, event: Event) -> None:
        if self.queue.full():
            self.end()
        else:
            self.queue.put_nowait(event)


def _text(event: Event) -> str:
    return f"data: {json.dumps(event, separators=(',', ':'), allow_nan=False)}\n\n"
