"""The review queue of a session: its rows, who skipped which, and what other thresholds would flip."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from app.criterion import CRITERIA, Criterion
from app.later import Later
from app.loops import Loops
from app.matching import Matching
from app.queue_text import QueueText, QueueTexts
from app.review import Flips, Row, Rows, counts, flips, queue
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
    _version = 0
    """of the rows: another one after every change"""
    _queue: tuple[int, tuple[Row, ...]] = (-1, ())

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
            self._resort()
            self._tell_all({"type": "later", "rows": [self.row(integration).to_json()]})

    def rows(self) -> list[Row]:
        """The review queue, the integration that most needs a person first."""
        return list(self._ordered())

    def queue_text(self) -> QueueText:
        """The same as the pages get it."""
        return self._texts.of(self._ordered())

    def _ordered(self) -> tuple[Row, ...]:
        """The same tuple as long as it holds the same rows."""
        with self._lock:
            version, held = self._queue
            if version != self._version:
                state, version = self._state, self._version
                found = tuple(queue(map(self.row, self._integrations), state.mode, state.parameters))
                held = held if found == held else found
                self._queue = (version, held)
            return held

    def counts(self) -> Mapping[str, int]:
        """How many integrations there are, in all and in each state."""
        return counts(self._ordered())

    @property
    def criterion(self) -> Criterion:
        """What the threshold is about in the project's mode."""
        return CRITERIA[self._state.mode]

    def preview_threshold(self, value: float) -> Flips:
        """The undecided integrations that another threshold of the criterion would flip.

        Raises:
            ParameterError: it is out of bounds.
        """
        state = self._state
        parameters = self.criterion.moved(state.parameters, value)
        pending = [row for row in self._ordered() if row.state == "pending"]
        found = (self._matching.outcome(row.id, state.heuristic) for row in pending)
        moved = (self._rows.moved(row, state, one, parameters) for row, one in zip(pending, found, strict=True))
        return flips(pending, moved)

    def _resort(self) -> None:
        with self._lock:
            self._version += 1
