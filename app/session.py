"""One open project: its scans, its matches, its decisions, its merged map. Thread-safe; long work is done elsewhere."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from app.criterion import CRITERIA, Criterion
from app.deciding import choose, in_force
from app.errors import UnknownError
from app.inputs import Facts, Inputs
from app.jobs import Check, WarmUp
from app.listeners import Listener, Listeners
from app.matching import Matching, Progress, Settings
from app.merged import Merged, MergedMap, map_parameters
from app.modes import heuristic_in, parameters_in
from app.review import Flips, Outcome, Row, Rows, counts, flips, queue
from segmap.errors import SegmapError
from segmap.events import Choice, Clear, Decide, Event, IntegrationId, Redo, SetHeuristic, SetParameters, Undo
from segmap.export import thumbnail
from segmap.integration import Match, chosen_heuristic, match_maps
from segmap.merging import Component
from segmap.parameters import preset
from segmap.project import ProjectState
from segmap.scans import LaserLog, LaserScan, ScanId
from segmap.segments import SegmentMap
from segmap.store import Store

__all__ = ["PICTURE", "Change", "Session"]

Finder = Callable[..., Match]
PICTURE = "picture"
"""key of the merged map's picture among the results in the project file; empty: there is no map"""
ROWS_TOLD = 200
"""rows sent along with an event; a page loads the queue again when more changed"""


@dataclass(frozen=True)
class Change:
    """The state after a step, and the integrations whose decision it changed."""

    state: ProjectState
    integrations: tuple[str, ...] = ()


