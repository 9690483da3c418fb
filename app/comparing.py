"""Other maps of a project's scans to compare the merged one with: earlier states, and other methods."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import TYPE_CHECKING

from app.errors import UnknownError
from app.jobs import Check, Latest
from app.map_looks import Other
from app.merged import merge_project
from app.posegraph import edges_of
from segmap.errors import CancelledError, SegmapError
from segmap.merging import Component, calls_needed, merge, merge_accepted
from segmap.project import ProjectState, replay

if TYPE_CHECKING:
    from app.session import Session

__all__ = ["Others"]

BEFORE = "before:"
"""begins the name of an earlier state; the number of the step it lies before follows"""
GIVEN = "given"
METHODS = {"sequential": "The sequential method, no decisions", "tree": "The tree method, no decisions"}
MOST_CALLS = 600
"""calls of INTEGRATE; where a method needs more it is not offered"""
STEPS = 40
"""earlier states that are offered, the latest first"""
KEPT = 4
"""maps that are remembered"""


class Others:
    """Computes other maps in a thread of its own, one at a time, and remembers the last ones. Thread-safe."""

    def __init__(self, session: Session, told: Callable[[], None], prepare: Callable[[Check], None]) -> None:
        self._session, self._told, self._prepare = session, told, prepare
        self._lock = threading.Lock()
        self._held: OrderedDict[tuple[str, object], Other] = OrderedDict()
        self._wanted: tuple[str, object] | None = None
        self._latest = Latest(self._compute, "comparing")
        self.settle, self.close = self._latest.settle, self._latest.close

    def options(self) -> list[dict[str, str]]:
        """What the merged map can be compared with: name and title."""
        state, session = self._session.state, self._session
        offered = [{"name": GIVEN, "title": _title(GIVEN, state)}] if session.components() else []
        sizes = [log.scans for log in state.logs]
        offered += [
            {"name": name, "title": title}
            for name, title in METHODS.items()
            if 0 < calls_needed(sizes, name) <= MOST_CALLS
        ]
        steps = [f"{BEFORE}{step.seq}" for step in reversed(state.done[-STEPS:])]
        return [*offered, *({"name": name, "title": _title(name, state)} for name in steps)]

    def check(self, name: str) -> None:
        """Raise UnknownError where there is no such map."""
        number = name.removeprefix(BEFORE)
        if name not in (GIVEN, *METHODS) and not (name.startswith(BEFORE) and number.isdecimal() and len(number) < 12):
            raise UnknownError(f"There is no map {name[:80]!r} to compare with.")

    def get(self, name: str) -> Other:
        """Another map; where it is not known yet it is computed, and ``told`` is called when it is there."""
        key = name, self._depends(name)
        with self._lock:
            held = self._held.get(key)
            if held is not None:
                self._held.move_to_end(key)
                return held
            if self._wanted == key:
                return Other(name, _title(name, self._session.state), problem="being computed")
            self._wanted = key
        self._latest.ask()
        return Other(name, _title(name, self._session.state), problem="being computed")

    def _depends(self, name: str) -> object:
        """What a map of this name is made from: it is computed again when that has changed."""
        state = self._session.state
        if name.startswith(BEFORE):
            return None
        accepted = tuple(edges_of(state)) if name == GIVEN else ()
        return state.fingerprint, state.mode, state.heuristic, len(state.logs), accepted

    def _compute(self, check: Check) -> None:
        self._prepare(check)
        with self._lock:
            key = self._wanted
        if key is None:
            return
        name, _ = key
        try:
            made = Other(name, _title(name, self._session.state), self._made(name, check))
        except CancelledError:
            raise
        except SegmapError as error:
            made = Other(name, _title(name, self._session.state), problem=str(error))
        with self._lock:
            self._held[key] = made
            while len(self._held) > KEPT:
                self._held.popitem(last=False)
            self._wanted = None if self._wanted == key else self._wanted
        self._told()

    def _made(self, name: str, check: Check) -> tuple[Component, ...]:
        session = self._session
        if name.startswith(BEFORE):
            state = replay(session.history(int(name.removeprefix(BEFORE)) - 1))
            return merge_project(state, session.extractor, check=check).components
        state = session.state
        if name == GIVEN:
            accepted = [(edge.first, edge.second, edge.T_1_2) for edge in edges_of(state)]
            scans = sorted({scan for a, b, _ in accepted for scan in (a, b)})
            maps = {scan: session.extractor(scan, state.parameters) for scan in scans}
            return merge_accepted(maps, accepted, state.parameters, check=check)
        return self._by_method(name, state, check)

    def _by_method(self, method: str, state: ProjectState, check: Check) -> tuple[Component, ...]:
        session, maps = self._session, {}
        for scan in session.scan_ids:
            check()
            maps[scan] = session.extractor(scan, state.parameters)
        found = merge(maps, state.parameters, state.heuristic, state.mode, method, check=check)
        return found.components


def _title(name: str, state: ProjectState) -> str:
    """What a map is called, for people."""
    if name == GIVEN:
        return "As accepted, without the pose graph"
    if not name.startswith(BEFORE):
        return METHODS.get(name, name)
    step = next((step for step in state.done if f"{BEFORE}{step.seq}" == name), None)
    return f"Before: {step.description}" if step else f"Before step {name.removeprefix(BEFORE)}"
