"""The review queue of a session: its rows, who skipped which, and what other thresholds would flip."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from app.criterion import CRITERIA, Criterion
from app.later import Later
from app.listing import Listed, Listing
from app.loops import Loops
from app.matching import Matching
from app.queue_text import QueueText, QueueTexts
from app.review import Flips, Key, Row, Rows, flips, order
from segmap.graph import Part
from segmap.project import ProjectState

__all__ = ["Queueing"]


class Queueing(ABC):
    """The queue of a session; what it lists is the session's. Thread-safe."""

    loops: Loops
    _lock: threading.RLock
    _state: ProjectState
    _integrations: tuple[str, ...]
    _matching: Matching
    _rows: Rows
    _later: Later
    _texts: QueueTexts
    _listing: Listing
    _stale: set[str] | None = None
    """integrations whose rows may be others now; None: all, and the order too"""
    _parts: frozenset[Part] = frozenset()
    """the components of the graph that the rows are of"""

    @abstractmethod
    def _checked(self, integration: str) -> str: ...

    @abstractmethod
    def _tell_all(self, event: Mapping[str, Any]) -> None: ...

    def row(self, integration: str) -> Row:
        """An integration as the queue shows it."""
        state = self._state
        outcome = self._matching.outcome(self._checked(integration), state.heuristic)
        return self._rows.row(integration, state, outcome, self.loops.graph, integration in self._later)

    def put_off(self, integration: str) -> None:
        """Skip an integration for now: in the queue it comes after the others that wait. Nothing is decided."""
        if self._later.add(self._checked(integration)):
            self._resort([integration])
            self._tell_all({"type": "later", "rows": [self.row(integration).to_json()]})

    def rows(self) -> list[Row]:
        """The review queue, the integration that most needs a person first."""
        return list(self.listed.rows)

    def queue_text(self, since: str = "") -> QueueText:
        """The same as the pages get it; to who has the queue of the tag ``since``, what changed."""
        return self._texts.of(self.listed.rows, since)

    @property
    def listed(self) -> Listed:
        """The queue as it is now; the same object as long as it is the same."""
        with self._lock:
            stale, held = self._stale, self._listing
            if stale is None:
                held.replace(map(self.row, self._integrations), self._order())
            elif stale:
                held.update(map(self.row, stale & held.now.places.keys()), self._order())
            self._stale = set()
            return held.now

    def _order(self) -> Callable[[Row], Key]:
        return order(self._state.mode, self._state.parameters)

    def counts(self) -> Mapping[str, int]:
        """How many integrations there are, in all and in each state."""
        return self.listed.counts

    @property
    def criterion(self) -> Criterion:
        """What the threshold is about in the project's mode."""
        return CRITERIA[self._state.mode]

    def preview_threshold(self, value: float) -> Flips:
        """The undecided integrations that another threshold of the criterion would flip.

        Raises:
            ParameterError: it is out of bounds.
        """
        state, criterion = self._state, self.criterion
        parameters = criterion.moved(state.parameters, value)
        low, high = sorted((value, criterion.threshold(state.parameters)))
        pending = [row for row in self.listed.rows if row.state == "pending" and _between(low, criterion.of(row), high)]
        found = (self._matching.outcome(row.id, state.heuristic) for row in pending)
        moved = (self._rows.moved(row, state, one, parameters) for row, one in zip(pending, found, strict=True))
        return flips(pending, moved)

    def _resort(self, integrations: Iterable[str] | None = None) -> None:
        """The rows of these may be others now; None: of all, or there are others."""
        with self._lock:
            self._stale = None if self._stale is None or integrations is None else self._stale.union(integrations)

    def _regraph(self) -> None:
        """The same after the graph was optimised: of what was, or now is, in components that changed."""
        with self._lock:
            parts, held = frozenset(self.loops.graph.optimised.parts), self._parts
            moved = {scan for part in parts ^ held for scan in part.scans}
            self._parts = parts
            self._resort(row.id for row in self._listing.now.rows if row.first in moved or row.second in moved)


def _between(low: float, quantity: float | None, high: float) -> bool:
    """Whether moving a threshold from one to the other can matter to what has this quantity; to others it cannot."""
    return quantity is None or low <= quantity <= high
