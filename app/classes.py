"""Classes that follow a teacher's walkthrough: who holds the key moves it, who has the link sees where it is."""

from __future__ import annotations

import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from urllib.parse import parse_qsl

from app.errors import RequestError, UnknownError

__all__ = ["Classes", "Followed"]

LIMIT = 50
"""classes at a time; the one moved longest ago goes first"""
SECONDS = 12 * 3600.0
"""after which a class that nobody moved is over"""
NAMES = {"project", "sample", "pair", "merge", "node", "graph", "mode", "heuristic", "set", "stage", "step"}
"""what the address of a walkthrough may hold"""


@dataclass(frozen=True)
class Followed:
    """Where a class is."""

    id: str
    key: str
    """who knows it may move the class; never shown to those who follow"""
    place: str
    """the address of the view, after the question mark"""
    serial: int
    moved: float


class Classes:
    """The classes of a server. Thread-safe; nothing of it outlives the server."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._held: OrderedDict[str, Followed] = OrderedDict()

    def open(self, place: str) -> Followed:
        """A new class, at a place.

        Raises:
            RequestError: the place is not the address of a walkthrough.
        """
        made = Followed(secrets.token_urlsafe(9), secrets.token_urlsafe(18), _checked(place), 1, self._clock())
        with self._lock:
            self._held[made.id] = made
            while len(self._held) > LIMIT:
                self._held.popitem(last=False)
        return made

    def get(self, id: str) -> Followed:
        """Where a class is.

        Raises:
            UnknownError: there is no such class, or it is over.
        """
        with self._lock:
            found = self._held.get(id)
            if found is None or self._clock() - found.moved > SECONDS:
                self._held.pop(id, None)
                raise UnknownError("This class is over: ask for a new link.")
            return found

    def move(self, id: str, key: str, place: str) -> Followed:
        """Lead a class on.

        Raises:
            UnknownError: there is no such class, or the key is not its own.
            RequestError: the place is not the address of a walkthrough.
        """
        found = self.get(id)
        if not secrets.compare_digest(found.key.encode(), key.encode()):
            raise UnknownError("Only who shared this walkthrough can lead it.")
        with self._lock:
            moved = replace(found, place=_checked(place), serial=found.serial + 1, moved=self._clock())
            self._held[id] = moved
            self._held.move_to_end(id)
        return moved


def _checked(place: str) -> str:
    names = {name for name, _ in parse_qsl(place, keep_blank_values=True)}
    if not names or not names <= NAMES:
        raise RequestError("A class can only be led to a walkthrough.")
    return place
