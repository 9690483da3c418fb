"""The search for loop closures of a project: pairs beyond neighbours that whole logs bear out."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from typing import Any

from app.jobs import Check, checker
from app.matching import Settings
from app.modes import parameters_in
from app.pairs import are_neighbours
from segmap.errors import CancelledError, SegmapError
from segmap.events import IntegrationId, Proposal
from segmap.graph import Residual
from segmap.integration import DEFAULT_HEURISTIC, Match
from segmap.links import Link
from segmap.mapping import WholeMap, map_scans
from segmap.parameters import Parameters
from segmap.project import ProjectState
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.spreading import Pair

__all__ = ["SEARCH", "WORKERS", "Closure", "Found", "LoopSearch", "Searching", "find_closures"]

MODE = "verified"
"""the mode in which whole logs are searched, whatever that of the project"""
CLOSING = ("closed", "joined", "voted")
"""what links are that bring something beyond the neighbours of each log"""
SEARCH = "loop search"
"""who proposes"""
WORKERS = max(1, min(4, os.cpu_count() or 1))
"""processes"""
STEPS = 50
"""in which progress is told"""
JOIN_SECONDS = 3.0
log = logging.getLogger(__name__)

Extractor = Callable[[ScanId, Parameters], SegmentMap]
Told = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Closure:
    """A pair beyond neighbours that the search takes for true."""

    link: Link
    match: Match
    residual: Residual
    """in the graph of the whole map the search made"""

    @property
    def integration(self) -> str:
        """Its name in the queue."""
        return str(IntegrationId(self.link.first, self.link.second))

    @property
    def value(self) -> float:
        """Metres, of the candidate it takes."""
        return self.match.ranked[self.link.rank].value

    @property
    def proposal(self) -> Proposal:
        """What is put into the project."""
        link = self.link
        return Proposal(
            integration=self.integration, kind="closure", T_1_2=link.T_1_2, covariance=link.covariance, source=SEARCH
        )


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found."""

    closures: tuple[Closure, ...]
    """the surest first"""
    matches: Mapping[str, Match]
    """of every pair that was matched, by name"""
    settings: Settings
    """under which"""
    heuristic: str = DEFAULT_HEURISTIC[MODE]

    def in_words(self, new: int) -> str:
        """What came of it, where so many of the closures were not in the queue before."""
        count = len(self.closures)
        if not count:
            return "No loop closure was found."
        told = "1 loop closure was found" if count == 1 else f"{count} loop closures were found"
        return f"{told}; {new} {'is' if new == 1 else 'are'} new in the queue."


def find_closures(
    state: ProjectState,
    scan_ids: Iterable[ScanId],
    extractor: Extractor,
    *,
    workers: int = WORKERS,
    progress: Told | None = None,
    check: Check | None = None,
) -> Found:
    """Search all logs of a project for closures; nothing is decided.

    Raises:
        CancelledError: raised by ``check``.
    """
    settings = Settings(parameters_in(MODE, state), MODE)
    scans = list(scan_ids)
    maps: dict[ScanId, SegmentMap] = {}
    for scan in scans:
        if check is not None:
            check()
        maps[scan] = extractor(scan, settings.parameters)
        if progress is not None:
            progress("extracting segments", len(maps), len(scans))
    whole = map_scans(maps, settings.searched, workers=workers, progress=progress, check=check)
    closures = sorted(_closures(whole), key=lambda c: (-c.link.confidence, c.link.pair))
    return Found(tuple(closures), {_name(pair): match for pair, match in whole.matches.items()}, settings)


def _closures(whole: WholeMap) -> Iterator[Closure]:
    for link, residual in zip(whole.links, whole.optimised.residuals, strict=True):
        if link.why in CLOSING and link.pair in whole.matches and not are_neighbours(*link.pair):
            yield Closure(link, whole.matches[link.pair], residual)


def _name(pair: Pair) -> str:
    return str(IntegrationId(*pair))


# --- in the background ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Searching:
    """How far a search is."""

    running: bool = False
    done: int = 0
    total: int = 0
    message: str = ""
    """for people; of the last search where none runs"""

    def to_json(self) -> dict[str, Any]:
        """As the pages get it."""
        return asdict(self)


class LoopSearch:
    """One search at a time, in a thread of its own; it can be stopped.

    ``search`` does it and says in a sentence what came of it; ``changed`` hears of progress.
    """

    def __init__(self, search: Callable[[Told, Check], str], changed: Callable[[], None]) -> None:
        self._search, self._changed = search, changed
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self.progress = Searching()

    def start(self) -> None:
        """Begin a search, unless one runs."""
        with self._lock:
            if self.progress.running:
                return
            self._stop.clear()
            self._thread = threading.Thread(target=self._run, name="searching", daemon=True)
            self.progress = Searching(True, message="The search for loop closures begins.")
            self._thread.start()
        self._changed()

    def cancel(self) -> None:
        """Stop the search; nothing is proposed by it."""
        with self._lock:
            if not self.progress.running:
                return
            self._stop.set()
            self.progress = Searching(True, self.progress.done, self.progress.total, "The search is being stopped.")
        self._changed()

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until no search runs; False when the time, in seconds, ran out before."""
        thread = self._thread
        if thread is not None:
            thread.join(timeout)
        return thread is None or not thread.is_alive()

    def close(self) -> None:
        """Stop and wait a moment."""
        self._stop.set()
        self.settle(JOIN_SECONDS)

    def _run(self) -> None:
        try:
            message = self._search(self._told, checker(self._stop))
        except CancelledError:
            message = "The search for loop closures was stopped; nothing was proposed."
        except SegmapError as error:
            message = f"The search for loop closures failed: {error}"
        except BrokenProcessPool:
            message = "The search for loop closures failed: a process of it was ended from outside, as when memory runs"
            message += " out. Close other programs and search again."
        except Exception as error:
            log.exception("The search for loop closures failed.")
            message = f"The search for loop closures failed: {type(error).__name__}. The server's output says where."
        with self._lock:
            self.progress = Searching(message=message)
        self._changed()

    def _told(self, what: str, done: int, total: int) -> None:
        before, message = self.progress, f"Searching for loops, {what}: {done} of {total}"
        if self._stop.is_set() or (
            done < total and done * STEPS // total == before.done * STEPS // max(1, before.total)
        ):
            return
        with self._lock:
            if not self._stop.is_set():
                self.progress = Searching(True, done, total, message)
        self._changed()