class Session:
    """An open project. Listeners hear of everything that happens in it, from whichever thread it happened in."""

    def __init__(
        self,
        id: str,
        store: Store,
        *,
        known_logs: Mapping[int, LaserLog] | None = None,
        warm_up: WarmUp | None = None,
        workers: int = 1,
        find: Finder = match_maps,
    ) -> None:
        chosen_heuristic(store.state.mode, store.state.heuristic)
        self.id, self._store, self._find, self._warm_up = id, store, find, warm_up
        self._lock = threading.RLock()
        self._listeners = Listeners()
        self._tell = self._listeners.tell
        self._state = store.state
        self._inputs = Inputs(store, self._state.logs, store.log_bytes, known_logs)
        self._integrations = tuple(_consecutive(self._inputs.scan_ids))
        self._rows = Rows(self._integrations)
        self._version, self._queue = 0, (-1, tuple[Row, ...]())
        self._matching = Matching(
            store,
            self._integrations,
            self._match,
            told=self._matched,
            changed=self._progressed,
            prepare=self._prepare,
            workers=workers,
        )
        self._map = MergedMap(
            lambda: self._state,
            self._inputs.segment_map,
            done=self._merged,
            failed=lambda why: self._tell({"type": "error", "message": why}),
            prepare=self._prepare,
        )
        start = ProjectState(parameters=self._state.parameters)
        self._follow(Change(self._state, _changed(start, self._state)), start)

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
        """The ids of all integrations: consecutive scans of each log, in order."""
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

    def log_facts(self, index: int) -> Facts:
        """What was found out about a log when it was read."""
        return self._inputs.facts(index)

    # --- matches ----------------------------------------------------------------------------------

    def match(self, integration: str, heuristic: str | None = None) -> Match | None:
        """What was found for an integration; None: not computed yet. Default: by the project's heuristic."""
        found = self._matching.match(self._checked(integration), self._heuristic(heuristic))
        return None if found is None else found.judged(self._state.parameters)

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

    # --- the review queue -------------------------------------------------------------------------

    def row(self, integration: str) -> Row:
        """An integration as the queue shows it."""
        state = self._state
        return self._rows.row(self._checked(integration), state, self._matching.outcome(integration, state.heuristic))

    def rows(self) -> list[Row]:
        """The review queue, the integration that most needs a person first."""
        with self._lock:
            version, held = self._queue
            if version != self._version:
                state, version = self._state, self._version
                held = tuple(queue((self.row(name) for name in self._integrations), state.mode, state.parameters))
                self._queue = (version, held)
            return list(held)

    def counts(self) -> Mapping[str, int]:
        """How many integrations there are, in all and in each state."""
        return counts(self.rows())

    @property
    def criterion(self) -> Criterion:
        """What the threshold is about in the project's mode."""
        return CRITERIA[self._state.mode]

    def preview_threshold(self, value: float) -> Flips:
        """The undecided integrations that another threshold of the criterion would flip.

        Raises:
            ParameterError: it is out of bounds.
        """
        state, rows = self._state, self.rows()
        parameters = self.criterion.moved(state.parameters, value)
        found = {r.id: self._matching.outcome(r.id, state.heuristic) for r in rows}
        return flips(rows, [self._rows.tried(id, state, outcome, parameters) for id, outcome in found.items()])

    # --- decisions --------------------------------------------------------------------------------

    def decide(
        self,
        integrations: Sequence[str],
        verdict: str,
        *,
        candidate: int | None = None,
        heuristic: str | None = None,
        reason: str = "",
        who: str = "",
        expected_revision: int | None = None,
    ) -> Change:
        """Accept or reject integrations in one step; what is decided so already stays as it is.

        ``candidate`` is a rank among the match's candidates, default the best.

        Raises:
            UnknownError: there is no such integration or candidate.
            ProjectError: an integration to be accepted has no transformation (yet).
            ConflictError: one was decided by somebody after ``expected_revision``.
        """
        rank, name = candidate or 0, self._heuristic(heuristic)
        with self._lock:
            choices = [self._choice(id, verdict, name, rank) for id in dict.fromkeys(integrations)]
            new = tuple(choice for choice in choices if not in_force(choice, self._state))
            if not new:
                return Change(self._state)
            return self._commit(Decide(choices=new, who=who, reason=reason), expected_revision)

    def clear(
        self, integrations: Sequence[str], *, who: str = "", reason: str = "", expected_revision: int | None = None
    ) -> Change:
        """Make integrations undecided again, in one step."""
        names = tuple(dict.fromkeys(self._checked(name) for name in integrations))
        return self._commit(Clear(integrations=names, who=who, reason=reason), expected_revision)

    def undo(self, who: str = "", *, expected_revision: int | None = None) -> Change:
        """Take the last step back. Raises ProjectError where there is none."""
        return self._commit(Undo(who=who), expected_revision)

    def redo(self, who: str = "", *, expected_revision: int | None = None) -> Change:
        """Bring the step undone last back into force. Raises ProjectError where there is none."""
        return self._commit(Redo(who=who), expected_revision)

    def set_parameters(self, changes: Mapping[str, Any], *, who: str = "") -> Change:
        """Change some parameters. Raises ParameterError for unknown names and impossible values."""
        return self.configure(changes, who=who)

    def set_heuristic(self, heuristic: str, *, who: str = "") -> Change:
        """Match by another heuristic. Raises ParameterError where there is no such heuristic."""
        return self.configure({}, heuristic=heuristic, who=who)

    def configure(
        self,
        changes: Mapping[str, Any],
        *,
        preset_name: str | None = None,
        heuristic: str | None = None,
        mode: str | None = None,
        who: str = "",
    ) -> Change:
        """Change parameters, from those in force or from a preset, the heuristic and the mode; all or nothing.

        Another mode brings its own heuristic and threshold of the value, where those before were the defaults.

        Raises:
            ParameterError: a name is unknown, or a value impossible.
        """
        with self._lock:
            wanted = mode or self._state.mode
            name = heuristic_in(wanted, self._state, heuristic)
            base = parameters_in(wanted, self._state) if preset_name is None else preset(preset_name)
            parameters, change = base.replace(**changes), Change(self._state)
            if parameters != self._state.parameters:
                change = self._commit(SetParameters(parameters=parameters, who=who))
            if (name, wanted) != (self._state.heuristic, self._state.mode):
                change = self._commit(SetHeuristic(heuristic=name, mode=wanted, who=who))
            return change

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

    # --- listening, and the end -------------------------------------------------------------------

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call ``listener`` with every event, from any thread, until what is given back is called.

        Events are JSON-able and have a ``type``: match, decision, progress, map, parameters or error.
        """
        return self._listeners.add(listener)

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until nothing is left to compute; False when the time, in seconds, ran out before."""
        return self._matching.settle(timeout) and self._map.settle(timeout)

    def close(self) -> None:
        """Stop all work and close the project file."""
        self._matching.close()
        self._map.close()
        self._store.close()

    # --- within -----------------------------------------------------------------------------------

    def _checked(self, integration: str) -> str:
        if integration not in self._rows:
            raise UnknownError(f"This project has no integration {integration[:80]!r}.")
        return integration

    def _heuristic(self, name: str | None) -> str:
        return self._state.heuristic if name is None else chosen_heuristic(self._state.mode, name)

    def _choice(self, integration: str, verdict: str, heuristic: str, rank: int) -> Choice:
        outcome = self.outcome(integration, heuristic)
        match = self.match(integration, heuristic) if rank else None
        return choose(integration, verdict, heuristic, self._state, outcome, match, rank)

    def _commit(self, event: Event, expected_revision: int | None = None) -> Change:
        """Record a step, follow it, and tell everybody. What is returned is on the disk."""
        with self._lock:
            before = self._state
            self._store.append(event, expected_revision)
            self._state = self._store.state
            change = Change(self._state, _changed(before, self._state))
            self._version += 1
            self._follow(change, before)
        self._tell_change(before, change)
        return change

    def _follow(self, change: Change, before: ProjectState) -> None:
        """Let the matches and the merged map be those of a state."""
        state = change.state
        self._matching.use(Settings(state.parameters, state.mode), state.heuristic)
        placed = any(_accepted(s, name) for s in (before, state) for name in change.integrations)
        if placed or map_parameters(before.parameters) != map_parameters(state.parameters):
            self._map.ask()

    def _tell_change(self, before: ProjectState, change: Change) -> None:
        state = change.state
        told = {"revision": state.revision, "undo": state.can_undo, "redo": state.can_redo}
        if change.integrations:
            rows = [self.row(name).to_json() for name in change.integrations if name in self._rows]
            self._tell({"type": "decision", **told, "integrations": change.integrations, "rows": rows[:ROWS_TOLD]})
        if _settings_of(before) != _settings_of(state):
            parameters = state.parameters.model_dump(mode="json")
            method = {"heuristic": state.heuristic, "mode": state.mode}
            self._tell({"type": "parameters", **told, "parameters": parameters, **method})
            self._progressed()

    def _match(self, integration: str, heuristic: str, settings: Settings, check: Check) -> Match:
        first, second = IntegrationId.parse(integration)
        maps = [self._inputs.segment_map(scan_id, settings.parameters) for scan_id in (first, second)]
        check()
        return self._find(*maps, settings.searched, heuristic, settings.mode, check=check)

    def _prepare(self, check: Check) -> None:
        if self._warm_up is not None:
            self._warm_up.wait(check)

    def _matched(self, integration: str, heuristic: str) -> None:
        with self._lock:
            self._version += 1
        row = self.row(integration).to_json()
        self._tell({"type": "match", "integration": integration, "heuristic": heuristic, "row": row})

    def _merged(self, merged: Merged) -> None:
        """Keep a picture for the list of projects, where sessions are not opened."""
        with suppress(SegmapError):
            self._store.put_result(PICTURE, thumbnail(merged.components) if merged.components else "")
        self._tell({"type": "map", "revision": merged.revision, "hash": merged.hash})

    def _progressed(self) -> None:
        self._tell({"type": "progress", **self.progress.to_json()})


def _consecutive(scan_ids: Sequence[ScanId]) -> Iterator[str]:
    """The integrations of consecutive scans of each log."""
    return (str(IntegrationId(a, b)) for a, b in pairwise(scan_ids) if a.log == b.log)


def _accepted(state: ProjectState, integration: str) -> bool:
    decision = state.decisions.get(integration)
    return decision is not None and decision.verdict == "accepted"


def _settings_of(state: ProjectState) -> tuple[object, ...]:
    return state.parameters, state.heuristic, state.mode


def _changed(before: ProjectState, after: ProjectState) -> tuple[str, ...]:
    """The integrations whose decision is another one, in order."""
    names = {*before.decisions, *after.decisions}
    changed = [IntegrationId.parse(n) for n in names if before.decisions.get(n) != after.decisions.get(n)]
    return tuple(str(integration) for integration in sorted(changed))
