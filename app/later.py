"""The integrations somebody skipped: they come back when the others are done. Thread-safe."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterable
from contextlib import suppress
from typing import Protocol

from segmap.errors import SegmapError

__all__ = ["Later"]

KEY = "later"
"""of the list among the results in the project file: no decision, but kept over a restart"""


class Results(Protocol):
    """The cache of results in a project file."""

    def put_result(self, key: str, text: str) -> None: ...
    def get_result(self, key: str) -> str | None: ...


class Later:
    """What was put off, by everybody who works on a project."""

    def __init__(self, store: Results) -> None:
        self._store, self._lock = store, threading.Lock()
        self._held = frozenset(_read(store.get_result(KEY)))

    def __contains__(self, integration: str) -> bool:
        return integration in self._held

    def add(self, integration: str) -> bool:
        """Put one off; False where it was already."""
        return self._keep(self._held | {integration})

    def discard(self, integrations: Iterable[str]) -> bool:
        """These are decided; False where none of them was put off."""
        return self._keep(self._held - set(integrations))

    def _keep(self, wanted: frozenset[str]) -> bool:
        with self._lock:
            if wanted == self._held:
                return False
            self._held = wanted
            with suppress(SegmapError):
                self._store.put_result(KEY, json.dumps(sorted(wanted)))
            return True


def _read(text: str | None) -> list[str]:
    try:
        held = json.loads(text or "[]")
    except ValueError:
        return []
    return [one for one in held if isinstance(one, str)] if isinstance(held, list) else []
