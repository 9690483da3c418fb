"""One open project: its scans, its matches, its decisions, its merged map. Thread-safe; long work is done elsewhere."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from app.changes import Change, changed, events_of, is_accepted, settings_of
from app.claims import suggested_rank, with_claim
from app.comparing import Others
from app.creation import Filled, Source, put_in, read_sources
from app.deciding import choose
from app.errors import UnknownError
from app.inputs import Facts, Inputs
from app.jobs import Check, WarmUp
from app.later import Later
from app.listeners import Listener, Listeners
from app.listing import Listing
from app.loops import Loops
from app.matching import Matching, Progress, Settings
from app.merged import Extractor, Merged, MergedMap, map_parameters
from app.pairs import Pairs
from app.posegraph import Solver, graph_of
from app.queue_text import QueueTexts
from app.queueing import Queueing
from app.reporting import Reporter
from app.review import Outcome, Rows
from app.searching import SEARCH, WORKERS, Found, new_proposals
from app.steps import Steps
from segmap.errors import SegmapError
from segmap.events import Choice, Event, IntegrationId
from segmap.export import Record, thumbnail
from segmap.integration import Match, chosen_heuristic, match_maps
from segmap.merging import Component
from segmap.project import ProjectState
from segmap.scans import LaserLog, LaserScan, ScanId
from segmap.segments import SegmentMap
from segmap.store import Store

__all__ = ["PICTURE", "Change", "Session"]

Finder = Callable[..., Match]
PICTURE = "picture"
"""key of the merged map's picture among the results in the project file; empty: there is no map"""


