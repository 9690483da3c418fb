"""Who listens to a session."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from typing import Any

__all__ = ["Listener", "Listeners"]

Listener = Callable[[Mapping[str, Any]], None]
"""gets an event; must not block"""

log = logging.getLogger(__name__)


class Listeners:
    """Callbacks that hear of every event, from whichever thread it happened in; one that fails harms no other."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._listeners: tuple[Listener, ...] = ()

    def __len__(self) -> int:
        return len(self._listeners)

    def add(self, listener: Listener) -> Callable[[], None]:
        """Call ``listener`` with every event, until what is given back is called."""
        own = _Own(listener)
        with self._lock:
            self._listeners = (*self._listeners, own)
        return lambda: self._remove(own)

    def tell(self, event: Mapping[str, Any]) -> None:
        """Call all listeners."""
        for listener in self._listeners:
            try:
                listener(event)
            except Exception:
                log.exception("A listener failed on the event %s.", event.get("type"))

    def _remove(self, own: Listener) -> None:
        with self._lock:
            self._listeners = tuple(held for held in self._listeners if held is not own)


class _Own:
    """One subscription: the same callback may be added twice."""

    def __init__(self, listener: Listener) -> None:
        self._listener = listener

    def __call__(self, event: Mapping[str, Any]) -> None:
        self._listener(event)
