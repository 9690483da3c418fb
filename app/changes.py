"""What a step changed in a project, and how it is told. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from segmap.events import IntegrationId
from segmap.project import ProjectState

__all__ = ["Change", "changed", "events_of", "is_accepted", "settings_of", "told"]

ROWS_TOLD = 200
"""rows sent along with an event; a page loads the queue again when more changed"""


@dataclass(frozen=True)
class Change:
    """The state after a step, and the integrations that were decided, or proposed, otherwise by it."""

    state: ProjectState
    integrations: tuple[str, ...] = ()


def changed(before: ProjectState, after: ProjectState) -> tuple[str, ...]:
    """The integrations whose decision or proposal is another one, in order."""
    names = {*_different(before.decisions, after.decisions), *_different(before.proposals, after.proposals)}
    return tuple(map(str, sorted(map(IntegrationId.parse, names))))


def _different(before: Mapping[str, object], after: Mapping[str, object]) -> Iterator[str]:
    """The names under which there is something else."""
    for name, one in after.items():
        held = before.get(name)
        if held is not one and held != one:
            yield name
    yield from before.keys() - after.keys()


def is_accepted(state: ProjectState, integration: str) -> bool:
    """Whether an integration is accepted."""
    decision = state.decisions.get(integration)
    return decision is not None and decision.verdict == "accepted"


def settings_of(state: ProjectState) -> tuple[object, ...]:
    """What matches depend on."""
    return state.parameters, state.heuristic, state.mode


def told(state: ProjectState) -> Mapping[str, Any]:
    """What every event about a step says."""
    return {"revision": state.revision, "undo": state.can_undo, "redo": state.can_redo}


def events_of(before: ProjectState, change: Change, row_of: Callable[[str], Mapping[str, Any] | None]) -> list[Any]:
    """What to tell everybody about a step; ``row_of`` gives the row of an integration, where it still has one."""
    state = change.state
    common, events = told(state), []
    if before.name != state.name:
        events.append({"type": "project", **common, "name": state.name})
    if change.integrations:
        rows = [row for name in change.integrations[:ROWS_TOLD] if (row := row_of(name)) is not None]
        events.append({"type": "decision", **common, "integrations": change.integrations, "rows": rows})
    if settings_of(before) != settings_of(state):
        parameters = state.parameters.model_dump(mode="json")
        method = {"heuristic": state.heuristic, "mode": state.mode}
        events.append({"type": "parameters", **common, "parameters": parameters, **method})
    if before.logs != state.logs:
        events.append({"type": "log", **common, "logs": [log.name for log in state.logs[len(before.logs) :]]})
    return events