class Session(Steps, Queueing):
    """An open project. Listeners hear of everything that happens in it, from whichever thread it happened in."""

    def __init__(
        self,
        id: str,
        store: Store,
        *,
        known_logs: Mapping[int, LaserLog] | None = None,
        warm_up: WarmUp | None = None,
        workers: int = 1,
        search_workers: int = WORKERS,
        find: Finder = match_maps,
    ) -> None:
        chosen_heuristic(store.state.mode, store.state.heuristic)
        self.id, self._store, self._find, self._warm_up = id, store, find, warm_up
        self._lock = threading.RLock()
        self._listeners = Listeners()
        self._tell = self._listeners.tell
        self._state = store.state
        self._inputs = Inputs(store, self._state.logs, store.log_bytes, known_logs)
        self.extractor: Extractor = self._inputs.segment_map
        """the segments of a scan under any parameters"""
        self._pairs, self._integrations = Pairs(), tuple[str, ...]()
        self._rows, self._listing = Rows(()), Listing()
        self._later, self._texts = Later(store), QueueTexts()
        self._matching = Matching(
            store,
            self._match,
            told=self._matched,
            changed=self._progressed,
            prepare=self._prepare,
            workers=workers,
        )
        self._solve = solve = Solver()
        self._reporter = Reporter(self._inputs.segment_map, self._matching.outcome, self._inputs.facts)
        self.loops = Loops(
            self,
            store,
            solve=solve,
            prepare=self._prepare,
            take=self._take_closures,
            optimised=self._optimised,
            searching=self._tell,
            workers=search_workers,
        )
        self._map = MergedMap(
            lambda: self._state,
            self._inputs.segment_map,
            solve,
            done=self._merged,
            failed=lambda why: self._tell({"type": "error", "message": why}),
            prepare=self._prepare,
        )
        self.others = Others(self, lambda: self._tell({"type": "other"}), self._prepare)
        start = ProjectState(parameters=self._state.parameters)
        self._follow(Change(self._state, changed(start, self._state)), start)

    # --- what there is ----------------------------------------------------------------------------

    @property
    def state(self) -> ProjectState:
        """What is in force now."""
        return self._state

    @property
    def scan_ids(self) -> tuple[ScanId, ...]:
        """All scans, in order."""
        return self._inputs.scan_ids

    @property
    def integrations(self) -> tuple[str, ...]:
        """The ids of all integrations, in order: consecutive scans of each log, and pairs that were proposed."""
        return self._integrations

    def scan(self, scan_id: ScanId) -> LaserScan:
        """A scan, as read. Raises UnknownError or ScanError where there is none."""
        return self._inputs.scan(scan_id)

    def segment_map(self, scan_id: ScanId) -> SegmentMap:
        """The segments of a scan, under the parameters in force."""
        return self._inputs.segment_map(scan_id, self._state.parameters)

    @property
    def picture(self) -> str:
        """A small SVG of the merged map; empty where nothing is accepted."""
        return self._store.get_result(PICTURE) or ""

    def log(self, index: int) -> LaserLog:
        """A log, as read. Raises UnknownError where there is none."""
        return self._inputs.log(index)

    def log_facts(self, index: int) -> Facts:
        """What was found out about a log when it was read."""
        return self._inputs.facts(index)

    def add_logs(self, sources: Sequence[Source], who: str = "") -> Filled:
        """Put more logs into the project; what was left out of them is told.

        Raises:
            LogError: none can be read, or all are in the project already.
        """
        read = read_sources(sources)
        with self._lock:
            before = self._state
            filled = put_in(self._store, read, who)
            self._inputs.add(self._store.state.logs, filled.logs)
            change = self._take_over(before)
        self._tell_change(before, change)
        return filled

    # --- matches ----------------------------------------------------------------------------------

    def match(self, integration: str, heuristic: str | None = None) -> Match | None:
        """What was found for an integration; None: not computed yet. Default: by the project's heuristic.

        Poses that somebody claims for the pair, or laid by hand, are its last candidates.
        """
        found, state = self._matching.match(self._checked(integration), self._heuristic(heuristic)), self._state
        if found is None:
            return None
        judged, proposal = found.judged(state.parameters), state.proposals.get(integration)
        if proposal is None or (proposal.T_1_2 is None and proposal.nudge is None):
            return judged
        pair = IntegrationId.parse(integration)
        maps = self.segment_map(pair.first), self.segment_map(pair.second)
        return with_claim(judged, proposal, maps, state.parameters)

    def outcome(self, integration: str, heuristic: str | None = None) -> Outcome | None:
        """The same in short, with the reason where it failed."""
        return self._matching.outcome(self._checked(integration), self._heuristic(heuristic))

    def request(self, integration: str, heuristic: str | None = None) -> None:
        """Compute this match next, before everything that waits; the event ``match`` tells when it is there."""
        self._matching.ask(self._checked(integration), self._heuristic(heuristic))

    @property
    def progress(self) -> Progress:
        """How far matching by the project's heuristic is."""
        return self._matching.progress

    def cancel(self) -> None:
        """Stop matching in the background."""
        self._matching.cancel()

    def resume(self) -> None:
        """Go on with matching."""
        self._matching.resume()

    def suggested(self, integration: str, heuristic: str | None = None) -> int:
        """The rank of the candidate to begin with: where our own search says that the scans lie, else the best."""
        return suggested_rank(self._state.proposals.get(integration), lambda: self.match(integration, heuristic))

    # --- the merged map ---------------------------------------------------------------------------

    def components(self) -> tuple[Component, ...]:
        """The merged map as last computed."""
        return self._map.current.components

    @property
    def merging(self) -> bool:
        """Whether the merged map is being computed again."""
        return self._map.busy

    def merged(self, timeout: float | None = None) -> Merged:
        """The merged map of what is accepted now, waiting for it at most ``timeout`` seconds.

        Raises:
            ProjectError: it takes longer, or cannot be computed.
        """
        return self._map.wait(timeout)

    def history(self, revision: int) -> tuple[Event, ...]:
        """What happened up to a revision."""
        return tuple(event for event in self._store.events() if event.seq <= revision)

    def record(self) -> Record:
        """All a report tells beside the map: decisions, evidence, the pose graph of what is accepted now."""
        return self._reporter.record(
            self._state, graph_of(self._state, self._solve, before=self.loops.graph), self.scan_ids
        )

    # --- listening, and the end -------------------------------------------------------------------

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call ``listener`` with every event, from any thread, until what is given back is called.

        Events are JSON-able and have a ``type``: match, decision, progress, graph, map, search, parameters,
        project, log, other, deleted or error.
        """
        return self._listeners.add(listener)

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until nothing is left to compute; False when the time, in seconds, ran out before."""
        parts = (self.loops, self._matching, self._map, self.others)
        return all(part.settle(timeout) for part in parts)

    @property
    def idle(self) -> bool:
        """Whether nobody listens, and nothing is under way or was stopped halfway."""
        return not self._listeners and not self._matching.progress.cancelled and self.settle(0.0)

    def leave(self) -> None:
        """Tell everybody that the project was deleted and is about to be closed."""
        self._tell({"type": "deleted"})

    def close(self) -> None:
        """Stop all work and close the project file."""
        for part in (self.loops, self._matching, self._map, self.others):
            part.close()
        self._store.close()

    # --- within -----------------------------------------------------------------------------------

    def _checked(self, integration: str) -> str:
        if integration not in self._rows:
            raise UnknownError(f"This project has no integration {integration[:80]!r}.")
        return integration

    def _listed(self, integration: str) -> str:
        if integration not in self._integrations:
            raise UnknownError(f"The project has no integration {integration[:80]!r} any more.")
        return integration

    def _heuristic(self, name: str | None) -> str:
        return self._state.heuristic if name is None else chosen_heuristic(self._state.mode, name)

    def _choice(self, integration: str, verdict: str, heuristic: str, rank: int | None) -> Choice:
        rank = self.suggested(integration, heuristic) if rank is None else rank
        outcome = self.outcome(self._checked(integration), heuristic)
        match = self.match(integration, heuristic) if rank or outcome is None or outcome.pose is None else None
        return choose(integration, verdict, heuristic, self._state, outcome, match, rank)

    def _commit(self, event: Event, expected_revision: int | None = None) -> Change:
        """Record a step, follow it, and tell everybody. What is returned is on the disk."""
        with self._lock:
            before = self._state
            self._store.append(event, expected_revision)
            change = self._take_over(before)
        self._tell_change(before, change)
        return change

    def catch_up(self) -> None:
        """Take over what another program has written into the project, and tell everybody.

        Raises:
            ProjectError: the file cannot be read.
        """
        with self._lock:
            before = self._state
            if self._store.refresh().revision == before.revision:
                return
            change = self._take_over(before)
        self._tell_change(before, change)

    def _take_over(self, before: ProjectState) -> Change:
        """Let the state on the disk be the one in force."""
        self._state = self._store.state
        if self._state.logs != before.logs:
            self._inputs.add(self._state.logs, {})
        change = Change(self._state, changed(before, self._state))
        self._resort(change.integrations if settings_of(before) == settings_of(self._state) else None)
        self._later.discard(name for name in change.integrations if name in self._state.decisions)
        self._follow(change, before)
        return change

    def _follow(self, change: Change, before: ProjectState) -> None:
        """Let the matches and the merged map be those of a state."""
        state = change.state
        integrations = self._pairs.of(state, self._inputs.scan_ids)
        if integrations is not self._integrations:
            self._integrations = integrations
            self._rows.add(integrations)
            self._resort()
        self._matching.use(Settings(state.parameters, state.mode), state.heuristic, self._integrations)
        placed = any(is_accepted(s, name) for s in (before, state) for name in change.integrations)
        if placed:
            self.loops.optimise()
        if placed or map_parameters(before.parameters) != map_parameters(state.parameters):
            self._map.ask()

    def _tell_change(self, before: ProjectState, change: Change) -> None:
        for event in events_of(before, change, self._row_told):
            self._tell(event)
        if settings_of(before) != settings_of(change.state) or before.logs != change.state.logs:
            self._progressed()

    def _row_told(self, integration: str) -> Mapping[str, Any] | None:
        return self.row(integration).to_json() if integration in self._rows else None

    def _match(self, integration: str, heuristic: str, settings: Settings, check: Check) -> Match:
        first, second = IntegrationId.parse(integration)
        maps = [self._inputs.segment_map(scan_id, settings.parameters) for scan_id in (first, second)]
        check()
        return self._find(*maps, settings.searched, heuristic, settings.mode, check=check)

    def _tell_all(self, event: Mapping[str, Any]) -> None:
        self._tell(event)

    def get_ready(self) -> None:
        """Wait until the kernels are compiled: a request that compiled them itself would hold up every other."""
        self._prepare(lambda: None)

    def _prepare(self, check: Check) -> None:
        if self._warm_up is not None:
            self._warm_up.wait(check)

    def _matched(self, integration: str, heuristic: str) -> None:
        self._resort([integration])
        row = self.row(integration).to_json()
        self._tell({"type": "match", "integration": integration, "heuristic": heuristic, "row": row})

    def _merged(self, merged: Merged) -> None:
        """Keep a picture for the list of projects, where sessions are not opened."""
        with suppress(SegmapError):
            self._store.put_result(PICTURE, thumbnail(merged.components) if merged.components else "")
        self._tell({"type": "map", "revision": merged.revision, "hash": merged.hash})

    def _optimised(self) -> None:
        self._regraph()
        self._tell({"type": "graph", "revision": self.loops.graph.revision})

    def _take_closures(self, found: Found) -> str:
        """Propose what a search found."""
        return found.in_words(len(self.propose(new_proposals(found, self._state), who=SEARCH).integrations))

    def _progressed(self) -> None:
        self._tell({"type": "progress", **self.progress.to_json()})
