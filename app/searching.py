"""The search for loop closures of a project: pairs beyond neighbours that whole logs bear out."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from typing import Any

from app.jobs import Check, checker
from app.kept import KeptMatches, ResultStore
from app.matching import Settings
from app.modes import parameters_in
from segmap.errors import CancelledError, SegmapError
from segmap.events import IntegrationId, Proposal
from segmap.graph import Residual
from segmap.integration import DEFAULT_HEURISTIC, Match
from segmap.links import Link
from segmap.mapping import WholeMap, map_scans
from segmap.parameters import Parameters
from segmap.project import ProjectState
from segmap.revisits import Proposed, Revisit, neighbours, proposed
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.spreading import Told, spread

__all__ = ["SEARCH", "WORKERS", "Closure", "Found", "LoopSearch", "Searching", "find_closures", "new_proposals"]

MODE = "verified"
"""the mode in which whole logs are searched, whatever that of the project"""
SEARCH = "loop search"
"""who proposes"""
TIES = f"{SEARCH}, as it ties what nothing else ties"
"""of a pair that is no revisit"""
WORKERS = max(1, min(4, os.cpu_count() or 1))
"""processes"""
STEPS = 50
"""in which progress is told"""
JOIN_SECONDS = 3.0
log = logging.getLogger(__name__)

Extractor = Callable[[ScanId, Parameters], SegmentMap]


@dataclass(frozen=True, eq=False)
class Closure:
    """A pair that the search takes for true, and that a person is asked about."""

    link: Link
    match: Match
    residual: Residual
    """in the graph of the whole map the search made"""
    why: str
    """for people: what it stands for"""

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
            integration=self.integration, kind="closure", T_1_2=link.T_1_2, covariance=link.covariance, source=self.why
        )


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found."""

    closures: tuple[Closure, ...]
    """those to be asked about, the surest first"""
    revisits: int = 0
    """times that a robot comes back past a place, or another one comes past"""
    others: int = 0
    """closures that say the same as one of those"""
    silenced: int = 0
    """closures that the others contradict"""

    def in_words(self, new: int) -> str:
        """What came of it, where so many of the closures were not in the queue before."""
        count = len(self.closures)
        if not count:
            return "No loop closure was found."
        told = "1 loop closure is proposed" if count == 1 else f"{count} loop closures are proposed"
        said = [
            f"{told}, for {_counted(self.revisits, 'revisit')}; {new} {'is' if new == 1 else 'are'} new in the queue."
        ]
        if self.others:
            said.append(f"{_counted(self.others, 'more pair')} say the same and are left out.")
        if self.silenced:
            said.append(f"{_counted(self.silenced, 'pair')} that the others contradict: left out, too.")
        return " ".join(said)


def _counted(count: int, what: str) -> str:
    return f"{count:,} {what}{'' if count == 1 else 's'}"


def find_closures(
    state: ProjectState,
    scan_ids: Iterable[ScanId],
    extractor: Extractor,
    *,
    store: ResultStore | None = None,
    workers: int = WORKERS,
    backend: str = "processes",
    every: bool = False,
    progress: Told | None = None,
    check: Check | None = None,
) -> Found:
    """Search all logs of a project for closures; nothing is decided.

    Each match is kept in ``store`` as it is found and taken from there, so that a search that was stopped, or
    killed, goes on where it was. A few closures of each revisit are found worth asking about, or ``every`` one.

    Raises:
        CancelledError: raised by ``check``.
    """
    settings = Settings(parameters_in(MODE, state), MODE)
    maps = _extracted(list(scan_ids), extractor, settings.parameters, progress or _nobody, check)
    kept = None if store is None else KeptMatches(store, settings.key(DEFAULT_HEURISTIC[MODE]))
    keep, told = None if kept is None else kept.keep, progress or _nobody
    whole = map_scans(
        maps,
        settings.searched,
        workers=workers,
        backend=backend,
        known=kept,
        keep=keep,
        progress=progress,
        check=check,
    )
    beside = spread(
        maps,
        neighbours(whole.scans),
        settings.searched,
        workers=workers,
        backend=backend,
        known=whole.matches if kept is None else kept,
        keep=keep,
        progress=lambda done, total: told("matching neighbours", done, total),
        check=check,
    )
    return _found(whole, proposed(whole, dict(beside)), every)


def _nobody(what: str, done: int, total: int) -> None:
    """Nobody listens."""


def _extracted(
    scans: Sequence[ScanId], extractor: Extractor, parameters: Parameters, told: Told, check: Check | None
) -> dict[ScanId, SegmentMap]:
    maps: dict[ScanId, SegmentMap] = {}
    for scan in scans:
        if check is not None:
            check()
        maps[scan] = extractor(scan, parameters)
        told("extracting segments", len(maps), len(scans))
    return maps


def _found(whole: WholeMap, asked: Proposed, every: bool) -> Found:
    fates = {link.pair: fate for link, fate in zip(whole.links, whole.optimised.residuals, strict=True)}
    closures = [
        Closure(link, whole.matches[link.pair], fates[link.pair], _of_revisit(revisit))
        for revisit in asked.revisits
        for link in (revisit.closures if every else revisit.chosen)
    ]
    closures += [Closure(link, whole.matches[link.pair], fates[link.pair], TIES) for link in asked.ties]
    once = {closure.integration: closure for closure in closures}  # what ties may be of a revisit, too
    return Found(
        tuple(sorted(once.values(), key=lambda c: (-c.link.confidence, c.link.pair))),
        len(asked.revisits),
        0 if every else asked.others,
        len(asked.silenced),
    )


def new_proposals(found: Found, state: ProjectState) -> tuple[Proposal, ...]:
    """What a search found that nobody has decided on, and the queue has not like this; what others claim stays."""
    return tuple(c.proposal for c in found.closures if _is_new(c.proposal, state))


def _is_new(proposal: Proposal, state: ProjectState) -> bool:
    held = state.proposals.get(proposal.integration)
    free = held is None or (held.kind == "closure" and held != proposal)
    return free and proposal.integration not in state.decisions


def _of_revisit(revisit: Revisit) -> str:
    count = len(revisit.closures)
    return f"{SEARCH}, 1 of {count} pairs that say the same" if count > 1 else SEARCH


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
        """Stop the search; nothing is proposed by it, and what it matched is kept."""
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
            message = "The search for loop closures was stopped. What it matched is kept: search again to go on there."
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
